"""Irradiance of disks and spheres against 40 digits, against adaptive quadrature, against the references' own
formulas, and across thresholds.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import dblquad

from pipeline.references.closed_form import radiometry
from renderer.lights.disk import DiskLights
from renderer.lights.sphere import SphereLights
from renderer.spherical import disk_irradiance as formulas
from renderer.spherical.disk import disk_view
from renderer.spherical.disk_irradiance import NARROW, disk_irradiance, sphere_irradiance
from scenes.description.materials import Diffuse
from scenes.description.shapes import Disk, Emission, ShapeDescription, Sphere
from tests.kit import exact_radiometry as exact
from tests.kit.exact_radiometry import unit

pytestmark = pytest.mark.usefixtures("thorough")

UP = np.array([0.0, 0, 1])
ORIGIN = np.zeros(3)
# Relative error of what is wholly above the horizon, and absolute error of what is cut by it: a few
# roundings.
PROMISED, CANCELLING = 1e-13, 4e-15
TILTED = unit([0.1, 0.3, -1])

# p, n, radius of a disk at the origin that emits towards +z, and what is allowed: a relative error, or None
# for CANCELLING alone
DISKS = {
    "near": ((0.3, 0.2, 1.0), TILTED, 1.0, PROMISED),
    "on the axis": ((0.0, 0, 1), TILTED, 1.0, PROMISED),
    "almost on the axis": ((1e-17, 0, 1), TILTED, 1.0, PROMISED),
    "1e-8 from the light": ((0.3, 0.2, 1e-8), TILTED, 1.0, PROMISED),
    "solid angle 3e-14": ((0.3, 0.2, 1.0), TILTED, 1e-7, PROMISED),
    "1e6 radii away": ((3e5, 0.2, 1e6), TILTED, 1.0, PROMISED),
    "nearly a hemisphere": ((0.3, 0.2, 1e-3), -UP, 1e6, PROMISED),
    "edge-on, 1e-8 before its plane": ((3.0, 0.2, 1e-8), unit((-0.3, 0.3, -0.1)), 1.0, PROMISED),
    "1e-6 from the rim": ((1 + 1e-6, 0, 1e-6), unit((-0.3, 0.3, -0.1)), 1.0, 1e-9),
    "1e-6 within the rim": ((1 - 1e-6, 0, 1e-6), unit((-0.3, 0.3, -1)), 1.0, 1e-9),
    "on the rim's cylinder": ((1.0, 0, 0.2), unit((-0.3, 0.3, -1)), 1.0, PROMISED),
    "across the horizon": ((0.3, 0.2, 1.0), unit((1, 0.3, -0.1)), 1.0, PROMISED),
    "across the horizon, across the plane of symmetry": ((0.3, 0.0, 1.0), unit((0, 1, -0.1)), 1.0, PROMISED),
    "across the horizon, in the plane of symmetry": ((0.3, 0.0, 1.0), unit((1, 0, 0.1)), 1.0, PROMISED),
    "across the horizon, on the axis": ((0.0, 0, 1), unit((1, 0.3, -0.1)), 1.0, PROMISED),
    "half, on the axis": ((0.0, 0, 1), (1.0, 0, 0), 1.0, PROMISED),
    "1e-8 from the light, across the horizon": ((0.3, 0.2, 1e-8), unit((1, 0, 0.3)), 1.0, PROMISED),
    "1e-15 from the light, across the horizon": ((0.3, 0.2, 1e-15), unit((1, 0, 0.3)), 1.0, PROMISED),
    "by the rim, across the horizon": ((1 + 1e-6, 0, 1e-6), unit((-0.3, 0.3, 0.1)), 1.0, 1e-9),
    "small, across the horizon": ((0.3, 0.2, 1.0), unit((1, 0, -0.3)), 1e-3, 1e-11),
    "tiny, across the horizon": ((0.3, 0.2, 1.0), unit((1, 0, -0.3)), 1e-6, 1e-9),
    "all but a sliver": ((0.3, 0.2, 0.5), unit((1, 0, -2.59)), 1.0, PROMISED),
    "a sliver above the horizon": ((0.3, 0.2, 0.5), unit((1, 0, 1.39)), 1.0, 1e-10),
    "edge-on, across the horizon": ((3.0, 0.2, 1e-6), unit((-0.1, 0.9, 0.0)), 1.0, None),
}

SPHERES = {
    "near": ((0.3, 0.2, 2.0), TILTED, 1.0, PROMISED),
    "1e-8 from it": ((0.0, 0, 1 + 1e-8), TILTED, 1.0, PROMISED),
    "1e-12 from it": ((0.0, 0, 1 + 1e-12), TILTED, 1.0, PROMISED),
    "1e-8 from it, half above the horizon": ((0.0, 0, 1 + 1e-8), (1, 0, 0), 1.0, PROMISED),
    "solid angle 3e-14": ((0.3, 0.2, 1.0), TILTED, 1e-7, PROMISED),
    "across the horizon, centre above": ((0.3, 0.2, 2.0), unit((1, 0.3, -0.4)), 1.0, PROMISED),
    "across the horizon, centre below": ((0.3, 0.2, 2.0), unit((1, 0.3, 0.3)), 1.0, PROMISED),
    "small, centre on the horizon": ((0.0, 0, 1.0), (1, 0, 0), 0.05, PROMISED),
    "tiny, centre on the horizon": ((0.0, 0, 1.0), (1, 0, 0), 1e-6, PROMISED),
}


def disk_light(
    radius: float = 1.0, center=ORIGIN, normal=UP, radiance=(1.0, 1.0, 1.0), two_sided: bool = False
):
    disk = Disk(np.asarray(center, dtype=np.float64), np.asarray(normal, dtype=np.float64), radius)
    shape = ShapeDescription(disk, Diffuse(np.zeros(3)), Emission(np.array(radiance), two_sided))
    return DiskLights.make([shape], [0])


def sphere_light(
    radius: float = 1.0,
    center=ORIGIN,
    reverse: bool = False,
    radiance=(1.0, 1.0, 1.0),
    two_sided: bool = False,
):
    sphere = Sphere(np.asarray(center, dtype=np.float64), radius, reverse=reverse)
    shape = ShapeDescription(sphere, Diffuse(np.zeros(3)), Emission(np.array(radiance), two_sided))
    return SphereLights.make([shape], [0])


def irradiance(light, p, n) -> np.ndarray:
    p, n = (np.atleast_2d(np.asarray(v, dtype=np.float64)).T.copy() for v in (p, n))
    n = np.broadcast_to(n, p.shape).copy()
    e = light.irradiance(np.zeros(p.shape[1], dtype=np.int64), p, n)
    assert e is not None and e.shape == p.shape
    return e


def compare(value: float, truth, relative: float | None) -> None:
    error = float(abs(value - truth))
    print(f"{value:.6e}: relative error {error / float(truth):.1e}, absolute {error:.1e}")
    assert error <= (CANCELLING if relative is None else relative * float(truth))


@pytest.mark.parametrize("case", DISKS)
def test_disk(case: str) -> None:
    p, n, radius, relative = DISKS[case]
    compare(irradiance(disk_light(radius), p, n)[0, 0], exact.disk(p, n, ORIGIN, UP, radius), relative)


@pytest.mark.parametrize("case", SPHERES)
def test_sphere(case: str) -> None:
    p, n, radius, relative = SPHERES[case]
    compare(irradiance(sphere_light(radius), p, n)[0, 0], exact.sphere(p, n, ORIGIN, radius), relative)


def test_disks_at_random_against_40_digits() -> None:
    """Two dozen disks across the horizon, over twelve decades: conditioning is what rounding n by 1e-16 does
    to what is visible.
    """
    rng = np.random.default_rng(8)
    for _ in range(24):
        height, offset = 10 ** rng.uniform(-6, 4), 10 ** rng.uniform(-6, 4)
        p = np.array([offset, 0.0, height])
        seen = np.array([*(rng.normal(size=2) * 0.5), 0.0]) - p
        n = rng.normal(size=3)
        n = unit(n - seen * (n @ seen) / (seen @ seen))
        view = disk_view(np.array([height]), np.array([offset]), np.ones(1))
        solid = np.pi * view.sin_minor[0] * view.sin_major[0]
        error = float(abs(irradiance(disk_light(), p, n)[0, 0] - exact.disk(p, n, ORIGIN, UP, 1.0)))
        assert error < max(4e-16 * solid, PROMISED * solid * view.sin_minor[0]) + 4e-16 * (
            view.sin_major[0] > 0.1
        )


def _over_plane(p, n) -> float:
    """The area form by adaptive cubature: no contour, no clipping."""

    def f(y: float, x: float) -> float:
        r = np.array([x, y, 0.0]) - p
        return max(0.0, float(r @ n)) * p[2] / float(r @ r) ** 2

    return dblquad(
        f, -1, 1, lambda x: -np.sqrt(1 - x * x), lambda x: np.sqrt(1 - x * x), epsabs=1e-8, epsrel=1e-8
    )[0]


@pytest.mark.parametrize(
    "n", [TILTED, unit((1, 0.3, -0.1)), unit((-0.4, 1.0, 0.2))], ids=["above", "across", "mostly below"]
)
def test_the_formula_is_the_area_integral(n: np.ndarray) -> None:
    """A wrong formula cannot pass, as the cubature shares nothing with it; 1e-6 is the cubature's own doubt
    at the kink.
    """
    p = np.array([0.3, 0.2, 0.8])
    assert irradiance(disk_light(), p, n)[0, 0] == pytest.approx(_over_plane(p, n), rel=1e-6)


def test_agrees_with_the_references() -> None:
    """4,000 points and normals: two derivations in different frames and parameters, which share no code."""
    rng = np.random.default_rng(2)
    p, n = rng.normal(size=(4000, 3)) * 2, rng.normal(size=(4000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    for ours, theirs in (
        (irradiance(disk_light(), p, n)[0], radiometry.disk_irradiance(p, n, ORIGIN, UP, 1.0)),
        (irradiance(sphere_light(), p, n)[0], radiometry.sphere_irradiance(p, n, ORIGIN, 1.0)),
    ):
        assert (theirs == 0).sum() > 300 and np.count_nonzero(theirs) > 1000
        assert np.abs(ours - theirs).max() < CANCELLING
        assert ((ours == 0) == (theirs == 0)).mean() > 0.999


@pytest.mark.parametrize("step", [1e-15, 1e-9, 1e-4])
@pytest.mark.parametrize("depth", [-1.0, 1.0])
def test_across_first_and_last_contact_with_the_horizon(step: float, depth: float) -> None:
    """The cone touches the horizon from below and from above: the cut form meets 0, and pi sin a sin b cos,
    without a jump.
    """
    slope = np.array([1 - step, 1 + step]) * 0.6  # tangent of the half-angle of a disk of radius 0.6 at 1
    n = np.stack([np.ones(2), np.zeros(2), depth * slope]) / np.sqrt(1 + slope * slope)
    view = disk_view(np.ones(2), np.zeros(2), np.full(2, 0.6))
    e = disk_irradiance(view, *n)
    truth = [float(exact.disk((0, 0, 1), (x, y, -z), ORIGIN, UP, 0.6)) for x, y, z in n.T]
    assert np.abs(e - truth).max() < CANCELLING
    assert abs(e[1] - e[0]) < 3 * step + CANCELLING


@pytest.mark.parametrize("factor", [1 - 1e-9, 1 + 1e-9])
@pytest.mark.parametrize("level", [0.0, 0.5, -0.9])
def test_across_the_hand_over_to_the_cubature(
    factor: float, level: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At NARROW both forms hold: each is exact there to 1e-12, and they agree with one another on both sides
    of it.
    """
    half = np.sqrt(1 - level * level) if level < 0 else 1.0
    tangent = NARROW / half * factor
    n = unit((1.0, 0.3, 0.0))
    up = level * tangent * np.hypot(n[0], n[1])
    n = unit((n[0], n[1], up))
    view = disk_view(np.ones(1), np.zeros(1), np.full(1, tangent))
    columns = [np.array([v]) for v in n]
    truth = float(exact.disk((0, 0, 1), (n[0], n[1], -n[2]), ORIGIN, UP, tangent))
    assert disk_irradiance(view, *columns)[0] == pytest.approx(truth, rel=1e-11)
    for threshold in (0.0, 10.0):
        monkeypatch.setattr(formulas, "NARROW", threshold)
        assert disk_irradiance(view, *columns)[0] == pytest.approx(truth, rel=1e-12 if level >= 0 else 1e-10)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-7, -1e-9), st.floats(-1, 1))
