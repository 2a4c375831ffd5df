"""Sphere lights where they are delicate: inside, at the centre, on the surface, 1e-12 outside it, and 1e-12
sr small.
"""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from renderer.lights.sphere import SphereLights
from renderer.math.vectors import dot
from scenes.description.materials import Diffuse
from scenes.description.shapes import Emission, ShapeDescription, Sphere

N = 2000


def light_of(center, radius: float, reverse: bool = False, two_sided: bool = False) -> SphereLights:
    sphere = Sphere(np.asarray(center, dtype=np.float64), radius, reverse=reverse)
    emission = Emission(np.array([3.0, 2.0, 1.0]), two_sided)
    return SphereLights.make([ShapeDescription(sphere, Diffuse(np.zeros(3)), emission)], [0])


def draw(light: SphereLights, p, technique: str = "solid-angle", seed: int = 0):
    at, u = np.zeros(N, dtype=np.int64), np.random.default_rng(seed).random((2, N))
    where = np.repeat(np.asarray(p, dtype=np.float64)[:, None], N, axis=1)
    sampler = light.techniques[technique]
    s = sampler.sample_direction(at, where, where, u)
    return s, sampler.pdf_direction(at, where, where, s.wi), u


def exact_solid_angle(distance, radius) -> mp.mpf:
    with mp.workdps(50):
        ratio = mp.mpf(radius) / mp.mpf(distance)
        return 2 * mp.pi * (1 - mp.sqrt(1 - ratio * ratio))


