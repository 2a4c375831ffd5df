"""Closed-form irradiance against 40 digits, against area integrals by cubature, and at the places where
formulas break.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import dblquad

from pipeline.references.closed_form.radiometry import (
    SMALL_POLYGON,
    clip_polygon_by_plane,
    disk_irradiance,
    knife_edge_irradiance,
    polygon_irradiance,
    sphere_irradiance,
)
from tests.kit import exact_radiometry as exact
from tests.kit.exact_radiometry import unit

pytestmark = pytest.mark.usefixtures("thorough")

SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])  # emits towards +z
DOWN, UP = np.array([0.0, 0, -1]), np.array([0.0, 0, 1])
TILTED = unit([0.1, 0.3, -1])

# Relative errors: what the docstring promises is a few roundings; 1e-13 is 500 of them and would have shown
# the
# 1e-10 that a plain Lambert sum loses at a size of 1e-6.
PROMISED = 1e-13
# Absolute error where edge terms cancel: slivers, and lights seen edge-on by tilted receivers.
CANCELLING = 1e-15

POLYGONS = {
    "near": ((0.3, 0.2, 1.0), TILTED, SQUARE, PROMISED),
    "1e-8 from the light": ((0.3, 0.2, 1e-8), TILTED, SQUARE, PROMISED),
    "1e-8 from the light, which is half above the horizon": ((0.3, 0.2, 1e-8), (1, 0, 0), SQUARE, PROMISED),
    "nearly a hemisphere": ((0.3, 0.2, 1e-3), DOWN, SQUARE * 1e6, PROMISED),
    "solid angle 4e-12": ((0.3, 0.2, 1.0), TILTED, SQUARE * 1e-6, PROMISED),
    "solid angle 1e-14, off the origin": ((0.3, 0.2, 1.0), TILTED, SQUARE * 1e-6 + (5, 3, 0), PROMISED),
    "1e6 away": ((3e5, 0.2, 1e6), TILTED, SQUARE, PROMISED),
    "just above the small branch": ((0.0, 0, 1), TILTED, SQUARE * 0.354 * SMALL_POLYGON * 1.01, PROMISED),
    "just below the small branch": ((0.0, 0, 1), TILTED, SQUARE * 0.354 * SMALL_POLYGON * 0.99, PROMISED),
    "across the horizon": ((0.3, 0.2, 1.0), unit((1, 0, -0.1)), SQUARE, PROMISED),
    "tiny, across the horizon": ((0.0, 0, 1), unit((1, 0, 1e-6)), SQUARE * 1e-5, PROMISED),
    "edge-on, 1e-8 before its plane": ((3, 0.2, 1e-8), (-1, 0, 0), SQUARE, PROMISED),
    "by a corner": ((1 + 1e-9, 1, 1e-9), unit((-1, 0, -0.3)), SQUARE, PROMISED),
    "edge-on and tilted": ((3, 0.2, 1e-8), unit((-1, 0, 0.3)), SQUARE, None),
    "a sliver above the horizon": ((0.0, 0, 1), unit((1, 0, 0.999999)), SQUARE, None),
}

DISKS = {
    "near": ((0.3, 0.2, 1.0), TILTED, 1.0, PROMISED),
    "on the axis": ((0.0, 0, 1), TILTED, 1.0, PROMISED),
    "almost on the axis": ((1e-17, 0, 1), TILTED, 1.0, PROMISED),
    "1e-8 from the light": ((0.3, 0.2, 1e-8), TILTED, 1.0, PROMISED),
    "solid angle 3e-14": ((0.3, 0.2, 1.0), TILTED, 1e-7, PROMISED),
    "nearly a hemisphere": ((0.3, 0.2, 1e-3), DOWN, 1e6, PROMISED),
    "edge-on, 1e-8 before its plane": ((3.0, 0.2, 1e-8), unit((-0.3, 0.3, -0.1)), 1.0, PROMISED),
    "1e-6 from the rim": ((1 + 1e-6, 0, 1e-6), unit((-0.3, 0.3, -0.1)), 1.0, 1e-9),
    "across the horizon": ((0.3, 0.2, 1.0), unit((1, 0.3, -0.1)), 1.0, PROMISED),
    "across the horizon, on the axis": ((0.0, 0, 1), unit((1, 0.3, -0.1)), 1.0, PROMISED),
    "1e-8 from the light, across the horizon": ((0.3, 0.2, 1e-8), unit((1, 0, 0.3)), 1.0, PROMISED),
    "just above the small branch": ((0.3, 0.2, 1.0), unit((1, 0, -0.29)), 0.06, 1e-12),
    "just below the small branch": ((0.3, 0.2, 1.0), unit((1, 0, -0.29)), 0.05, PROMISED),
    "tiny, across the horizon": ((0.3, 0.2, 1.0), unit((1, 0, -0.3)), 1e-6, 1e-9),
    "all but a sliver": ((0.3, 0.2, 0.5), unit((1, 0, -2.59)), 1.0, PROMISED),
    "a sliver above the horizon": ((0.3, 0.2, 0.5), unit((1, 0, 1.39)), 1.0, None),
}

SPHERES = {
    "near": ((0.3, 0.2, 2.0), TILTED, 1.0, PROMISED),
    "1e-8 from it": ((0.0, 0, 1 + 1e-8), TILTED, 1.0, PROMISED),
    "1e-8 from it, half above the horizon": ((0.0, 0, 1 + 1e-8), (1, 0, 0), 1.0, PROMISED),
    "solid angle 3e-14": ((0.3, 0.2, 1.0), TILTED, 1e-7, PROMISED),
    "across the horizon, centre above": ((0.3, 0.2, 2.0), unit((1, 0.3, -0.4)), 1.0, PROMISED),
    "across the horizon, centre below": ((0.3, 0.2, 2.0), unit((1, 0.3, 0.3)), 1.0, PROMISED),
    "tiny, centre on the horizon": ((0.0, 0, 1.0), (1, 0, 0), 1e-6, PROMISED),
}


def _compare(value: float, truth, relative: float | None) -> None:
    error = abs(value - float(truth)) if truth == 0 else float(abs(value - truth))
    print(f"{value:.6e}: relative error {error / float(truth):.1e}, absolute {error:.1e}")
    assert error <= (CANCELLING if relative is None else relative * float(truth))


@pytest.mark.parametrize("case", POLYGONS)
def test_polygon(case: str) -> None:
    p, n, corners, relative = POLYGONS[case]
    _compare(polygon_irradiance([p], n, corners)[0], exact.polygon(p, n, corners), relative)


@pytest.mark.parametrize("case", DISKS)
def test_disk(case: str) -> None:
    p, n, radius, relative = DISKS[case]
    value = disk_irradiance([p], n, (0.0, 0, 0), UP, radius)[0]
    _compare(value, exact.disk(p, n, (0.0, 0, 0), UP, radius), relative)


@pytest.mark.parametrize("case", SPHERES)
def test_sphere(case: str) -> None:
    p, n, radius, relative = SPHERES[case]
    _compare(
        sphere_irradiance([p], n, (0.0, 0, 0), radius)[0], exact.sphere(p, n, (0.0, 0, 0), radius), relative
    )


def _over_plane(p, n, x0, x1, y0, y1) -> float:
    """The area form of irradiance from a part of the plane z = 0, by cubature: no contour, no clipping."""

    def f(y: float, x: float) -> float:
        r = np.array([x, y, 0.0]) - p
        return max(0.0, float(r @ n)) * p[2] / float(r @ r) ** 2

    return dblquad(f, x0, x1, y0, y1, epsabs=1e-8, epsrel=1e-8)[0]


@pytest.mark.parametrize("n", [TILTED, unit((1, 0.3, -0.1))], ids=["above the horizon", "across it"])
def test_formulas_are_the_area_integral(n: np.ndarray) -> None:
    """A wrong formula cannot pass, as the cubature shares nothing with it; 1e-6 is the cubature's own doubt
    at the kink.
    """
    p = np.array([0.3, 0.2, 0.8])
    square = _over_plane(p, n, -1, 1, -1, 1)
    round_ = _over_plane(p, n, -1, 1, lambda x: -np.sqrt(1 - x * x), lambda x: np.sqrt(1 - x * x))
    assert polygon_irradiance([p], n, SQUARE)[0] == pytest.approx(square, rel=1e-6)
    assert disk_irradiance([p], n, (0.0, 0, 0), UP, 1.0)[0] == pytest.approx(round_, rel=1e-6)


def test_known_view_factors() -> None:
    """A disk seen along its axis: pi R^2 / (R^2 + h^2) facing it; a sphere: pi R^2 / d^2; a half-space:
    pi.
    """
    p = np.array([[0.0, 0, 0.5], [0, 0, 2], [0, 0, 30]])
    r2, h2 = 1.7**2, p[:, 2] ** 2
    np.testing.assert_allclose(
        disk_irradiance(p, DOWN, (0.0, 0, 0), UP, 1.7), np.pi * r2 / (r2 + h2), rtol=1e-15
    )
    np.testing.assert_allclose(
        sphere_irradiance(p, DOWN, (0.0, 0, -3), 1.7), np.pi * r2 / (p[:, 2] + 3) ** 2, rtol=1e-15
    )
    np.testing.assert_allclose(polygon_irradiance(p, DOWN, SQUARE * 1e12), np.pi, rtol=1e-10)


def test_lights_have_one_side() -> None:
    """Behind a light, in its plane, inside a sphere: exactly 0; a two-sided light shines on both."""
    p = [[0.1, 0.2, -0.5], [3.0, 0.2, 0.0], [0.0, 0, 0], [1, 0, 0], [0.1, 0.2, 0.5]]
    n = np.array([[0, 0, 1.0], [-1, 0, 0], [1, 0, 0], [0, 0, -1], [0, 0, -1]])
    for f, light in ((polygon_irradiance, (SQUARE,)), (disk_irradiance, ((0.0, 0, 0), UP, 1.0))):
        one, both = f(p, n, *light), f(p, n, *light, two_sided=True)
        assert one[:4].tolist() == [0, 0, 0, 0] and one[4] > 1
        assert (
            both[0] == pytest.approx(one[4], rel=1e-15)
            and both[1:4].tolist() == [0, 0, 0]
            and both[4] == one[4]
        )
    assert sphere_irradiance([[0.0, 0, 0], [0.5, 0, 0], [1, 0, 0]], UP, (0.0, 0, 0), 1.0).tolist() == [
        0,
        0,
        0,
    ]


def test_lights_below_the_horizon_are_black() -> None:
    p = [[0.0, 0, 2.0]]
    assert polygon_irradiance(p, UP, SQUARE)[0] == 0
    assert disk_irradiance(p, UP, (0.0, 0, 0), UP, 1.0)[0] == 0
    assert sphere_irradiance(p, UP, (0.0, 0, 0), 1.0)[0] == 0
    assert polygon_irradiance([[2.0, 0, 0.0]], UP, SQUARE[::-1])[0] == 0  # touches the horizon from below


def test_rows_are_independent_and_radiance_multiplies() -> None:
    rng = np.random.default_rng(5)
    p, n = rng.normal(size=(40, 3)) * 3, rng.normal(size=(40, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    lights = rng.normal(size=(40, 1, 3)) + SQUARE
    for whole, row in (
        (polygon_irradiance(p, n, lights), lambda i: polygon_irradiance(p[i : i + 1], n[i], lights[i])),
        (
            disk_irradiance(p, n, p[::-1], n[::-1], 0.7),
            lambda i: disk_irradiance(p[i], n[i], p[39 - i], n[39 - i], 0.7),
        ),
        (sphere_irradiance(p, n, p[::-1], 0.7), lambda i: sphere_irradiance(p[i], n[i], p[39 - i], 0.7)),
    ):
        assert np.count_nonzero(whole) > 5
        assert whole.tolist() == [row(i)[0] for i in range(40)]
    rgb = polygon_irradiance(p, n, SQUARE, (1.0, 2, 3))
    assert rgb.shape == (40, 3)
    np.testing.assert_array_equal(rgb, np.outer(polygon_irradiance(p, n, SQUARE), (1, 2, 3)))
    empty = np.zeros((0, 3))
    assert polygon_irradiance(empty, empty, SQUARE, (1.0, 2, 3)).shape == (0, 3)
    assert (
        disk_irradiance(empty, empty, (0.0, 0, 0), UP, 1.0).shape
        == sphere_irradiance(empty, empty, (0.0, 0, 0), 1.0).shape
    )


_COORDINATE = st.floats(-3, 3, allow_nan=False, width=32)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(*[st.tuples(_COORDINATE, _COORDINATE, _COORDINATE) for _ in range(3)], st.floats(-1.5, 1.5))
def test_parts_add_up(p, n, m, offset) -> None:
    """A square cut in two by any plane (but its own) shines as its halves together; the error is that of
    three Lambert sums.
    """
    assume(np.linalg.norm(n) > 1e-3 and np.hypot(m[0], m[1]) > 1e-3 * max(1.0, abs(m[2])))
    # A point within rounding of the light's plane may fall on either side of it for each part.
    assume(abs(p[2]) > 1e-6)
    n, m = unit(n), unit(m)
    parts = [_kept(*clip_polygon_by_plane(SQUARE[None], s * m, s * offset)) for s in (1, -1)]
    total = sum(polygon_irradiance([p], n, part)[0] for part in parts if len(part) > 2)
    whole = polygon_irradiance([p], n, SQUARE)[0]
    # Rounding moves the corners that the cut makes by 1e-16, an angle that grows with nearness.
    assert total == pytest.approx(whole, rel=1e-12, abs=4 * CANCELLING / min(1.0, abs(p[2])))


def _kept(vertices: np.ndarray, count: np.ndarray) -> np.ndarray:
    return vertices[0, : count[0]]


def test_clipping() -> None:
    square, count = clip_polygon_by_plane(SQUARE[None].repeat(4, axis=0), (1.0, 0, 0), (-2.0, 0.5, 1.0, 2.0))
    assert count.tolist() == [4, 4, 0, 0]  # whole, cut, touching (empty), beyond
    assert square.shape == (4, 5, 3)
    assert square[0].tolist() == [*SQUARE.tolist(), SQUARE[3].tolist()]
    np.testing.assert_array_equal(np.sort(np.unique(square[1, :, 0])), [0.5, 1.0])
    corner, count = clip_polygon_by_plane(SQUARE[None], unit((-1.0, -1, 0)), -1.2)
    assert count.tolist() == [5]
    edges = np.roll(corner[0], -1, axis=0) - corner[0]
    assert np.all(np.cross(edges, np.roll(edges, -1, axis=0))[:, 2] > 0)  # order and orientation are kept
    assert np.sum(np.cross(corner[0], edges)[:, 2]) / 2 == pytest.approx(4 - (2**0.5 - 1.2) ** 2, rel=1e-14)


# A light 2 x 2 at height 2 facing down; the half-plane x < 0 at height 1 blocks. A receiver at (x, 0, 0) sees
# the
# light up to the line through the edge: light points with x' > -x. Umbra at x <= -1, full light at x >= 1.
CEILING = SQUARE[::-1] + np.array([0.0, 0, 2])
EDGE = np.array([[0.0, -1, 1], [0, 1, 1]])


def _knife_edge(x, n=UP):
    p = np.stack((x, np.zeros_like(x), np.zeros_like(x)), axis=1)
    return knife_edge_irradiance(p, n, CEILING, EDGE, (-1.0, 0, 0))


def test_knife_edge_profile() -> None:
    """Against the rectangle that is left, cut by hand, at exact points through the penumbra."""
    x = np.linspace(-0.999, 1.2, 45)
    for xi, e in zip(x, _knife_edge(x), strict=True):
        left = max(-xi, -1.0)
        rest = np.array([[left, 1, 2], [1, 1, 2], [1, -1, 2], [left, -1, 2]])
        assert e == pytest.approx(float(exact.polygon((xi, 0, 0), UP, rest)), rel=1e-12, abs=CANCELLING)


def test_knife_edge_agrees_with_shadow_rays() -> None:
    """Tilted receivers, an oblique edge: against a grid of light points, each tested by its own ray."""
    edge, into, k = np.array([[0.1, -1, 1], [-0.2, 1, 1.2]]), np.array([-1.0, 0.1, 0.1]), 600
    points = np.array([[0.2, 0.3, 0], [-0.4, 0, 0.1], [0.0, 1, 0]])
    normals = np.array([UP, unit((1, 0, 0.2)), unit((-0.5, 0.2, 1))])
    g = (np.arange(k) + 0.5) / k * 2 - 1
    light = np.stack((*np.meshgrid(g, g), np.full((k, k), 2.0)), axis=-1).reshape(-1, 3)
    for p, n, e in zip(
        points, normals, knife_edge_irradiance(points, normals, CEILING, edge, into), strict=True
    ):
        d = light - p
        w = np.cross(edge[1] - edge[0], into)
        hit = p + d * ((w @ (edge[0] - p)) / (d @ w))[:, None]
        along = edge[1] - edge[0]
        side = np.cross(along, hit - edge[0]) @ np.cross(along, into)
        f = np.where(side < 0, np.maximum(d @ n, 0) * d[:, 2] / (d**2).sum(axis=1) ** 2, 0)
        # Cells that the shadow line crosses are right or wrong as a whole, at most 2 k of k^2 of them.
        assert e == pytest.approx(f.sum() * 4 / k**2, abs=2 * 2 / k * f.max())
        assert 0.01 < e < polygon_irradiance([p], n, CEILING)[0] * 0.99


def test_knife_edge_ends() -> None:
    umbra = _knife_edge(np.array([-1.0, -1.0000001, -2.0, -50.0]))
    assert umbra.tolist() == [0, 0, 0, 0]  # the umbra's edge itself included
    assert _knife_edge(np.array([-0.9999999]))[0] > 0
    lit = np.array([1.0, 1.5, 40.0])
    p = np.stack((lit, 0 * lit, 0 * lit), axis=1)
    np.testing.assert_allclose(_knife_edge(lit), polygon_irradiance(p, UP, CEILING), rtol=1e-14)
    above = [[-0.5, 0.0, 1.5]]  # between the half-plane and the light
    np.testing.assert_array_equal(
        knife_edge_irradiance(above, UP, CEILING, EDGE, (-1.0, 0, 0)), polygon_irradiance(above, UP, CEILING)
    )
    with pytest.raises(ValueError, match="crosses the plane"):
        knife_edge_irradiance(above, UP, CEILING, EDGE, (0.0, 0, 1))
