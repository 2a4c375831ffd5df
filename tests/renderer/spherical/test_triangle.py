"""The spherical triangle against 50-digit arithmetic, from 1e-14 sr to a hemisphere, and across each of its
branches.
"""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from renderer.math.vectors import dot
from renderer.spherical import triangle
from renderer.spherical.triangle import invert, sample, solid_angle
from tests.kit.exact_radiometry import cross as mcross
from tests.kit.exact_radiometry import dot as mdot
from tests.kit.exact_radiometry import norm, vector

mp.mp.dps = 50
T = np.array([[-1.0, -0.4, 0.0], [1.3, -0.7, 0.0], [0.2, 0.9, 0.0]])
OBTUSE = np.array([[-1.0, -0.4, 0.0], [1.3, -0.7, 0.0], [0.1, -0.4, 0.0]])
SLIVER = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-6, 0.0]])
PLACES = {
    "over the inside": (0.1, 0.1),
    "over an edge": (0.15, -0.55),
    "beside it": (2, 1),
    "far beside": (30, -10),
    "over a corner": (0.2, 0.9),
    "on the line of an edge": (3.6, -1.0),
}
HEIGHTS = [1e-9, 1e-6, 1e-3, 0.1, 1.0, 10.0, 1e3, 1e6]
CASES = {f"{name}, at {h}": T - [x, y, -h] for name, (x, y) in PLACES.items() for h in HEIGHTS}
CASES |= {f"{s} across": T * s + [0.5, 0.7, 1] for s in (0.1, 1e-3, 1e-6)}
CASES |= {f"{s} across, edge-on": T * s + [0.5, 0.7, 1e-3] for s in (0.1, 1e-3, 1e-6)}
CASES |= {f"obtuse, at {h}": OBTUSE - [0.2, -0.52, -h] for h in (1e-9, 1e-3)}
CASES |= {"a sliver": SLIVER - [0.3, -0.1, -1], "a sliver overhead": SLIVER - [0.5, 5e-7, -1e-3]}
CASES |= {
    "nearly a hemisphere": T * 1e6 + [0.1, 0.2, 1e-3],
    "one corner far": np.array([[0, 0, 1.0], [1e6, 1, 1], [0.3, 1, 1]]),
    "two corners far": np.array([[0, 0, 1.0], [1e6, 1, 1], [0.3e6, 1e6, 1]]),
}
TURNS = [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1)]


def columns(corners, n: int = 1) -> list[np.ndarray]:
    """Corner and edges (3, n), as the functions take them."""
    a, b, c = np.asarray(corners)
    return [np.repeat(v[:, None], n, axis=1) for v in (a, b - a, c - a)]


def exact(a, b, c) -> mp.mpf:
    ra, rb, rc = norm(a), norm(b), norm(c)
    lower = ra * rb * rc + mdot(a, b) * rc + mdot(a, c) * rb + mdot(b, c) * ra
    return 2 * mp.atan2(abs(mdot(a, mcross(b, c))), lower)


def exact_corners(corners) -> list:
    """The corners that the floats of corner and edges stand for."""
    a, ab, ac = (v[:, 0] for v in columns(corners))
    return [vector(a), *([x + y for x, y in zip(vector(a), vector(e), strict=True)] for e in (ab, ac))]


def tolerance(name: str) -> float:
    """Rounding of 1e-16 of the size over the distance from an edge or corner, or over the width: what is
    promised.
    """
    height = float(name.rsplit(" ", 1)[1]) if ", at" in name else 1.0
    lost = {"a sliver overhead": 1e-9, "one corner far": 1e-9, "two corners far": 1e-9}
    return max(
        1e-12,
        lost.get(name, 0.0),
        5e-16 / height if "over an edge" in name or "over a corner" in name else 0.0,
    )


@pytest.mark.parametrize("name", CASES)
def test_solid_angles_keep_their_digits(name):
    """To 1e-12 relative, and to what `tolerance` says of the hardest: a sum of angles minus pi would lose all
    below 1e-12 sr.
    """
    for turn in TURNS:
        corners = CASES[name][list(turn)]
        mine = float(solid_angle(*columns(corners))[0])
        assert abs(mine / exact(*exact_corners(corners)) - 1) < tolerance(name)


U = np.concatenate(
    [
        np.random.default_rng(3).random((2, 24)),
        [[0.0, 1 - 2**-53, 1e-9, 0.5, 0.5], [0.5, 0.5, 1e-3, 1 - 2**-53, 1e-3]],
    ],
    axis=1,
)


