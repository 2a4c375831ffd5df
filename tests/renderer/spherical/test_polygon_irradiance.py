"""The irradiance of polygons against Lambert's sum in 50 digits: tiny, near, edge-on, low, and clipped by the
horizon.
"""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from renderer.interfaces.light import LIGHTS
from renderer.math.vectors import normalize
from renderer.spherical.projected import LAMBERT, projected_solid_angle, sample
from renderer.spherical.sectors import NARROW
from scenes.description.materials import Diffuse
from scenes.description.shapes import BilinearMesh, Emission, ShapeDescription, TriangleMesh
from tests.kit.exact_radiometry import _clip, cross, dot, norm, unit, vector

TRIANGLE = np.array([[-1.0, -0.4, 0.0], [1.3, -0.7, 0.0], [0.2, 0.9, 0.0]])
SQUARE = np.array([[-1.0, -0.5, 0.0], [1.0, -0.5, 0.0], [1.0, 0.5, 0.0], [-1.0, 0.5, 0.0]])
NORMALS = [
    unit(n) for n in ([0, 0, 1], [0.1, 0.3, 1], [1, 0.2, 0.1], [1, 0, 0], [1, 0.3, -0.3], [0.3, -1, 0])
]
PLACES = {
    "inside": (0.1, 0.1),
    "an edge": (0.15, -0.5),
    "beside": (2, 1),
    "far": (-30, -10),
    "a corner": (1, 0.5),
}
CASES = {
    f"{kind} over {name} at {h}": shape - [x, y, -h]
    for kind, shape in (("triangle", TRIANGLE), ("rectangle", SQUARE))
    for name, (x, y) in PLACES.items()
    for h in (1e-6, 1e-3, 0.1, 1.0, 10.0, 1e3, 1e6)
}
for kind, shape in (("triangle", TRIANGLE), ("rectangle", SQUARE)):
    for s in (0.1, 1e-3, 1e-6, 1e-8):
        CASES[f"{kind} {s} across"] = shape * s + [0.5, 0.7, 1]
        CASES[f"{kind} {s} across near the zenith"] = shape * s + [2 * s, 0.1 * s, 1]
        CASES[f"{kind} {s} across, edge-on"] = shape * s + [0.5, 0.7, 1e-3]
        CASES[f"{kind} {s} over the horizon"] = (shape - [0, s - 1, -1])[:, [0, 2, 1]]


