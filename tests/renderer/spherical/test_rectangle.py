"""The spherical rectangle against 50-digit arithmetic, across the thresholds of its branches in both
directions.
"""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

from renderer.spherical.rectangle import GRAZING, SMALL, invert, solid_angle

mp.mp.dps = 50


def exact(x0, x1, y0, y1, z) -> mp.mpf:
    """The solid angle by its four corners: sum of +-atan(x y / (z r)), all its cancellation paid for in
    digits.
    """

    def corner(x, y):
        x, y, h = mp.mpf(float(x)), mp.mpf(float(y)), abs(mp.mpf(float(z)))
        return mp.atan2(x * y, h * mp.sqrt(x * x + y * y + h * h))

    return corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)


SIDES = [
    (1.0, 3.0, -1.0, 1.0),
    (-1.0, 1.0, -1.0, 1.0),
    (0.1, 2.0, 0.2, 1.0),
    (-2.0, -0.5, -3.0, -1.0),
    (-1.0, 1e-3, 0.5, 9.0),
]
HEIGHTS = [10.0, 1.0, 0.1, 1e-2, 1e-3, 3e-4, 1e-4, 1e-6, 1e-9]
TINY = [(0.3, 0.3 + s, 0.2, 0.2 + s) for s in (1e-2, 1e-4, 1e-6)] + [(3.0, 3.0 + 1e-5, -1e-5, 1e-5)]
CASES = [(*sides, z) for sides in SIDES for z in HEIGHTS] + [
    (*sides, z) for sides in TINY for z in (1.0, 1e-3, -1e-3)
]


@pytest.mark.parametrize("case", CASES)
def test_solid_angles_keep_their_digits(case):
    """A hemisphere to 1e-14 sr, edge-on included, to 1e-13 relative: the published form would lose every
    digit.

    Over the middle of a rectangle the diagonal between its two triangles passes underfoot: 1e-15 of the size
    over z.
    """
    mine = solid_angle(*(np.array([v]) for v in case))[0]
    x0, x1, y0, y1, z = case
    tolerance = 1e-15 / z if x0 < 0 < x1 and y0 < 0 < y1 else 0.0
    assert abs(mp.mpf(float(mine)) / exact(*case) - 1) < max(tolerance, 1e-13)


@pytest.mark.parametrize("case", CASES)
def test_samples_split_off_the_solid_angle_that_they_should(case):
    """x leaves u of the solid angle on its left, and y splits the strip there in v : 1 - v, to 1e-6 of the
    whole.
    """
    rng = np.random.default_rng(3)
    n = 40
    u = np.concatenate(
        [rng.random((2, n - 4)), [[0.0, 1 - 2**-53, 1e-9, 0.5], [0.5, 0.5, 1e-9, 1 - 2**-53]]], axis=1
    )
    x0, x1, y0, y1, z = (np.full(n, v) for v in case)
    omega = solid_angle(x0, x1, y0, y1, z)
    x, y = invert(u, omega, x0, x1, y0, y1, z)
    whole = exact(*case)
    assert ((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)).all()
    for i in range(n):
        assert abs(exact(case[0], x[i], case[2], case[3], case[4]) / whole - u[0, i]) < 1e-6
        assert abs(_strip(x[i], case, y[i]) - u[1, i]) < 1e-6


def _strip(x: float, case, y: float) -> mp.mpf:
    """The share of the strip at x below y: solid angle grows there as y / sqrt(x^2 + y^2 + z^2)."""

    def height(v):
        return mp.mpf(float(v)) / mp.sqrt(
            mp.mpf(float(x)) ** 2 + mp.mpf(float(v)) ** 2 + mp.mpf(float(case[4])) ** 2
        )

    return (height(y) - height(case[2])) / (height(case[3]) - height(case[2]))


def test_the_branches_meet():
    """Sampled x just this side and just that side of each threshold: both within 1e-7 of the solid angle
    asked for.
    """
    for factor in (0.99, 1.01):
        z = 2.0 / (GRAZING * factor)
        side = np.sqrt(SMALL * factor)
        for case in ((1.0, 2.0, -1.0, 1.0, z), (0.1, 0.1 + side, 0.1, 0.1 + side, 1.0)):
            u = np.stack([np.linspace(0.01, 0.99, 50), np.full(50, 0.5)])
            rows = [np.full(50, v) for v in case]
            omega = solid_angle(*rows)
            x, _ = invert(u, omega, *rows)
            left = solid_angle(rows[0], x, *rows[2:])
            assert np.abs(left / omega - u[0]).max() < 1e-7


def test_nothing_is_seen_edge_on():
    zero = np.zeros(1)
    assert solid_angle(zero + 1, zero + 2, zero - 1, zero + 1, zero)[0] == 0.0
