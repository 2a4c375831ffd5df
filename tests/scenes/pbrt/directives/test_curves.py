"""Curves as tubes and ribbons of triangles, within the stated error."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import BSpline

from scenes.description.shapes import TriangleMesh
from scenes.errors import SceneError
from scenes.pbrt.directives.curves import OFF_CURVE, SIDES, TO_CUBIC, swept
from scenes.pbrt.parser import parse
from tests.kit.scene_texts import HEAD, world, world_fails

POINTS = np.array([[-2.0, 0.5, 0], [-1, 3, 0], [0, -1, 1], [1, 1.5, 1]])
TEXT = 'Shape "curve" "point3 P" [ -2 .5 0  -1 3 0  0 -1 1  1 1.5 1 ]'
TUBE = TEXT + ' "string type" "cylinder"'


def mesh_of(body: str) -> TriangleMesh:
    (shape,) = world(body).shapes
    assert isinstance(shape.geometry, TriangleMesh)
    return shape.geometry


def bezier(points: np.ndarray, u: np.ndarray) -> np.ndarray:
    """By de Casteljau's algorithm, of any degree."""
    rows = [np.broadcast_to(p, (u.size, 3)) for p in points]
    while len(rows) > 1:
        rows = [a + u[:, None] * (b - a) for a, b in pairwise(rows)]
    return rows[0]


@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize("basis", ["bezier", "bspline"])
def test_every_basis_becomes_the_same_cubic(basis: str, degree: int) -> None:
    """Against de Casteljau's algorithm, and SciPy's B-splines over uniform knots."""
    points, u = POINTS[: degree + 1], np.linspace(0, 1, 9)
    cubic = bezier(TO_CUBIC[basis, degree] @ points, u)
    if basis == "bezier":
        want = bezier(points, u)
    else:
        want = BSpline(np.arange(-degree, degree + 2), points, degree)(u)
    np.testing.assert_allclose(cubic, want, atol=1e-14)


def test_parts_share_points_as_their_basis_has_it() -> None:
    more = TEXT[:-1] + " 2 2 2  3 3 3  4 1 4 ] "
    rest = '"string type" "cylinder" "float width" .1'
    for basis, parts in (("bezier", 2), ("bspline", 4)):
        mesh = mesh_of(f'{more} "string basis" "{basis}" {rest}')
        assert mesh.uv is None  # without a texture
        rings = len(mesh.vertices) // (SIDES + 1)
        assert rings % parts == 0


