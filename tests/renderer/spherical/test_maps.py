"""The two maps of the sphere: where a point of the image is, there and back, and how much solid angle it
has.
"""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from renderer.math.piecewise import BELOW_ONE, Place
from renderer.spherical.grid import SphereGrid
from renderer.spherical.latlong import sphere_to_square as polar_square
from renderer.spherical.octahedral import sphere_to_square, square_to_sphere, wrapped_texels

R = np.sqrt(0.5)
# By hand from pbrt's EqualAreaSquareToSphere: u = 2x - 1, v = 2y - 1, r = 1 - |1 - |u| - |v||, z = +-(1 -
# r^2),
# phi = ((|v| - |u|)/r + 1) pi/4, the signs of u and v on cos and sin; k = r sqrt(2 - r^2).
K = 0.5 * np.sqrt(1.75)
BY_HAND = [
    ((0.5, 0.5), (0, 0, 1)),
    ((0, 0), (0, 0, -1)),
    ((1, 0.5), (1, 0, 0)),
    ((0.5, 1), (0, 1, 0)),
    ((0.5, 0), (0, -1, 0)),
    ((0, 0.5), (-1, 0, 0)),
    ((0.25, 0.25), (-R, -R, 0)),  # u = v = -1/2: r = 1, phi = 45 degrees
    ((0.625, 0.375), (K * R, -K * R, 0.75)),  # u = 1/4, v = -1/4: r = 1/2
    ((0.875, 0.125), (K * R, -K * R, -0.75)),  # u = 3/4, v = -3/4: r = 1/2, below
    (
        (0.625, 0.125),
        (np.cos(np.pi * 3 / 8), -np.sin(np.pi * 3 / 8), 0),
    ),  # u = 1/4, v = -3/4: r = 1, phi = 67.5 degrees
    ((0.5, 0.75), (0, K, 0.75)),  # u = 0, v = 1/2: phi = 90 degrees
]
UNIT = st.floats(0, 1)
DIRECTION = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda w: np.hypot(w[0], np.hypot(w[1], w[2])) > 1e-3)


def unit(w) -> np.ndarray:
    v = np.array(w, dtype=np.float64)[:, None]
    return v / np.sqrt((v * v).sum())


def grid(height: int, width: int, latlong: bool) -> SphereGrid:
    size = (np.array([n], dtype=np.int64) for n in (height, width, 0))
    h, w, first = size
    return SphereGrid(h, w, np.array([latlong]), first)


@pytest.mark.parametrize(("square", "direction"), BY_HAND)
def test_octahedral_points_by_hand(square, direction):
    np.testing.assert_allclose(
        square_to_sphere(np.array(square, dtype=float)[:, None])[:, 0], direction, atol=2e-16
    )


@pytest.mark.parametrize(
    ("place", "texel"),
    [
        ((1, 2), (1, 2)),
        ((-1, 2), (1, 1)),
        ((4, 1), (3, 2)),
        ((1, -1), (2, 1)),
        ((1, 4), (2, 3)),
        ((4, 4), (0, 1)),
        ((-1, -1), (2, 3)),
        ((4, -1), (0, 3)),
    ],
)
def test_texels_beyond_an_edge_by_hand(place, texel):
    """(column, row) of 4 by 4, by pbrt's RemapPixelCoords: one too far in beyond column 0 and row 0."""
    column, row = (np.array([x]) for x in place)
    assert tuple(int(x[0]) for x in wrapped_texels(column, row, 4)) == texel


@given(UNIT, UNIT)
def test_octahedral_against_fifty_digits(a, b):
    """pbrt's formulas in mpmath, to 1e-15, poles and equator included."""
    with mpmath.workdps(50):
        u, v = 2 * mpmath.mpf(a) - 1, 2 * mpmath.mpf(b) - 1
        off = 1 - (abs(u) + abs(v))
        r = 1 - abs(off)
        phi = ((abs(v) - abs(u)) / r + 1 if r != 0 else 1) * mpmath.pi / 4
        k = r * mpmath.sqrt(2 - r * r)
        z = (1 - r * r) * (-1 if off < 0 else 1)
        exact = [mpmath.cos(phi) * k * (-1 if u < 0 else 1), mpmath.sin(phi) * k * (-1 if v < 0 else 1), z]
        np.testing.assert_allclose(
            square_to_sphere(np.array([[a], [b]]))[:, 0], [float(e) for e in exact], rtol=0, atol=1e-15
        )


@given(DIRECTION)
def test_a_direction_comes_back_from_the_square(w):
    """To 2e-15, 1e-9 off a pole as anywhere: pbrt's sqrt(1 - |z|) would give 1e-8 there."""
    for direction in (unit(w), unit((w[0] * 1e-9, w[1] * 1e-9, w[2] + np.copysign(1, w[2])))):
        again = square_to_sphere(sphere_to_square(direction))
        np.testing.assert_allclose(again, direction, rtol=0, atol=2e-15)


def test_near_the_upper_pole_relative_digits_survive():
    """In the middle of the square r is as small as one likes; 1e-12 of an angle of 1e-12 is kept but for the
    rounding of 1/2 + r.
    """
    angle = 2.0 ** -np.arange(2, 20)
    w = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)])
    r = 2 * (sphere_to_square(w)[0] - 0.5)
    np.testing.assert_allclose(r, np.sqrt(2) * np.sin(angle / 2), rtol=1e-10)


