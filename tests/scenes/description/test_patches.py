"""Curved bilinear patches and patches with vertex normals: triangles within the stated error."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.build import build
from scenes.description.patches import OFF_MESH, refined
from scenes.description.shapes import BilinearMesh, TriangleMesh
from tests.kit.scene_texts import world

SADDLE = np.array([[-1.0, 0.2, -1], [1, 0.8, -1], [-1, 0.6, 1], [1, 0.1, 1]])
TEXT = 'Shape "bilinearmesh" "point3 P" [ -1 .2 -1  1 .8 -1  -1 .6 1  1 .1 1 ]'


def bilinear(corners: np.ndarray, uv: np.ndarray) -> np.ndarray:
    u, v = uv[..., :1], uv[..., 1:]
    return (1 - v) * ((1 - u) * corners[0] + u * corners[1]) + v * ((1 - u) * corners[2] + u * corners[3])


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e5])
def test_triangles_stay_within_the_stated_error_of_the_patch(scale: float) -> None:
    """At 7 points of each triangle, against the patch at the same u, v; on its edges to rounding."""
    mesh = refined(SADDLE * scale, np.array([[0, 1, 2, 3]]), None, None, False, True)
    weights = np.random.default_rng(1).dirichlet(np.ones(3), 7)
    points = np.einsum("wk,tkc->twc", weights, mesh.vertices[mesh.faces])
    uv = np.einsum("wk,tkc->twc", weights, mesh.corner_uv())
    off = np.linalg.norm(points - bilinear(SADDLE * scale, uv), axis=2)
    assert off.max() <= OFF_MESH * 2 * scale
    assert off.max() > OFF_MESH * 2 * scale / 20  # no finer than called for
    assert mesh.normals is not None
    u, v = mesh.corner_uv()[mesh.faces == 0][0]
    across = np.cross(SADDLE[1] - SADDLE[0], SADDLE[2] - SADDLE[0])
    assert (u, v) == (0, 0)
    np.testing.assert_allclose(mesh.normals[0], across * scale**2)


def test_neighbours_of_different_fineness_share_their_edge() -> None:
    points = np.array([*SADDLE, [3.0, 0.8, -1], [3, 0.1, 1]])
    mesh = refined(points, np.array([[0, 1, 2, 3], [1, 4, 3, 5]]), None, None, False, True)
    edge = mesh.vertices[np.abs(mesh.vertices[:, 0] - 1) < 1e-12]
    along = (edge[:, 2] + 1) / 2
    np.testing.assert_allclose(edge[:, 1], 0.8 - 0.7 * along, atol=1e-15)


@pytest.mark.parametrize("words", ["", "ReverseOrientation", "Scale -1 1 1"])
def test_the_side_of_a_curved_patch_is_that_of_the_flat_one_that_it_nearly_is(words: str) -> None:
    (bent,) = world(f"{words} {TEXT}").shapes
    (flat,) = world(f'{words} Shape "bilinearmesh" "point3 P" [ -1 0 -1  1 0 -1  -1 0 1  1 0 1 ]').shapes
    assert isinstance(bent.geometry, TriangleMesh) and isinstance(flat.geometry, BilinearMesh)
    assert bent.geometry.reverse == flat.geometry.reverse
    assert bent.geometry.normals is not None
    side = -1 if bent.geometry.reverse else 1
    corners = bent.geometry.vertices[bent.geometry.faces]
    face = side * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("tc,tkc->tk", face, bent.geometry.normals[bent.geometry.faces]) > 0).all()


def test_a_mesh_keeps_its_flat_patches_and_says_what_it_does_with_the_others() -> None:
    points = '"point3 P" [ -1 .2 -1  1 .8 -1  -1 .6 1  1 .1 1  5 0 0  6 0 0  5 1 0  6 1 0 ]'
    scene = world(f'Shape "bilinearmesh" {points} "integer indices" [ 0 1 2 3  4 5 6 7 ]')
    flat, bent = (shape.geometry for shape in scene.shapes)
    assert isinstance(flat, BilinearMesh) and flat.faces.tolist() == [[4, 5, 6, 7]]
    assert isinstance(bent, TriangleMesh)
    assert ["curved patches" in note for note in scene.notes] == [True]


def test_normals_of_a_patch_are_interpolated_bilinearly_and_decide_its_side() -> None:
    patch = 'Shape "bilinearmesh" "point3 P" [ 0 0 0  1 0 0  0 1 0  1 1 0 ] "normal N"'
    (shape,) = world(f"{patch} [ 0 0 1  0 .6 .8  .6 0 .8  0 0 1 ]").shapes
    mesh = shape.geometry
    assert isinstance(mesh, TriangleMesh) and mesh.normals is not None
    corners = np.array([[0, 0, 1.0], [0, 0.6, 0.8], [0.6, 0, 0.8], [0, 0, 1]])
    np.testing.assert_allclose(mesh.normals, bilinear(corners, mesh.vertices[:, :2]), atol=1e-15)
    (down,) = world(f"{patch} [ 0 0 -1  0 0 -1  0 0 -1  0 0 -1 ]").shapes
    assert isinstance(down.geometry, BilinearMesh) and down.geometry.reverse
    wrong = world(f"{patch} [ 0 0 1 ]")
    assert ["as in pbrt" in note for note in wrong.notes] == [True]


def test_interpolated_normals_are_those_of_the_formula() -> None:
    """To 1e-3 at 7 points of each triangle; the facets' own are off by 6e-3."""
    mesh = refined(SADDLE, np.array([[0, 1, 2, 3]]), None, None, False, True)
    assert mesh.normals is not None
    weights = np.random.default_rng(2).dirichlet(np.ones(3), 7)
    given, uv = (np.einsum("wk,tkc->twc", weights, v) for v in (mesh.normals[mesh.faces], mesh.corner_uv()))
    v, u = uv[..., 1:], uv[..., :1]
    along = (1 - v) * (SADDLE[1] - SADDLE[0]) + v * (SADDLE[3] - SADDLE[2])
    across = (1 - u) * (SADDLE[2] - SADDLE[0]) + u * (SADDLE[3] - SADDLE[1])
    true = np.cross(along, across)
    off = [n / np.linalg.norm(n, axis=2, keepdims=True) for n in (given, true)]
    assert np.linalg.norm(off[0] - off[1], axis=2).max() < 1e-3
    corners = mesh.vertices[mesh.faces]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    assert np.linalg.norm(face[:, None] - off[1], axis=2).max() > 5e-3


