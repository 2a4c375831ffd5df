"""Vertex normals: a coarse mesh with the normals of a sphere shades by them, however it is placed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from renderer import render
from renderer.build import build
from renderer.plan.plan import make_plan
from scenes.description.shapes import TriangleMesh
from scenes.pbrt.parser import parse_file
from scenes.pbrt.write.scene import to_pbrt
from tests.kit.scene_texts import world

POINTS = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
NORMALS = np.array([[-0.5, -0.4, -1.0], [0.6, -0.2, -1.0], [0.1, 0.5, -1.2]])
LIGHT = np.array([0.7, 0.4, -2.0])
CAMERA = (
    'LookAt 0 0 -4 0 0 0 0 1 0 Camera "perspective" "float fov" 8 '
    'Film "rgb" "integer xresolution" 9 "integer yresolution" 9 '
    'PixelFilter "box" "float xradius" 1e-9 "float yradius" 1e-9\nWorldBegin\n'
)
LIT = f'LightSource "point" "rgb I" [ 1 1 1 ] "point3 from" [ {" ".join(map(str, LIGHT))} ]\n'
GRAY = 'Material "diffuse" "rgb reflectance" [ .5 .5 .5 ]\n'


def triangle(points: np.ndarray = POINTS, normals: np.ndarray | None = NORMALS) -> str:
    text = f'Shape "trianglemesh" "point3 P" [ {" ".join(map(str, points.ravel()))} ]'
    return text if normals is None else f'{text} "normal N" [ {" ".join(map(str, normals.ravel()))} ]'


def image_of(body: str, tmp_path: Path, estimator: str = "mis") -> np.ndarray:
    path = tmp_path / "s.pbrt"
    path.write_text(CAMERA + LIT + GRAY + body)
    return render(parse_file(path), estimator=estimator, spp=1).image


def expected(normals: np.ndarray = NORMALS) -> np.ndarray:
    """0.5 / pi cos / d^2 with the cosine of the interpolated normal, at the centres of the pixels."""
    half = np.tan(np.radians(4.0)) * 4.0
    at = (np.arange(9) + 0.5) / 9 * 2 - 1
    x, y = np.tile(at * half, (9, 1)), np.tile(-at * half, (9, 1)).T
    p = np.stack([x, y, np.zeros_like(x)], axis=-1)
    weights = np.linalg.solve(np.vstack([POINTS[:, :2].T, np.ones(3)]), [x.ravel(), y.ravel(), np.ones(81)])
    assert (weights > 0).all()
    n = (weights.T @ normals).reshape(9, 9, 3)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    to = LIGHT - p
    squared = (to**2).sum(axis=-1)
    return 0.5 / np.pi * np.abs((n * to).sum(axis=-1)) / squared**1.5


BODIES = {
    "as it stands": triangle(),
    "other side out": "ReverseOrientation " + triangle(),
    "other winding": triangle(POINTS[[0, 2, 1]], NORMALS[[0, 2, 1]]),
    "mirrored": "Scale -1 1 1 " + triangle(POINTS * [-1, 1, 1], NORMALS * [-1, 1, 1]),
    "stretched": "Scale 2 1 1 " + triangle(POINTS / [2, 1, 1], NORMALS * [2, 1, 1]),
    "mirrored instance": 'ObjectBegin "o" '
    + triangle(POINTS * [-1, 1, 1], NORMALS * [-1, 1, 1])
    + ' ObjectEnd Scale -1 1 1 ObjectInstance "o"',
}


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
@pytest.mark.parametrize("estimator", ["mis", "analytic-visibility-unbiased"])
def test_a_point_light_shades_by_the_cosine_of_the_interpolated_normal(
    tmp_path: Path, body: str, estimator: str
) -> None:
    image = image_of(body, tmp_path, estimator)
    np.testing.assert_allclose(image[..., 0], expected(), rtol=1e-4)
    flat = image_of(triangle(normals=None), tmp_path)
    assert np.abs(image / flat - 1).max() > 0.01  # a hundred times the tolerance: flat shading fails


def test_normals_of_no_length_leave_the_geometric_normal(tmp_path: Path) -> None:
    flat = image_of(triangle(normals=None), tmp_path)
    assert np.array_equal(image_of(triangle(normals=0 * NORMALS), tmp_path), flat)


def test_a_normal_that_is_no_number_leaves_its_whole_face_to_the_geometric_normal(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(
        f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz")
    )
    rows = [f"{p[0]} {p[1]} {p[2]} {n[0]} {n[1]} {n[2]}\n" for p, n in zip(POINTS, NORMALS, strict=True)]
    for bad in (False, True):
        vertices = rows[0].rsplit(" ", 1)[0] + " nan\n" + "".join(rows[1:]) if bad else "".join(rows)
        faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        (tmp_path / "m.ply").write_text(header + faces + vertices + "3 0 1 2\n")
        image = image_of('Shape "plymesh" "string filename" "m.ply"', tmp_path)[..., 0]
        truth = expected(np.tile([0.0, 0.0, -1.0], (3, 1))) if bad else expected()
        np.testing.assert_allclose(image, truth, rtol=1e-4)


def test_light_from_behind_a_flat_mesh_leaks_where_the_shading_normal_leans_over_and_no_proof_drops_it() -> (
    None
):
    leaning = np.tile([1.0, 0.0, -0.1], (3, 1))
    below = 'LightSource "point" "point3 from" [ 5 0 0.2 ]\n' + GRAY
    scene = build(world(below + triangle(normals=leaning)))
    assert make_plan(scene).receivers.all()
    assert [d.needed for d in make_plan(scene).decisions if d.effect == "shading normals"] == [True]
    assert build(world(below + triangle(normals=None))).shading_normals is None


@pytest.mark.parametrize("turn", ["", "ReverseOrientation "])
def test_an_emitter_shines_on_the_side_of_its_normals_and_text_keeps_both(turn: str) -> None:
    emitter = 'AreaLightSource "diffuse" "rgb L" [ 1 1 1 ] ' + turn
    for points, normals in ((POINTS, NORMALS), (POINTS[[0, 2, 1]], NORMALS[[0, 2, 1]])):
        scene = world(emitter + triangle(points, normals))
        mesh = scene.shapes[0].geometry
        assert isinstance(mesh, TriangleMesh)
        side = np.cross(mesh.vertices[1] - mesh.vertices[0], mesh.vertices[2] - mesh.vertices[0])[2]
        assert (side * (-1 if mesh.reverse else 1) < 0) == (not turn)
        again = world(to_pbrt(scene).split("WorldBegin")[1]).shapes[0].geometry
        assert isinstance(again, TriangleMesh)
        assert again.reverse == mesh.reverse
        assert again.normals is not None
        assert np.array_equal(again.normals, normals * (-1.0 if turn else 1.0))
