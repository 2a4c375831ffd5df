"""Samples of the projected solid angle: sectors against quadrature in 30 digits, the way back, and what is
left at the ends.
"""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from renderer.math.vectors import dot
from renderer.spherical.projected import invert, projected_solid_angle, sample
from renderer.spherical.sectors import NARROW, Sectors
from tests.kit.exact_radiometry import unit
from tests.renderer.spherical.test_polygon_irradiance import CASES, NORMALS, SQUARE, TRIANGLE, columns

pytestmark = pytest.mark.usefixtures("thorough")

U = np.random.default_rng(6).random((2, 40)) * 0.998 + 0.001

# (start, outer slope, excess, width): level, climbing, falling to the horizon, thin, by the zenith, steep,
# low
SECTORS = [
    (0.5, 0.2, 0.4, 1.0),
    (0.5, -0.3, 0.9, 1.2),
    (0.0, 0.0, 2.0, 0.7),
    (0.3, -0.3, 1e-9, np.pi / 4),
    (1e3, -50.0, 1e4, 0.5),
    (0.2, 0.1, 3e4, 1e-4),
    (1e-6, 1e-7, 1e-6, 1.0),
    (1.0, 0.3, 0.2, NARROW * 0.999),
    (1.0, 0.3, 0.2, NARROW * 1.001),
    (2.0, 1.0, 1e-8, 1e-6),
]
# A sector to the zenith may be nearly half a turn; one beside it would dip below the horizon.
EITHER = [(case, False) for case in SECTORS] + [
    (case, True) for case in (*SECTORS, (0.0, 0.3, 0.0, 3.0), (1e-3, 5.0, 0.0, 3.1))
]


def sector(
    start: float, outer: float, excess: float, width: float, n: int, to_zenith: bool = False
) -> Sectors:
    steep = max(abs(outer), abs(outer + excess)) / np.sqrt(1 + start * start)
    narrow = width < NARROW and width * steep < NARROW
    numbers = (1.0, 0.0, 1.0, width, start, outer, 0.0 if to_zenith else excess)
    return Sectors(
        *(np.full(n, v) for v in numbers), np.full(n, to_zenith), np.full(n, narrow and not to_zenith)
    )


def exact(start: float, outer: float, excess: float, t: float, to_zenith: bool = False) -> mp.mpf:
    """The area up to t as the integral that it is."""
    a, so, d = (mp.mpf(float(v)) for v in (start, outer, excess))

    def height(x):
        zo = a * mp.cos(x) + so * mp.sin(x)
        inner = 0 if to_zenith else 1 / (1 + (zo + d * mp.sin(x)) ** 2)
        return (1 / (1 + zo * zo) - inner) / 2

    with mp.workdps(30):
        t = mp.mpf(float(t))
        cuts = sorted(
            {
                t,
                *(t * mp.mpf(10) ** -k for k in range(1, 7)),
                mp.mpf(0),
                *(t - t * mp.mpf(10) ** -k for k in range(1, 3)),
            }
        )
        return mp.quad(height, cuts)


@pytest.mark.parametrize(("case", "to_zenith"), EITHER)
def test_areas_of_sectors_are_their_integral_and_are_cut_where_they_should(case, to_zenith):
    """Area to 1e-12 relative, however thin the sector, and the angle that cuts a share of it to 1e-9 of the
    whole.
    """
    shares = np.array([0.0, 1e-9, 1e-3, 0.3, 0.9, 1 - 1e-9, 1.0])
    s = sector(*case, shares.size, to_zenith)
    whole = exact(*case, to_zenith)
    area = s.area(s.width)
    assert abs(area[0] / whole - 1) < 1e-12
    t = s.solve(shares * area)
    assert (t[0], t[-1]) == (0.0, case[3])
    for share, angle in zip(shares[1:-1], t[1:-1], strict=True):
        assert abs(exact(*case[:3], angle, to_zenith) / whole - share) < 1e-9


def test_within_a_sector_the_squared_distance_from_the_axis_is_uniform():
    s = sector(0.5, -0.3, 0.9, 1.2, 5)
    t, u = np.full(5, 0.8), np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    wi = s.direction(t, u)
    square = wi[0] ** 2 + wi[1] ** 2
    np.testing.assert_allclose(np.diff(square), np.diff(square).mean(), rtol=1e-13)
    zo = 0.5 * np.cos(0.8) - 0.3 * np.sin(0.8)
    tangent = wi[2] / np.sqrt(square)
    np.testing.assert_allclose([tangent[-1], tangent[0]], [zo, zo + 0.9 * np.sin(0.8)], rtol=1e-13)