def test_a_tube_is_round_on_average_and_follows_its_curve() -> None:
    """Its rings lie about the curve's points; their outline is 2.5 % off the width at most, and 1e-3 on
    average over directions. Chords leave the curve by a fortieth of the width."""
    width = 0.3
    points, faces, uv, outward = swept(POINTS[None], np.full(2, width), None)
    rings = points.reshape(-1, SIDES + 1, 3)
    center = rings[:, :-1].mean(axis=1)
    u = uv.reshape(-1, SIDES + 1, 2)[:, 0, 0]
    np.testing.assert_allclose(center, bezier(POINTS, u), atol=1e-12)
    middle = bezier(POINTS, (u[1:] + u[:-1]) / 2)
    off = np.linalg.norm(middle - (center[1:] + center[:-1]) / 2, axis=1).max()
    assert OFF_CURVE * width / 20 < off <= OFF_CURVE * width
    away = rings - center[:, None]
    angle = np.linspace(0, np.pi, 720, endpoint=False)
    x, y = away[0, 0] / np.linalg.norm(away[0, 0]), away[0, SIDES // 4] / np.linalg.norm(away[0, SIDES // 4])
    across = np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y
    outline = np.ptp(across @ away[0].T, axis=1)
    assert np.abs(outline / width - 1).max() < 0.025
    assert abs(outline.mean() / width - 1) < 1e-3
    face = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    assert (np.einsum("tc,tkc->tk", face, outward[faces]) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(outward, axis=1), 1.0)


def test_a_tube_does_not_twist_where_its_curve_winds() -> None:
    """Each edge along a coil turns about it by no more than rounding: parallel transport."""
    t = np.linspace(0, 3, 31)
    coil = np.stack([np.cos(6 * t), np.sin(6 * t), t], axis=1)
    segments = np.stack([coil[i : i + 4] for i in range(0, 28, 3)])
    points, *_ = swept(segments, np.full(len(segments) + 1, 0.05), None)
    rings = points.reshape(len(segments), -1, SIDES + 1, 3)
    away = rings - rings[:, :, :-1].mean(axis=2, keepdims=True)
    turn = np.einsum("srkc,srkc->srk", away[:, 1:], away[:, :-1])
    turn /= np.linalg.norm(away[:, 1:], axis=3) * np.linalg.norm(away[:, :-1], axis=3)
    bend = rings[:, :, :-1].mean(axis=2)
    tangent = np.diff(bend, axis=1)
    tangent /= np.linalg.norm(tangent, axis=2, keepdims=True)
    least = np.einsum("src,src->sr", tangent[:, 1:], tangent[:, :-1]).min()
    assert turn.min() > 2 * least - 1  # 1 - cos of what the tangents turn by, twice


def test_a_ribbon_lies_across_its_normals_with_its_widths() -> None:
    line = 'Shape "curve" "point3 P" [ 0 0 0  1 0 0  2 0 0  3 0 0 ] "string type" "ribbon"'
    mesh = mesh_of(f'{line} "normal N" [ 0 0 2  0 0 1 ] "float width0" .4 "float width1" .2')
    low, high = mesh.vertices.reshape(-1, 2, 3)[[0, -1]]
    np.testing.assert_allclose(low, [[0, -0.2, 0], [0, 0.2, 0]])
    np.testing.assert_allclose(high, [[3, -0.1, 0], [3, 0.1, 0]])
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals, np.tile([0.0, 0, 1], (len(mesh.normals), 1)))
    turned = swept(POINTS[None], np.ones(2), np.array([[0.0, 0, 1], [0, 1, 0]]))
    x, y, z = turned[3].reshape(-1, 2, 3)[:, 0].T
    assert np.abs(np.hypot(x, np.hypot(y, z)) - 1).max() < 1e-12


@pytest.mark.parametrize(("words", "sign"), [("", 1), ("ReverseOrientation", -1), ("Scale -1 1 1", -1)])
def test_sides_turn_as_pbrt_turns_them(words: str, sign: int) -> None:
    mesh = mesh_of(f"{words} {TUBE}")
    side = -1 if mesh.reverse else 1
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    assert mesh.normals is not None
    face = side * np.cross(b - a, c - a)
    assert (np.einsum("tc,tkc->tk", face, mesh.normals[mesh.faces]) > 0).all()
    ring = mesh.vertices[: SIDES + 1]
    assert (sign * np.einsum("kc,kc->k", ring - ring[:-1].mean(axis=0), mesh.normals[: SIDES + 1]) > 0).all()


def test_a_flat_curve_is_a_tube_by_substitution_only() -> None:
    with pytest.raises(SceneError, match="flat"):
        parse(HEAD + TEXT)
    scene = parse(HEAD + TEXT, substitute=True)
    assert scene.content_hash() == world(TUBE).content_hash()
    assert ["round tube" in text for text in scene.substitutions] == [True]


@pytest.mark.parametrize(
    ("body", "column", "words"),
    [
        ('Shape "curve" "string type" "cylinder"', 1, ("4 points",)),
        (TUBE.replace("1 1.5 1 ]", "1 1.5 1 2 2 2 ]"), 1, ("4 points, and 3",)),
        (TUBE + ' "integer degree" 4', len(TUBE) + 2, ("2 or 3, not 4",)),
        (TUBE + ' "string basis" "catmull"', len(TUBE) + 2, ("bezier or bspline",)),
        (TEXT + ' "string type" "round"', len(TEXT) + 2, ("flat, cylinder or ribbon",)),
        (TEXT + ' "string type" "ribbon"', 1, ("2 normals", "not 0")),
        (TUBE + ' "float width" 0', len(TUBE) + 2, ("above 0",)),
        (f'AreaLightSource "diffuse" {TUBE}', 27, ("cannot sample",)),
    ],
)
def test_curves_that_cannot_be_are_refused_where_they_stand(
    body: str, column: int, words: tuple[str, ...]
) -> None:
    world_fails(body, 1, column, *words)