def test_a_sphere_is_the_disk_of_its_cone(exponent: float, facing: float) -> None:
    """From anywhere outside: the same two cones by two ways, from 1e-7 to nearly 90 degrees."""
    sine = 10.0**exponent
    assume(abs(facing) < 1)
    cosine = np.sqrt((1 - sine) * (1 + sine))
    view = disk_view(np.array([cosine]), np.zeros(1), np.array([sine]))
    level = np.sqrt((1 - facing) * (1 + facing))
    disk = disk_irradiance(view, np.array([level * 0.6]), np.array([level * 0.8]), np.array([facing]))
    sphere = sphere_irradiance(np.array([sine]), np.array([cosine]), np.array([facing]))
    assert disk[0] == pytest.approx(sphere[0], rel=1e-12, abs=CANCELLING * sine)


_COORDINATE = st.floats(-3, 3, allow_nan=False)
_VECTOR = st.tuples(_COORDINATE, _COORDINATE, _COORDINATE).map(np.array)
_UNIT = _VECTOR.filter(lambda v: float(v @ v) > 1e-2).map(lambda v: v / np.sqrt(v @ v))


@settings(max_examples=80, deadline=None, derandomize=True)
@given(_VECTOR, _UNIT, _UNIT, st.floats(-6, 6), _UNIT, _VECTOR, st.floats(0.1, 1e3))
def test_moved_turned_scaled_and_brightened(p, n, normal, exponent, turn, shift, bright) -> None:
    """Disk and sphere: the same irradiance wherever the scene is and however large, in proportion to the
    radiance, in [0, pi L].
    """
    assume(abs(float(p @ normal)) > 0.05)
    assume(abs(np.linalg.norm(p) - 0.9) > 0.05)
    scale = 10.0**exponent
    q = 2 * np.outer(turn, turn) - np.eye(3)
    center = shift * scale
    for one, two in (
        (
            disk_light(0.9, ORIGIN, normal, two_sided=True),
            disk_light(0.9 * scale, center, q @ normal, (bright, 0, 1), True),
        ),
        (sphere_light(0.9, two_sided=True), sphere_light(0.9 * scale, center, False, (bright, 0, 1), True)),
    ):
        a, b = irradiance(one, p, n)[:, 0], irradiance(two, (q @ p + shift) * scale, q @ n)[:, 0]
        assert 0 <= a[0] <= np.pi * (1 + 1e-15)
        # moving rounds points by 1e-15, seen from 0.05 away
        assert b[2] == pytest.approx(a[0], abs=1e-13)
        assert b[1] == 0 and b[0] == pytest.approx(bright * b[2], rel=1e-14)


