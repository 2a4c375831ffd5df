"""The solid angle of a disk and its sampling, against 50-digit integrals that share nothing with the code."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from renderer.lights.disk import DiskLights
from renderer.math.vectors import dot, frame_about, normalize
from renderer.spherical.disk import FLAT, disk_view, invert, sample, solid_angle
from scenes.description.materials import Diffuse
from scenes.description.shapes import Disk, Emission, ShapeDescription

pytestmark = pytest.mark.usefixtures("thorough")

DIGITS = 50
# What is promised is 2e-15; a formula with any cancellation at all loses a factor of ten in one of the cases.
PROMISED = 1e-14

# (height, offset), the radius being 1: over the disk, in its plane but for nothing, by the rim, grazing, far,
# on the axis.
POINTS = {
    "near": (0.5, 0.3),
    "aside": (0.7, 2.1),
    "on the axis": (0.8, 0.0),
    "almost on the axis": (0.8, 1e-17),
    "1e-3 over the centre": (1e-3, 0.0),
    "1e-8 over it": (1e-8, 0.3),
    "1e-12 over it, by the rim": (1e-12, 1 - 1e-9),
    "over the rim": (0.3, 1.0),
    "1e-8 over the rim": (1e-8, 1.0),
    "1e-6 outside the rim": (1e-6, 1 + 1e-6),
    "1e-6 inside the rim": (1e-6, 1 - 1e-6),
    "grazing by 1e-6": (3e-6, 3.0),
    "grazing by 1e-12": (3e-12, 3.0),
    "1e-12 sr": (1.7e6, 3e5),
    "1e6 radii away, grazing": (1.0, 1e6),
    "1e6 radii away": (1e6, 0.1),
    "1e60 radii away": (1e60, 1e60),
    "on the sphere over the rim": (0.6, 0.8),
    "where the axis is tilted by 45 degrees": (0.75, 1.25),
}


def exact(height: float, offset: float, radius: float = 1.0) -> mp.mpf:
    """Paxton's form in Legendre's integrals K and Pi: it cancels by the cube of the distance, hence the
    further digits.
    """
    reach = max(height / radius, offset / radius, radius / max(height, 1e-300), 1.0)
    with mp.workdps(DIGITS + 20 + int(3 * np.log10(reach))):
        h, o, r = (mp.mpf(float(v)) for v in (height, offset, radius))
        far = mp.sqrt(h * h + (r + o) ** 2)
        m, n = 4 * r * o / far**2, 4 * r * o / (r + o) ** 2
        third = (r - o) / (r + o) * mp.ellippi(n, m) if r != o else mp.mpf(0)
        whole = 2 * mp.pi if o < r else mp.pi if o == r else 0
        return whole - 2 * h / far * (mp.ellipk(m) + third)


def left_of(x: mp.mpf, height: float, offset: float) -> mp.mpf:
    """Solid angle of the part of the unit disk within x of its near end, by strips across: no elliptic
    integral.
    """
    h, o = mp.mpf(float(height)), mp.mpf(float(offset))

    def strip(t):
        # x from the centre is -cos t, which takes the square roots away
        half, along = mp.sin(t), o - mp.cos(t)
        square = h * h + along * along
        return 2 * h * half / (square * mp.sqrt(square + half * half)) * half

    end = mp.acos(1 - x)
    nearest = mp.acos(min(o, mp.mpf(1)))
    width = h / max(mp.sin(nearest), mp.sqrt(h))
    cuts = {nearest + s * width * mp.mpf(10) ** k for k in range(14) for s in (-1, 1)} | {nearest}
    return mp.quad(strip, [mp.mpf(0), *sorted(c for c in cuts if 0 < c < end), end])


def view_of(height, offset):
    h, o = (
        np.atleast_1d(np.asarray(height, dtype=np.float64)),
        np.atleast_1d(np.asarray(offset, dtype=np.float64)),
    )
    return disk_view(h, o, np.ones_like(h))


@pytest.mark.parametrize("name", POINTS)
def test_solid_angle(name: str) -> None:
    value, truth = solid_angle(view_of(*POINTS[name]))[0], exact(*POINTS[name])
    error = float(abs(value / truth - 1))
    print(f"{value:.3e} sr, relative error {error:.1e}")
    assert error < PROMISED


def test_solid_angle_at_random() -> None:
    """A hundred and fifty points over sixteen decades; PROMISED is the smallest bias that would be caught."""
    rng = np.random.default_rng(1)
    height = 10 ** rng.uniform(-12, 6, 150)
    kind = rng.integers(0, 3, 150)
    rim = 1 + rng.choice([-1, 1], 150) * 10 ** rng.uniform(-14, -0.1, 150)
    offset = np.where(
        kind == 0, 10 ** rng.uniform(-12, 6, 150), np.where(kind == 1, rim, rng.uniform(0, 3, 150))
    )
    values = solid_angle(view_of(height, offset))
    errors = [float(abs(v / exact(h, o) - 1)) for v, h, o in zip(values, height, offset, strict=True)]
    worst = int(np.argmax(errors))
    print(f"worst {errors[worst]:.1e} at height {height[worst]:.2e}, offset - 1 = {offset[worst] - 1:.2e}")
    assert errors[worst] < PROMISED


def test_limits() -> None:
    """A hemisphere from the surface, nothing from the plane, half of one from the rim, 2 pi (1 - cos) on the
    axis.
    """
    assert solid_angle(view_of([0.0, 0.0, 0.0], [0.0, 0.5, 2.0])).tolist() == [0, 0, 0]
    over = solid_angle(view_of([1e-13, 1e-29, 1e-31, 1e-200], [0.4, 0.4, 0.4, 0.4]))
    np.testing.assert_allclose(over, 2 * np.pi, rtol=3e-13)
    np.testing.assert_allclose(solid_angle(view_of(1e-15, 1.0)), np.pi, rtol=1e-13)
    np.testing.assert_allclose(
        solid_angle(view_of([-0.5], [0.3])), solid_angle(view_of([0.5], [0.3])), rtol=0
    )
    h = np.array([1e-3, 0.1, 1.0, 30.0])
    root = np.sqrt(1 + h * h)
    np.testing.assert_allclose(solid_angle(view_of(h, 0 * h)), 2 * np.pi / (root * (root + h)), rtol=PROMISED)


# Where a half-angle is 45 degrees the root finds its sine on one side and its cosine on the other; FLAT is
# met over the surface.
THRESHOLDS = {
    "minor half-angle of 45 degrees": (0.6, 0.8, (0.6, 0.8)),
    "tilt of 45 degrees": (0.75, 1.25, (0.75, -1.25)),
    "flat": (FLAT, 0.3, (FLAT, 0.0)),
}


@pytest.mark.parametrize("name", THRESHOLDS)
@pytest.mark.parametrize("step", [1e-15, 1e-12, 1e-9, 1e-6])
def test_across_a_threshold(name: str, step: float) -> None:
    """On both sides the solid angle is exact and the samples go on as they were: a branch that differed by
    1e-13 would show.
    """
    h, o, (dh, do) = THRESHOLDS[name]
    heights, offsets = np.array([h - step * dh, h + step * dh]), np.array([o - step * do, o + step * do])
    view = view_of(heights, offsets)
    omega = solid_angle(view)
    for value, height, offset in zip(omega, heights, offsets, strict=True):
        assert abs(value / exact(height, offset) - 1) < PROMISED
    u = np.repeat(np.random.default_rng(3).random((2, 50, 1)), 2, axis=2)
    for pair in u.transpose(1, 0, 2):
        wi = sample(view, omega, np.ascontiguousarray(pair))
        assert np.abs(wi[:, 0] - wi[:, 1]).max() < 20 * step + 1e-13


@pytest.mark.parametrize(
    "name",
    [
        "near",
        "aside",
        "on the axis",
        "1e-3 over the centre",
        "over the rim",
        "grazing by 1e-6",
        "1e6 radii away",
    ],
)
def test_samples_divide_the_solid_angle(name: str) -> None:
    """u[0] is the share of the solid angle on the near side of the sample's meridian, u[1] of the chord's
    sine of latitude.

    Against 50 digits: catches a share off by 1e-10, which is what a sample's own rounding leaves at 1e-6 rad.
    """
    height, offset = POINTS[name]
    view = view_of(height, offset)
    omega = solid_angle(view)
    for u0, u1 in ((0.02, 0.3), (0.37, 0.99), (0.5, 0.1), (0.81, 0.5), (1 - 1e-6, 0.75)):
        wi = sample(view, omega, np.array([[u0], [u1]]))[:, 0]
        with mp.workdps(DIGITS):
            x, y, z = (mp.mpf(float(v)) for v in wi)
            ahead = x / z * height - (mp.mpf(float(offset)) - 1)
            share = left_of(ahead, height, offset) / exact(height, offset)
            chord = mp.sqrt(ahead * (2 - ahead))
            level = mp.hypot(x / z * height, height)
            latitude = y / (chord / mp.hypot(chord, level))
            bound = 1e-12 + 1e-15 / float(view.sin_minor[0])
            assert abs(share - mp.mpf(u0)) < bound
            # Near an end the chord is the root of what is left: it magnifies the rounding of wi.
            assert abs((latitude + 1) / 2 - mp.mpf(u1)) < bound / min(u0, 1 - u0)


def hard_views(n: int, seed: int):
    rng = np.random.default_rng(seed)
    height = 10 ** rng.uniform(-12, 6, n)
    rim = 1 + rng.choice([-1, 1], n) * 10 ** rng.uniform(-12, -0.1, n)
    kind = rng.integers(0, 3, n)
    offset = np.where(kind == 0, 10 ** rng.uniform(-6, 6, n), np.where(kind == 1, rim, rng.uniform(0, 3, n)))
    return view_of(height, offset), rng


def test_inverse_of_the_samples() -> None:
    """invert(sample(u)) == u to 1e-6 from 1e-12 sr to 2 pi, in every position; a step less in the search
    loses 1e-4.
    """
    view, rng = hard_views(20_000, 5)
    omega = solid_angle(view)
    u = rng.random((2, omega.size))
    wi = sample(view, omega, u)
    np.testing.assert_allclose(dot(wi, wi), 1.0, rtol=1e-14)
    error = np.abs(invert(view, omega, wi) - u)
    print(f"worst {error.max(axis=1)}")
    assert (error[0] < 1e-8).all()
    # Across: the lune's length comes from its distance to the end, which wi holds to 1e-16 / half-angle.
    ends = np.minimum(u[0], 1 - u[0]) ** (2 / 3)
    assert (error[1] < 1e-9 + 1e-15 / (view.sin_minor * ends)).all()
    usual = (omega > 1e-12) & (np.minimum(u[0], 1 - u[0]) > 1e-5)
    assert (error[:, usual] < 1e-6).all()


@pytest.mark.parametrize("name", POINTS)
def test_samples_at_the_ends_of_the_square(name: str) -> None:
    """The corners, edges and centre of the unit square give unit directions to the disk, and come back."""
    height, offset = POINTS[name]
    u = np.array([(a, b) for a in (0.0, 1e-16, 0.5, 1 - 2**-53) for b in (0.0, 0.5, 1 - 2**-53)]).T
    view = view_of(np.full(12, height), np.full(12, offset))
    omega = solid_angle(view)
    wi = sample(view, omega, u)
    np.testing.assert_allclose(dot(wi, wi), 1.0, rtol=1e-14)
    assert (wi[2] > 0).all()
    reach = max(1.0, height, offset)
    off = np.hypot(wi[0] / wi[2] * height - offset, wi[1] / wi[2] * height)
    assert (off < 1 + 1e-14 * reach * reach / max(height, 1e-3 * reach)).all() or height < 1e-3
    # wi is known to 1e-16: at 1e60 radii that is all of the disk.
    assert (np.abs(invert(view, omega, wi)[0] - u[0]) < 1e-9 + 1e-15 / view.sin_minor).all()


def test_a_row_does_not_depend_on_the_others() -> None:
    """Bit by bit, though rows leave the search at different steps."""
    view, rng = hard_views(301, 9)
    u = rng.random((2, 301))
    wi = sample(view, solid_angle(view), u)
    for i in range(0, 301, 7):
        one = disk_view(view.height[i : i + 1], view.offset[i : i + 1], np.ones(1))
        omega = solid_angle(one)
        assert omega[0] == solid_angle(view)[i]
        assert sample(one, omega, u[:, i : i + 1])[:, 0].tolist() == wi[:, i].tolist()


# The whole light, anywhere, any way up, at any scale

_COORDINATE = st.floats(-3, 3, allow_nan=False)
_VECTOR = st.tuples(_COORDINATE, _COORDINATE, _COORDINATE).map(np.array)
_UNIT = _VECTOR.filter(lambda v: float(v @ v) > 1e-2).map(lambda v: v / np.sqrt(v @ v))


def light_of(center, normal, radius: float, radiance=(3.0, 2.0, 1.0), two_sided: bool = False) -> DiskLights:
    disk = Disk(np.asarray(center, dtype=np.float64), np.asarray(normal, dtype=np.float64), radius)
    emission = Emission(np.array(radiance), two_sided)
    return DiskLights.make([ShapeDescription(disk, Diffuse(np.zeros(3)), emission)], [0])


@settings(max_examples=60, deadline=None, derandomize=True)
@given(_VECTOR, _UNIT, st.floats(0.01, 3), _VECTOR, st.floats(-6, 6))
def test_pdf_of_any_disk_anywhere(center, normal, radius, p, exponent) -> None:
    """pdf > 0 where sampled, the same when asked, exact, and 1 in all over the cone that holds the disk (to 3
    %: 8192 points).
    """
    scale = 10.0**exponent
    assume(abs(float((p - center) @ normal)) > 1e-3)
    n = 8192
    light = light_of(center * scale, normal, radius * scale, two_sided=True)
    sampler = light.techniques["solid-angle"]
    at, where = np.zeros(n, dtype=np.int64), np.repeat((p * scale)[:, None], n, axis=1)
    ref_n = np.repeat(normal[:, None], n, axis=1)
    u = np.stack([(np.arange(n) + 0.5) / n, np.arange(n) * 0.6180339887498949 % 1.0])
    s = sampler.sample_direction(at, where, ref_n, u)
    asked = sampler.pdf_direction(at, where, ref_n, s.wi)
    assert s.valid.all() and (s.pdf > 0).all()
    assert (asked > 0).mean() > 0.999 and (asked[asked > 0] == s.pdf[0]).all()
    height = abs(float((p - center) @ normal))
    offset = float(np.linalg.norm(np.cross(p - center, normal)))
    assert abs(1 / s.pdf[0] / exact(height, offset, radius) - 1) < 1e-11 / height
    landed = where + s.wi * s.dist
    assert np.abs(dot(landed - center[:, None] * scale, normal[:, None])).max() < 1e-13 * scale
    axis = normalize(s.wi.mean(axis=1)[:, None])
    opening = min(float((1 - dot(axis, s.wi)).max()) * 1.02 + 1e-9, 2.0)
    below = u[0] * opening
    x, y, z = frame_about(axis)
    sine, phi = np.sqrt(below * (2 - below)), 2 * np.pi * u[1]
    cone = x * (sine * np.cos(phi)) + y * (sine * np.sin(phi)) + z * (1 - below)
    share = sampler.pdf_direction(at, where, ref_n, cone).mean() * 2 * np.pi * opening
    hits = (sampler.pdf_direction(at, where, ref_n, cone) > 0).sum()
    assume(hits > 300)  # a sliver in a wide cone says nothing
    assert share == pytest.approx(1.0, abs=0.03 + 3 / np.sqrt(hits) * (hits < 3000))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(_VECTOR, _UNIT, st.floats(0.01, 3), _VECTOR, st.floats(-6, 6), _UNIT, _VECTOR)
def test_moved_turned_and_scaled(center, normal, radius, p, exponent, turn, shift) -> None:
    """Solid angles stay, to the rounding that moving brings; at scale 10^(+-6) and with the origin three
    sizes away.
    """
    height = float((p - center) @ normal)
    assume(abs(height) > 1e-2)
    scale = 10.0**exponent
    q = 2 * np.outer(turn, turn) - np.eye(3)  # half a turn about any axis

    def move(v):
        return (q @ v + shift) * scale

    one, two = (
        light_of(center, normal, radius, two_sided=True),
        light_of(move(center), q @ normal, radius * scale, two_sided=True),
    )
    at, u = np.zeros(1, dtype=np.int64), np.array([[0.3], [0.6]])
    a = one.techniques["solid-angle"].sample_direction(at, p[:, None], normal[:, None], u)
    b = two.techniques["solid-angle"].sample_direction(at, move(p)[:, None], normal[:, None], u)
    assert b.pdf[0] == pytest.approx(a.pdf[0], rel=1e-12 / abs(height))


def test_one_side_emits() -> None:
    """Behind a one-sided disk and in its plane nothing is valid; a two-sided one is seen from both sides."""
    p = np.array([[0.2, 0.1, -0.5], [0.2, 0.1, 0.5], [0.2, 0.1, 0.0], [3.0, 0.0, 0.0]]).T
    at, u = np.zeros(4, dtype=np.int64), np.full((2, 4), 0.4)
    one = light_of([0.0, 0, 0], [0.0, 0, 1], 1.0).techniques["solid-angle"].sample_direction(at, p, p, u)
    two = (
        light_of([0.0, 0, 0], [0.0, 0, 1], 1.0, two_sided=True)
        .techniques["solid-angle"]
        .sample_direction(at, p, p, u)
    )
    assert one.valid.tolist() == [False, True, False, False]
    assert two.valid.tolist() == [True, True, False, False]
    assert two.pdf[0] == two.pdf[1] and two.wi[2, 0] == -two.wi[2, 1] > 0