@given(UNIT, UNIT)
def test_the_square_comes_back_from_the_direction(a, b):
    """But for the lower pole and the seams, which are the square's border: there, the direction does."""
    u = np.array([[a], [b]])
    again = sphere_to_square(square_to_sphere(u))
    assert (again >= 0).all() and (again <= 1).all()
    np.testing.assert_allclose(square_to_sphere(again), square_to_sphere(u), atol=3e-15)
    if 1e-6 < a < 1 - 1e-6 and 1e-6 < b < 1 - 1e-6:
        # The square's own error is that of the direction over the sine of the angle at worst.
        np.testing.assert_allclose(again, u, rtol=0, atol=1e-12)


def test_octahedral_areas_are_equal():
    """The Jacobian by central differences is 4 pi to 1e-6, at some 1,000 points off creases and poles: an
    unequal area is caught anywhere.
    """
    u = np.random.default_rng(1).random((2, 1000))
    a, b = np.abs(2 * u - 1)
    off_poles = (a + b > 0.05) & (a + b < 1.95)
    u = u[:, (np.minimum(a, b) > 1e-3) & (np.abs(a + b - 1) > 1e-3) & off_poles]
    h = 1e-5
    ex, ey = np.array([[h], [0]]), np.array([[0], [h]])
    dx = (square_to_sphere(u + ex) - square_to_sphere(u - ex)) / (2 * h)
    dy = (square_to_sphere(u + ey) - square_to_sphere(u - ey)) / (2 * h)
    area = np.sqrt((np.cross(dx, dy, axis=0) ** 2).sum(axis=0))
    np.testing.assert_allclose(area, 4 * np.pi, rtol=1e-6)


@pytest.mark.parametrize(
    ("direction", "square"),
    [
        ((1, 0, 0), (0, 0.5)),
        ((0, 1, 0), (0.25, 0.5)),
        ((-1, 0, 0), (0.5, 0.5)),
        ((0, -1, 0), (0.75, 0.5)),
        ((0, R, R), (0.25, 0.25)),
        ((0, -R, -R), (0.75, 0.75)),
    ],
)
def test_latitude_longitude_by_hand(direction, square):
    np.testing.assert_allclose(polar_square(unit(direction))[:, 0], square, atol=1e-16)


@pytest.mark.parametrize("latlong", [False, True])
@given(
    st.integers(0, 62),
    st.integers(0, 62),
    *[st.sampled_from([0.0, 0.5, BELOW_ONE]) | st.floats(1e-6, 1 - 1e-6)] * 2,
)
def test_a_place_comes_back_from_its_direction(latlong, row, column, x, y):
    """To 1e-11 of a texel of a 63x63 image; at an edge the direction may be given to the neighbour, and must
    then be the same.
    """
    g = grid(63, 63, latlong)
    at = np.zeros(1, dtype=np.int64)
    place = Place(np.array([row]), np.array([column]), np.array([x]), np.array([y]))
    w = g.direction(at, place)
    assert abs((w * w).sum() - 1) < 1e-14
    again = g.place(at, w)
    np.testing.assert_allclose(g.direction(at, again), w, rtol=0, atol=1e-12)
    assert g.texel(at, again) == g.texel_at(at, w)
    if 1e-6 < x < 1 - 1e-6 and 1e-6 < y < 1 - 1e-6:
        assert (again.row[0], again.column[0]) == (row, column)
        np.testing.assert_allclose([again.x[0], again.y[0]], [x, y], rtol=0, atol=1e-10)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (4, 7), (1024, 2)])
def test_latitude_longitude_texels_have_their_solid_angles(height, width):
    """Against cos a - cos b to fifty digits, to 1e-14 relative: the polar rows of 1,024 too, where the
    difference cancels.
    """
    with mpmath.workdps(50):
        edge = [mpmath.cos(mpmath.pi * i / height) for i in range(height + 1)]
        exact = [float(2 * mpmath.pi / width * (edge[i] - edge[i + 1])) for i in range(height)]
    omega = grid(height, width, True).solid_angle(0)
    np.testing.assert_allclose(omega[:, 0], exact, rtol=1e-14)
    assert omega.sum() * width == pytest.approx(4 * np.pi, rel=1e-13)


@pytest.mark.parametrize(("size", "latlong"), [((6, 6), False), ((6, 4), True), ((2, 2), False)])
def test_the_part_above_the_horizon_is_what_samples_say(size, latlong):
    """4.5 standard errors of 4,000 uniform places a texel: a texel counted whole that is cut in half is 60
    off.
    """
    g = grid(*size, latlong)
    count = 4000
    row, column = (a.reshape(-1).repeat(count) for a in np.mgrid[: size[0], : size[1]])
    x, y = np.random.default_rng(2).random((2, row.size))
    z = g.direction(np.zeros(row.size, dtype=np.int64), Place(row, column, x, y))[2]
    part = (z > 0).reshape(*size, count).mean(axis=2)
    assert np.abs(part - g.above(0)).max() < 4.5 * np.sqrt(0.25 / count)


def test_no_direction_falls_outside_and_nothing_warns():
    """Axes, diagonals, signed zeros, lengths off by rounding, NaN."""
    axis = np.array([0.0, -0.0, 1.0, -1.0, R, -R, 1 + 4e-16, -1 - 4e-16, 1e-20, -1e-20, np.nan])
    w = np.stack([a.reshape(-1) for a in np.meshgrid(axis, axis, axis)])
    at = np.zeros(w.shape[1], dtype=np.int64)
    for latlong in (False, True):
        texel = grid(5, 5, latlong).texel_at(at, w)
        assert texel.min() >= 0 and texel.max() < 25