def test_a_curved_light_emits_from_its_triangles() -> None:
    scene = world(f'AreaLightSource "diffuse" "rgb L" [ 1 1 1 ] {TEXT}')
    (shape,) = scene.shapes
    assert shape.emission is not None and isinstance(shape.geometry, TriangleMesh)
    assert shape.geometry.normals is None
    middle = bilinear(
        SADDLE, np.stack(np.meshgrid(*[(np.arange(200) + 0.5) / 200] * 2), axis=-1).reshape(-1, 2)
    )
    area = refined(SADDLE, np.array([[0, 1, 2, 3]]), None, None, False, False).areas().sum()
    np.testing.assert_allclose(shape.geometry.areas().sum(), area, rtol=1e-12)
    assert 4 < area < 4.6 and len(middle) == 40000


def test_a_texture_lies_bilinearly_on_a_patch() -> None:
    """pbrt interpolates the corners' coordinates in u and v of the patch, also where they fold over.

    The coordinates of a ring of corners, given to a patch whose corners go row by row, are what public files
    have. Two triangles would be off by half of the coordinates' range in the middle.
    """
    corners = "-1 -1 0  1 -1 0  -1 1 0  1 1 0"
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    listed = " ".join(f"{a:g} {b:g}" for a, b in uv)
    board = 'Texture "t" "spectrum" "checkerboard" "rgb tex1" [ 1 1 1 ] "rgb tex2" [ 0 0 0 ] '
    use = 'Material "diffuse" "texture reflectance" "t" '
    text = f'{board}{use}Shape "bilinearmesh" "point3 P" [ {corners} ] "point2 uv" [ {listed} ]'
    scene = world(text + ' LightSource "infinite"')
    mesh = build(scene).description.shapes[0].geometry
    assert isinstance(mesh, TriangleMesh)
    weights = np.random.default_rng(1).dirichlet(np.ones(3), 7)
    points = np.einsum("wk,tkc->twc", weights, mesh.vertices[mesh.faces])
    found = np.einsum("wk,tkc->twc", weights, mesh.corner_uv())
    assert np.abs(found - bilinear(uv, points[..., :2] / 2 + 0.5)).max() < 1e-3
    plain = world(f'Shape "bilinearmesh" "point3 P" [ {corners} ] "point2 uv" [ {listed} ]')
    assert isinstance(build(plain).description.shapes[0].geometry, BilinearMesh)