# Distance of the centre along z, and radius: the point is the origin, so that the distance is exact.
OUTSIDE = {
    "usual": (2.0, 0.5),
    "1e-3 outside": (1.001, 1.0),
    "1e-12 outside": (1 + 1e-12, 1.0),
    "one rounding outside": (1 + 2**-52, 1.0),
    "radius / distance 1e-6": (1.0, 1e-6),
    "1e-12 sr": (1.0, 5.6e-7),
    "1e-16 sr": (3e8, 1.0),
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_outside(name: str) -> None:
    """Solid angle, distance and normal against 50 digits at each sample; 1 - cos taken as a difference loses
    all at 1e-16 sr.
    """
    distance, radius = OUTSIDE[name]
    s, asked, u = draw(light_of([0.0, 0, distance], radius), [0.0, 0, 0])
    assert s.valid.all()
    assert abs(s.pdf[0] * exact_solid_angle(distance, radius) - 1) < 1e-14
    # Directions next to the rim may miss by the rounding of wi.
    assert (asked > 0).mean() > 0.99 and (asked[asked > 0] == s.pdf[0]).all()
    np.testing.assert_allclose(dot(s.wi, s.wi), 1.0, rtol=1e-14)
    np.testing.assert_allclose(dot(s.normal, s.normal), 1.0, rtol=1e-12)
    assert (dot(s.normal, s.wi) <= 1e-12).all()
    with mp.workdps(50):
        d, r = mp.mpf(distance), mp.mpf(radius)
        opening = exact_solid_angle(distance, radius) / (2 * mp.pi)
        for i in range(40):
            cosine = 1 - mp.mpf(float(u[0, i])) * opening
            sine2 = 1 - cosine * cosine
            truth = d * cosine - mp.sqrt(r * r - d * d * sine2)
            assert (
                abs(s.dist[i] / truth - 1)
                < 1e-14 + 1e-16 * (1 + distance * radius / float(truth) ** 2) ** 0.5
            )
            sine = np.hypot(s.wi[0, i], s.wi[1, i])
            assert abs(sine / mp.sqrt(sine2) - 1) < 1e-14
            outward = float(truth * mp.sqrt(sine2) / r)
            assert np.hypot(s.normal[0, i], s.normal[1, i]) == pytest.approx(outward, rel=1e-12)


@pytest.mark.parametrize("name", OUTSIDE)
def test_the_square_is_mapped_to_the_cone_and_back(name: str) -> None:
    """invert(sample(u)) == u, the inverse being written here: (1 - cos) / opening, and the azimuth."""
    distance, radius = OUTSIDE[name]
    s, _, u = draw(light_of([0.0, 0, distance], radius), [0.0, 0, 0])
    sine2 = s.wi[0] ** 2 + s.wi[1] ** 2
    below = np.where(s.wi[2] > 0, sine2 / (1 + np.abs(s.wi[2])), 1 - s.wi[2])
    opening = float(exact_solid_angle(distance, radius) / (2 * mp.pi))
    assert np.abs(below / opening - u[0]).max() < 1e-12
    phi = np.arctan2(s.wi[1], s.wi[0]) / (2 * np.pi) % 1.0
    assert np.abs((phi - u[1] + 0.5) % 1.0 - 0.5).max() < 1e-12


INSIDE = {
    "at the centre": 0.0,
    "1e-300 off the centre": 1e-300,
    "within": 0.7,
    "1e-12 within": 1 - 1e-12,
    "on the surface": 1.0,
}


@pytest.mark.parametrize("name", INSIDE)
def test_inside(name: str) -> None:
    """All directions, pdf 1/(4 pi), the wall at the far root of the quadratic; nothing where only the outside
    emits.
    """
    off = INSIDE[name]
    s, asked, _ = draw(light_of([0.0, 0, off], 1.0, reverse=True), [0.0, 0, 0])
    assert s.valid.mean() > (0.45 if off == 1.0 else 0.999)
    ok = s.valid
    np.testing.assert_allclose(s.pdf[ok], 1 / (4 * np.pi), rtol=1e-15)
    assert (asked[ok] > 0).mean() > 0.99
    landed = s.wi * s.dist - np.array([[0.0], [0.0], [off]])
    np.testing.assert_allclose(dot(landed, landed)[ok], 1.0, rtol=1e-14)
    np.testing.assert_allclose(s.normal[:, ok], landed[:, ok], atol=1e-12)
    with mp.workdps(50):
        for i in np.flatnonzero(ok)[:40]:
            z = mp.mpf(float(s.wi[2, i])) * off
            truth = z + mp.sqrt(z * z + (1 - mp.mpf(off) ** 2))
            assert abs(s.dist[i] / truth - 1) < 1e-13
    assert not draw(light_of([0.0, 0, off], 1.0), [0.0, 0, 0])[0].valid.any()
    both = draw(light_of([0.0, 0, off], 1.0, two_sided=True), [0.0, 0, 0])[0]
    assert both.valid.tolist() == s.valid.tolist()


@pytest.mark.parametrize("technique", ["area", "solid-angle"])
@pytest.mark.parametrize("reverse", [False, True])
def test_across_the_surface(technique: str, reverse: bool) -> None:
    """From 1e-15 within to 1e-15 without, in both directions: only the side that emits is lit, all numbers
    are finite.
    """
    light = light_of([0.0, 0, 1.0], 1.0, reverse)
    for gap in (1e-3, 1e-9, 1e-12, 1e-15):
        for side in (1, -1):
            s, asked, _ = draw(light, [0.0, 0, -gap * side], technique)
            lit = (side > 0) != reverse
            # Of the whole sphere's area a point sees a cap, gap / 2 of it: none, soon.
            assert s.valid.any() == lit or (technique == "area" and not reverse and gap < 1e-2)
            assert lit or not s.valid.any()
            assert np.isfinite(s.dist[s.valid]).all() and np.isfinite(s.pdf[s.valid]).all()
            if s.valid.any():
                assert (asked[s.valid] > 0).mean() > 0.9
            if lit and technique == "solid-angle":
                omega = 4 * np.pi if reverse else float(exact_solid_angle(1 + mp.mpf(gap), 1))
                # 1 + 1e-15 is known to 2e-16: the half-angle's cosine, sqrt(2e-15), to a tenth
                assert 1 / s.pdf[0] == pytest.approx(omega, rel=1e-14 + 1e-16 / np.sqrt(gap))


def test_both_sides_of_the_surface_agree_on_what_is_outside() -> None:
    """`area`, `solid-angle`, rays and irradiance ask one and the same question: rows at rounding distance
    never disagree.
    """
    rng = np.random.default_rng(6)
    out = rng.normal(size=(3, N))
    out /= np.sqrt(dot(out, out))
    center = np.array([0.3, -0.2, 0.9])
    light = light_of(center, 0.7)
    p = np.ascontiguousarray(center[:, None] + 0.7 * out * (1 + rng.choice([-1, 0, 1], N) * 2e-16))
    at, u = np.zeros(N, dtype=np.int64), rng.random((2, N))
    outside = light.cone(at, p).outside
    assert 0.1 < outside.mean() < 0.9
    s = light.techniques["solid-angle"].sample_direction(at, p, out, u)
    assert not s.valid[~outside].any() and s.valid[outside].all()
    assert not light.techniques["area"].sample_direction(at, p, out, u).valid[~outside].any()
    assert (light.intersect(at, p, -out)[0][~outside] == np.inf).all()
    e = light.irradiance(at, p, -out)[2]
    assert (e[~outside] == 0).all()
    np.testing.assert_allclose(e[outside], np.pi, rtol=1e-14)


_COORDINATE = st.floats(-3, 3, allow_nan=False)
_VECTOR = st.tuples(_COORDINATE, _COORDINATE, _COORDINATE).map(np.array)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(_VECTOR, st.floats(1e-6, 3), _VECTOR, st.floats(-6, 6), st.booleans())
def test_any_sphere_from_anywhere(center, radius, p, exponent, two_sided) -> None:
    """pdf >= 0, the same when asked, exact, and the samples land on the sphere; at scales of 1e-6 to 1e6."""
    scale = 10.0**exponent
    d = float(np.linalg.norm(p - center))
    assume(abs(d - radius) > 1e-6)
    light = light_of(center * scale, radius * scale, two_sided=two_sided)
    s, asked, _ = draw(light, p * scale)
    assert s.valid.all() if d > radius or two_sided else not s.valid.any()
    assert (asked >= 0).all()
    if not s.valid.any():
        assert (asked == 0).all()
        return
    assert (asked > 0).mean() > 0.99
    np.testing.assert_allclose(asked[asked > 0], s.pdf[asked > 0], rtol=1e-15)
    truth = 4 * np.pi if d < radius else float(exact_solid_angle(d, radius))
    # The distance is known to 1e-15; next to the surface the cone's cosine is the root of that.
    assert 1 / s.pdf[0] == pytest.approx(
        truth, rel=1e-13 + 1e-14 / abs(d - radius) ** 0.5 + 4e-15 * d / radius
    )
    landed = (p[:, None] + s.wi * (s.dist / scale)) - center[:, None]
    np.testing.assert_allclose(np.sqrt(dot(landed, landed)), radius, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(s.normal * radius, landed, atol=1e-12)