@pytest.mark.parametrize("name", CASES)
def test_the_way_back_leads_to_u(name):
    """|invert(sample(u)) - u| < 1e-6 where the polygon is thicker than 1e-9; below that float64 cannot hold
    the direction.

    The cosine is that of the direction, directions are units within the polygon, and E is the irradiance.
    """
    corner, others, _ = columns(CASES[name], NORMALS[0])
    corner = np.repeat(corner, U.shape[1], axis=1)
    for n in NORMALS:
        ref_n = np.repeat(n[:, None], U.shape[1], axis=1)
        wi, cosine, e = sample(U, corner, others, ref_n)
        np.testing.assert_allclose(e, projected_solid_angle(corner, others, ref_n), rtol=1e-9)
        if e[0] == 0:
            assert np.isnan(wi).all() and (cosine == 0).all()
            continue
        np.testing.assert_allclose(dot(wi, wi), 1.0, rtol=1e-14)
        np.testing.assert_allclose(dot(wi, ref_n), cosine, rtol=1e-12, atol=1e-15)
        area = np.cross(others[:, 0, 0], others[:, 1, 0])
        facing = np.abs(corner[:, 0] @ area) / np.linalg.norm(area) / np.linalg.norm(corner[:, 0])
        size = np.linalg.norm(others[:, :, 0], axis=0).max() / np.linalg.norm(corner[:, 0])
        if min(size, 1.0) * facing > 1e-9 and e[0] > 1e-16:
            assert np.abs(invert(wi, corner, others, ref_n) - U).max() < 1e-6 * max(1.0, 1e-10 / e[0])


@pytest.mark.parametrize("shape", [SQUARE, TRIANGLE])
def test_the_ends_of_the_unit_square_are_in_the_polygon(shape):
    """u of 0, of the last float below 1, and next to them: finite, above the horizon, and of the polygon but
    for the rounding of angles.
    """
    ends = np.array([0.0, 5e-324, 1e-300, 1e-16, 0.5, 1 - 1e-16, 1 - 2**-53])
    u = np.stack([g.ravel() for g in np.meshgrid(ends, ends)])
    for n in NORMALS:
        for p in ([0.1, 0.1, -0.7], [3.0, 1.0, -0.2], [0.1, 0.1, -1e-6], [0.0, 0.0, 1e-3]):
            corner, others, ref_n = columns(shape - p, n)
            corner, ref_n = np.repeat(corner, u.shape[1], axis=1), np.repeat(ref_n, u.shape[1], axis=1)
            wi, cosine, e = sample(u, corner, others, ref_n)
            if e[0] == 0:
                continue
            assert np.isfinite(wi).all() and (cosine >= 0).all()
            for a, b in zip(shape - p, np.roll(shape, -1, axis=0) - p, strict=True):
                plane = np.cross(a, b) / np.linalg.norm(np.cross(a, b)) * np.sign(p[2])
                # Beside each edge's great circle by an angle, which near the light's plane is a long way on
                # the light.
                assert (plane @ wi).max() < max(1e-13, 1e-16 / abs(p[2]))


def test_rows_stand_alone():
    """Bits of a row do not depend on its neighbours: searches stop by their own row, sectors are compacted
    and spread again.
    """
    rng = np.random.default_rng(9)
    p, n = rng.normal(size=(3, 61)) * [[2.0], [2.0], [0.5]], rng.normal(size=(3, 61))
    n /= np.sqrt(dot(n, n))
    corner, others, u = SQUARE[0][:, None] - p, (SQUARE[1:] - SQUARE[0]).T[:, :, None], rng.random((2, 61))
    wi, cosine, e = sample(u, corner, others, n)
    assert 10 < np.count_nonzero(e) < 61
    for i in range(61):
        one = sample(u[:, i : i + 1], corner[:, i : i + 1], others, n[:, i : i + 1])
        assert np.array_equal(one[0][:, 0], wi[:, i], equal_nan=True)
        assert (one[1][0], one[2][0]) == (cosine[i], e[i])


_COORDINATE = st.floats(-3, 3, allow_nan=False, width=32)
_POINT = st.tuples(_COORDINATE, _COORDINATE, _COORDINATE)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(_POINT, _POINT, st.sampled_from([SQUARE, TRIANGLE]))
def test_the_pdf_integrates_to_one_and_the_way_back_leads_to_u(p, n, shape):
    """By a grid over the polygon: cos / E there sums to 1 within what the horizon's kink leaves, for any
    receiver.
    """
    assume(np.linalg.norm(n) > 0.1 and abs(p[2]) > 0.05)
    corner, others, ref_n = columns(shape - p, unit(n))
    e = projected_solid_angle(corner, others, ref_n)[0]
    k = 120
    g = (np.arange(k) + 0.5) / k
    a, b = (v.ravel() for v in np.meshgrid(g, g))
    if len(shape) == 3:
        a, b, weight = a, b * (1 - a), 1 - a
    else:
        weight = np.ones_like(a)
    r = corner + others[:, 0] * a + others[:, -1] * b
    area = np.linalg.norm(np.cross(others[:, 0, 0], others[:, -1, 0]))
    integrand = np.maximum(dot(r, ref_n), 0) * abs(p[2]) / dot(r, r) ** 2 * weight
    assert (integrand * area / k**2).sum() == pytest.approx(e, abs=4 * area * integrand.max() / k)
    if e > 1e-9:
        c, rn = np.repeat(corner, 40, axis=1), np.repeat(ref_n, 40, axis=1)
        assert np.abs(invert(sample(U, c, others, rn)[0], c, others, rn) - U).max() < 1e-7