@pytest.mark.parametrize("name", CASES)
def test_samples_split_off_the_solid_angle_that_they_should(name):
    """Beside the arc from the apex to a sample lies u of the solid angle, and on it 1 - cos is divided by v,
    to 1e-6.

    A u at the distance r from the apex counts by r: at the apex itself it has no meaning. The way back is
    held to the same.
    """
    n = U.shape[1]
    for turn in TURNS:
        args = columns(CASES[name][list(turn)], n)
        y, _ = sample(U, *args)
        t = triangle._with_stable_edge(*args)
        a, b, c = (vector(v[:, 0]) for v in (t.a, t.b, t.c))
        whole, weight = exact(a, b, c), np.sqrt(U[1])
        for i in range(n):
            p = vector(y[:, i])
            wa, wc = mdot(p, mcross(b, c)), mdot(p, mcross(a, b))
            x = [wa * s + wc * e for s, e in zip(a, c, strict=True)]
            x = x if mdot(x, a) + mdot(x, c) > 0 else [-s for s in x]
            assert abs(_versine(b, p) / _versine(b, x) - U[1, i]) < 1e-6
            assert abs(exact(a, b, x) / whole - U[0, i]) * weight[i] < 1e-6
        back = invert(y / np.sqrt(dot(y, y)), *args)
        assert np.abs((back - U) * [weight, np.ones(n)]).max() < 1e-6


def _versine(b, x) -> mp.mpf:
    return 1 - mdot(b, x) / norm(b) / norm(x)


def round_trip(corners) -> float:
    n = 60
    u = np.random.default_rng(8).random((2, n)) * 0.98 + 0.01
    args = columns(corners, n)
    y, omega = sample(u, *args)
    np.testing.assert_allclose(omega, solid_angle(*args), rtol=1e-8)
    return float(np.abs(invert(y / np.sqrt(dot(y, y)), *args) - u).max())


@pytest.mark.parametrize("angle", [np.pi / 2, np.pi - np.sqrt(2 * triangle.OPPOSITE)])
def test_the_branches_of_angles_meet(angle):
    """An edge seen just under and just over the angles where K, the half angles and the dealing of roles
    change formula.
    """
    for shift in (-1e-3, -1e-9, 0.0, 1e-9, 1e-3):
        half = (angle + shift) / 2
        for third in ([0.0, 0.8, 1.0], [0.0, 1e-3, 1.0], [0.0, 40.0, 1.0]):
            ends = [[np.sin(half), 0.0, np.cos(half)], [-2 * np.sin(half), 0.0, 2 * np.cos(half)]]
            for turn in TURNS:
                assert round_trip(np.array([*ends, third])[list(turn)]) < 1e-9


def test_the_roles_change_hands_without_a_seam():
    """Points that walk across the lines where another edge is the widest, or another corner the nearer
    one.
    """
    for x in np.linspace(-1.5, 1.5, 61):
        assert round_trip(T - [x, 0.3 * x, -0.2]) < 1e-9
    equal = np.array([[1.0, 0, 1], [-0.5, np.sqrt(0.75), 1], [-0.5, -np.sqrt(0.75), 1]])
    assert round_trip(equal) < 1e-12


def test_nothing_is_seen_from_its_own_plane():
    """In the plane inside and outside, on an edge, at a corner: exactly 0, and no number that is not one, nor
    a warning.
    """
    inside, outside, edge, corner = [0.1, 0.1, 0], [3.0, 1, 0], (T[0] + T[1]) / 2, T[2]
    for p in (inside, outside, edge, corner):
        assert solid_angle(*columns(T - p))[0] == 0.0
        assert sample(np.full((2, 1), 0.3), *columns(T - p))[1][0] == 0.0


def test_behind_is_as_in_front():
    mirror = np.array([1.0, 1.0, -1.0])
    for corners in CASES.values():
        assert solid_angle(*columns(corners))[0] == solid_angle(*columns(corners * mirror))[0]


def test_rows_stand_alone():
    args, u = columns(T - [0.3, 0.2, -0.4], 37), np.random.default_rng(2).random((2, 37))
    args[0] = args[0] + np.random.default_rng(4).normal(size=(3, 37))
    whole, omega = sample(u, *args)
    for i in range(37):
        one, own = sample(u[:, i : i + 1], *(v[:, i : i + 1] for v in args))
        assert np.array_equal(one[:, 0], whole[:, i]) and own[0] == omega[i]


_COORDINATE = st.floats(-3, 3, allow_nan=False, width=32)
_POINT = st.tuples(_COORDINATE, _COORDINATE, _COORDINATE)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(_POINT, _POINT, _POINT, st.floats(0.05, 0.95), st.integers(-20, 20), _POINT)
def test_parts_add_up_however_it_is_turned(a, b, c, share, power, axis):
    """Cut from a corner the parts add up; turned and scaled it stays the same; its points are in it."""
    corners = np.array([a, b, c])
    volume = abs(np.linalg.det(corners))
    assume(volume > 1e-3 and np.linalg.norm(axis) > 0.1)
    cut = corners[1] + share * (corners[2] - corners[1])
    whole = solid_angle(*columns(corners))[0]
    parts = [solid_angle(*columns([corners[0], *part]))[0] for part in ((corners[1], cut), (cut, corners[2]))]
    assert sum(parts) == pytest.approx(whole, rel=1e-11)
    axis = np.array(axis) / np.linalg.norm(axis)
    reflected = corners - 2 * np.outer(corners @ axis, axis)
    assert solid_angle(*columns(reflected))[0] == pytest.approx(whole, rel=1e-11)
    assert solid_angle(*columns(corners * 2.0**power))[0] == pytest.approx(whole, rel=1e-14)
    assert round_trip(corners) < 1e-7