def columns(corners, n: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    corners = np.asarray(corners, dtype=float)
    return corners[0][:, None], (corners[1:] - corners[0]).T[:, :, None], np.asarray(n, dtype=float)[:, None]


def irradiance(corners, n: np.ndarray) -> float:
    return float(projected_solid_angle(*columns(corners, n))[0])


def by_sectors(corners, n: np.ndarray) -> float:
    """What the samples are drawn by: sectors throughout, Lambert's sum nowhere."""
    return float(sample(np.full((2, 1), 0.5), *columns(corners, n))[2][0])


def exact(corners, n: np.ndarray) -> mp.mpf:
    """Lambert's sum after clipping, for the corners that the floats of corner and offsets stand for."""
    with mp.workdps(50):
        base, offsets, up = vector(corners[0]), [vector(c) for c in corners[1:] - corners[0]], vector(n)
        v = _clip([base, *([x + y for x, y in zip(base, o, strict=True)] for o in offsets)], up)
        total = mp.mpf(0)
        for a, b in zip(v, v[1:] + v[:1], strict=True):
            k = cross(a, b)
            if norm(k) > 0:
                total += mp.atan2(norm(k), dot(a, b)) * dot(up, k) / norm(k)
        return abs(total) / 2


@pytest.mark.parametrize("name", CASES)
def test_irradiance_keeps_its_digits(name):
    """To 1e-9 relative down to 1e-22, where Lambert's sum itself has nothing left below 1e-16.

    Above an edge or a corner at 1e-6, and where all is as thin as that, some 1e-16 of the size over the
    distance is lost.
    """
    worst = 0.0
    for n in NORMALS:
        truth = exact(CASES[name], n)
        for mine in (irradiance(CASES[name], n), by_sectors(CASES[name], n)):
            assert (mine == 0) == (truth == 0)
            worst = max(worst, float(abs(mine / truth - 1)) if truth else 0.0)
    assert worst < (3e-8 if name.endswith("at 1e-06") else 1e-9 if "0.001" in name else 1e-11)


def test_narrow_sectors_join_wide_ones():
    """Across NARROW both ways, in azimuth and in steepness: Gauss nodes and closed form agree with 50 digits
    to 1e-12.
    """
    for factor in (0.5, 0.99, 1.01, 2.0):
        for direction in ([1.0, 0, 0.3], [1.0, 0, 1e-4], [1.0, 0, 30.0], [0.1, 0.1, 1.0]):
            for across, up in ((1.0, 0.3), (0.05, 5.0), (1.0, 20.0)):
                width = NARROW * factor * np.hypot(direction[0], direction[1])
                shape = np.array([[0, 0, 0], [0.1, across, 0.1 * up], [-0.2, 0.6 * across, up]]) * width
                corners = shape + direction
                assert by_sectors(corners, [0, 0, 1]) == pytest.approx(
                    float(exact(corners, np.array([0, 0, 1.0]))), rel=1e-12
                )


def test_lambert_takes_over_from_the_sectors():
    """Across LAMBERT both ways, with the light small, edge-on, and low: 50 digits to 2e-12 on both sides."""
    for factor in (0.5, 0.999, 1.001, 2.0):
        e = LAMBERT * factor
        small = SQUARE * np.sqrt(e / 2) + [0.2, 0.1, 1]
        edge_on = SQUARE - [0, -3, -12 * e]
        low = (SQUARE * [1, 3 * np.sqrt(e), 1])[:, [0, 2, 1]] + [0, 1.0, 0]
        for corners, n in ((small, NORMALS[1]), (edge_on, NORMALS[1]), (low, NORMALS[0])):
            truth = float(exact(corners, n))
            assert 0.1 < truth / e < 10
            assert irradiance(corners, n) == pytest.approx(truth, rel=2e-12)
            assert by_sectors(corners, n) == pytest.approx(truth, rel=2e-12)


def test_the_zenith_walks_in_through_edges_and_corners():
    """Where triangles turn from two sectors to three: over an edge, through a corner, and on them exactly."""
    for toward in (SQUARE[2], (SQUARE[0] + SQUARE[1]) / 2, TRIANGLE[0]):
        for step in (-1e-2, -1e-8, -1e-15, 0.0, 1e-15, 1e-8, 1e-2):
            for shape in (SQUARE, TRIANGLE):
                corners = shape - toward * (1 + step) + [0, 0, 0.5]
                truth = exact(corners, np.array([0, 0, 1.0]))
                assert by_sectors(corners, [0, 0, 1]) == pytest.approx(float(truth), rel=1e-12)


def test_the_horizon_walks_over_corners():
    """Clipping sets in at each corner in turn, with one corner exactly on the horizon among the steps, and
    never jumps.

    A tip of 1e-9 is known to 1e-7 only, for that is what rounding leaves of its height.
    """
    standing = TRIANGLE[:, [0, 2, 1]] + [0.2, 1.0, 0.0]
    for corner in range(3):
        for step in (-1e-3, -1e-9, 0.0, 1e-9, 1e-3):
            corners = standing - [0, 0, standing[corner, 2] + step]
            truth = float(exact(corners, np.array([0, 0, 1.0])))
            assert by_sectors(corners, [0, 0, 1]) == pytest.approx(truth, rel=1e-12 if truth > 1e-9 else 1e-6)


def test_what_cannot_be_seen_gives_exactly_nothing():
    up = np.array([0.0, 0, 1])
    for corners in (
        SQUARE - [-3, 0, 0],
        SQUARE,
        SQUARE - SQUARE[0],
        SQUARE[:, [2, 0, 1]] + [1.0, 0, -0.5],
        SQUARE - [0, 0, 1],
    ):
        assert irradiance(corners, up) == 0.0


@pytest.mark.parametrize("kind", ["rectangle", "triangle"])
@pytest.mark.parametrize("two_sided", [False, True])
@pytest.mark.parametrize("reverse", [False, True])
def test_lights_shine_on_the_side_of_their_normal(kind, two_sided, reverse):
    """The irradiance of a light: radiance times projected solid angle on its own side, exactly 0 behind
    unless two-sided.
    """
    rgb = np.array([3.0, 2.0, 1.0])
    if kind == "rectangle":
        mesh = BilinearMesh(SQUARE[[0, 1, 3, 2]], np.array([[0, 1, 2, 3]]), reverse)
    else:
        mesh = TriangleMesh(TRIANGLE, np.array([[0, 1, 2]]), reverse)
    lights = LIGHTS[kind].make([ShapeDescription(mesh, Diffuse(np.zeros(3)), Emission(rgb, two_sided))], [4])
    assert lights.parts.source.tolist() == [4]
    p = np.array([[0.2, 0.1, 1.0], [0.2, 0.1, -1.0], [3.0, 0.1, 0.0]]).T
    n = normalize(np.array([[0.1, 0, -1.0], [0.1, 0, 1.0], [-1.0, 0, 0]]).T)
    e = lights.irradiance(np.zeros(3, dtype=np.int64), p, n)
    shape = SQUARE if kind == "rectangle" else TRIANGLE
    truth = [float(exact(shape - p[:, i], n[:, i])) for i in range(2)]
    lit = [two_sided or not reverse, two_sided or reverse]
    for i in range(2):
        np.testing.assert_allclose(e[:, i], rgb * truth[i] * lit[i], rtol=1e-13)
    assert (e[:, 2] == 0).all()


def test_a_light_that_carries_an_image_has_no_closed_form():
    mesh, black = BilinearMesh(SQUARE[[0, 1, 3, 2]], np.array([[0, 1, 2, 3]])), Diffuse(np.zeros(3))
    lights = LIGHTS["rectangle"].make(
        [ShapeDescription(mesh, black, Emission(np.ones(3), False, np.ones((2, 2, 3))))], [0]
    )
    assert lights.irradiance(np.zeros(1, dtype=np.int64), np.ones((3, 1)), np.ones((3, 1))) is None


_COORDINATE = st.floats(-3, 3, allow_nan=False, width=32)
_POINT = st.tuples(_COORDINATE, _COORDINATE, _COORDINATE)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(_POINT, _POINT, st.floats(0.05, 0.95), st.integers(-20, 20), _POINT)
def test_parts_add_up_however_it_is_turned(p, n, share, power, axis):
    """A rectangle is its two parts together; mirrored and scaled with the receiver it shines the same."""
    assume(np.linalg.norm(n) > 0.1 and abs(p[2]) > 1e-3 and np.linalg.norm(axis) > 0.1)
    n, corners = unit(n), SQUARE - p
    whole = irradiance(corners, n)
    low, high = (a + share * (b - a) for a, b in ((corners[0], corners[1]), (corners[3], corners[2])))
    parts = [
        irradiance(part, n)
        for part in ([corners[0], low, high, corners[3]], [low, corners[1], corners[2], high])
    ]
    assert sum(parts) == pytest.approx(whole, rel=1e-10, abs=1e-22)
    axis = unit(axis)
    mirrored, turned = (v - 2 * np.outer(v @ axis, axis) for v in (corners, n[None]))
    assert irradiance(mirrored, turned[0]) == pytest.approx(whole, rel=1e-8, abs=1e-22)
    assert irradiance(corners * 2.0**power, n) == pytest.approx(whole, rel=1e-13)