def test_known_values() -> None:
    """A disk along its axis, a sphere, the inside of a sphere; behind, in the plane, and inside: exactly
    0.
    """
    p = np.array([[0.0, 0, 0.5], [0, 0, 2], [0, 0, 30]])
    h2 = p[:, 2] ** 2
    np.testing.assert_allclose(
        irradiance(disk_light(1.7), p, -UP)[0], np.pi * 1.7**2 / (1.7**2 + h2), rtol=1e-14
    )
    p[:, 2] += 2
    np.testing.assert_allclose(
        irradiance(sphere_light(1.7), p, -UP)[0], np.pi * 1.7**2 / p[:, 2] ** 2, rtol=1e-14
    )
    inside = [[0.0, 0, 0], [0.5, 0.1, 0], [0, 0, -0.999999]]
    assert (
        irradiance(sphere_light(reverse=True, radiance=(3.0, 2.0, 1.0)), inside, UP)[0].tolist()
        == [3 * np.pi] * 3
    )
    assert irradiance(sphere_light(), inside, UP).tolist() == np.zeros((3, 3)).tolist()
    assert irradiance(sphere_light(reverse=True), p, -UP).tolist() == np.zeros((3, 3)).tolist()
    assert irradiance(disk_light(), [[0.1, 0, -1.0], [0.1, 0, 0], [3, 0, 0], [1, 0, 0]], UP).max() == 0
    assert irradiance(disk_light(), p, UP).max() == 0 and irradiance(sphere_light(), p, UP).max() == 0


def test_rows_stand_alone() -> None:
    """Bit by bit, whichever of the three forms the neighbours take; and no rows give no rows."""
    rng = np.random.default_rng(4)
    p, n = rng.normal(size=(60, 3)) * 10 ** rng.uniform(-1, 2, (60, 1)), rng.normal(size=(60, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    for light in (disk_light(two_sided=True), sphere_light(two_sided=True)):
        whole = irradiance(light, p, n)
        assert [irradiance(light, p[i], n[i])[0, 0] for i in range(60)] == whole[0].tolist()
        none = light.irradiance(np.zeros(0, dtype=np.int64), np.zeros((3, 0)), np.zeros((3, 0)))
        assert none.shape == (3, 0)
