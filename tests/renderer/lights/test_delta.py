"""Point, spot and distant lights: one direction, its irradiance by hand and by fifty digits, and the ends of
the range of numbers.
"""

from __future__ import annotations

import dataclasses

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from renderer.interfaces.light import LIGHTS
from renderer.light_sampling.delta import TECHNIQUES
from renderer.records import LightSample
from scenes.description.lights import DistantLight, PointLight, SpotLight
from scenes.errors import Location, SceneError

RGB = np.array([3.0, 2.0, 1.0])
DOWN = np.array([0.0, 0.0, -1.0])
KINDS = {PointLight: LIGHTS["point"], SpotLight: LIGHTS["spot"], DistantLight: LIGHTS["distant"]}
POINT = PointLight(np.array([0.0, 0.0, 2.0]), RGB)
SPOT = SpotLight(np.array([0.0, 0.0, 2.0]), DOWN, RGB, 60.0, 30.0)
DISTANT = DistantLight(np.array([0.6, 0.0, 0.8]), RGB)


def lights(*sources):
    return KINDS[type(sources[0])].make(sources, range(len(sources)))


def sample(light, *points, technique: str = "area") -> LightSample:
    p = np.array(points, dtype=np.float64).T.copy()
    n = p.shape[1]
    up = np.repeat([[0.0], [0.0], [1.0]], n, axis=1)
    return light.techniques[technique].sample_direction(
        np.zeros(n, dtype=np.int64), p, up, np.full((2, n), 0.3)
    )


def test_a_point_light_by_hand():
    """2 above the origin: I/4; seen from (3, 0, -2), 5 away: I/25."""
    s = sample(lights(POINT), (0, 0, 0), (3, 0, -2))
    assert s.valid.all() and (s.pdf == 1).all()
    np.testing.assert_allclose(s.wi.T, [(0, 0, 1), (-0.6, 0, 0.8)], atol=1e-16)
    np.testing.assert_allclose(s.dist, [2, 5], rtol=1e-15)
    np.testing.assert_allclose(s.radiance.T, [RGB / 4, RGB / 25], rtol=1e-15)
    assert np.array_equal(s.normal, -s.wi)


def test_a_distant_light_is_the_same_everywhere():
    s = sample(lights(DISTANT), (0, 0, 0), (1e7, -3, 5))
    assert s.valid.all() and np.isinf(s.dist).all()
    np.testing.assert_allclose(s.wi.T, [DISTANT.wi] * 2, rtol=1e-15)
    assert (s.radiance == RGB[:, None]).all()


def test_a_spot_light_by_hand():
    """Full inside 30 degrees, nothing beyond 60; half where the cosine is halfway between theirs, at 46.9
    degrees.
    """
    middle = np.arccos((np.cos(np.pi / 3) + np.cos(np.pi / 6)) / 2)
    angle = np.array([0, 29.9, np.degrees(middle), 59.9, 60.1, 120, 180])
    points = [(np.sin(a), 0, 2 - np.cos(a)) for a in np.radians(angle)]
    s = sample(lights(SPOT), *points)
    assert s.valid.tolist() == [True] * 4 + [False] * 3
    np.testing.assert_allclose(s.radiance[0, :3], [3, 3, 1.5], rtol=1e-12)
    assert 0 < s.radiance[0, 3] < 1e-3


@given(st.floats(-4, 2.25), st.floats(0, 0.999), st.floats(0, 1.2))
def test_the_fade_against_fifty_digits(log_cone: float, start: float, at: float):
    """pbrt's smoothstep of the cosine, cones from 1e-4 to 178 degrees: with the cosines themselves a cone of
    1e-4 would fade in steps.

    1e-9 of full, where t is conditioned: for the narrowest, the direction's own rounding (1e-16 of an angle
    of 1e-6) is what remains.
    """
    cone = float(10**log_cone)
    light = lights(SpotLight(np.zeros(3), DOWN, np.ones(3), cone, cone * start))
    angle = min(np.radians(cone * at), np.pi)
    s = sample(light, (np.sin(angle), 0, -np.cos(angle)))
    with mpmath.workdps(50):
        x, z = mpmath.mpf(float(np.sin(angle))), mpmath.mpf(float(np.cos(angle)))
        edge, full = (mpmath.cos(mpmath.radians(mpmath.mpf(a))) for a in (cone, cone * start))
        t = (z / mpmath.sqrt(x * x + z * z) - edge) / (full - edge)
        t = min(max(t, mpmath.mpf(0)), mpmath.mpf(1))
        exact = float(t * t * (3 - 2 * t))
    got = s.radiance[0, 0] if s.valid[0] else 0.0
    assert got == pytest.approx(exact, abs=1e-9 / (1 - start))


def test_a_spot_light_without_a_fade_has_an_edge():
    light = lights(dataclasses.replace(SPOT, falloff_start=60.0))
    points = [(np.sin(a), 0, 2 - np.cos(a)) for a in np.radians([0, 59.999, 60.001])]
    assert sample(light, *points).radiance[0].tolist() == pytest.approx([3, 3, 0])
    whole = lights(dataclasses.replace(SPOT, cone=180.0, falloff_start=180.0))
    assert sample(whole, (0, 0, 1), (0, 0, 3)).valid.all()


@pytest.mark.parametrize("source", [POINT, SPOT, DISTANT])
def test_every_technique_is_the_same_and_chance_never_finds_the_light(source):
    light, kind = lights(source), KINDS[type(source)]
    assert set(light.techniques) == set(TECHNIQUES)
    assert kind.delta and light.parts.share.tolist() == [1]
    assert all(kind.missing(t) is None for t in TECHNIQUES) and kind.missing("other")
    first = sample(light, (0.3, 0.1, 0))
    for technique in TECHNIQUES:
        s = sample(light, (0.3, 0.1, 0), technique=technique)
        assert np.array_equal(s.wi, first.wi) and np.array_equal(s.radiance, first.radiance)
        p = np.array([[0.3], [0.1], [0.0]])
        assert light.techniques[technique].pdf_direction(np.zeros(1, dtype=np.int64), p, p, s.wi) == [0]


@pytest.mark.parametrize("source", [POINT, SPOT, DISTANT])
def test_irradiance_is_that_of_the_sample(source):
    """E cos above the horizon, 0 below it and at the light itself: never NaN."""
    light = lights(source)
    p = np.array([[0.5, 0.0, 0.0, -1.0], [0.2, 0.0, 0.0, 4.0], [0.0, 0.0, 2.0, 1.9]])
    for normal in Rotation.random(20, random_state=np.random.default_rng(1)).as_matrix()[:, :, :1]:
        n = normal.repeat(4, axis=1)
        at = np.zeros(4, dtype=np.int64)
        s = light.techniques["area"].sample_direction(at, p, n, np.zeros((2, 4)))
        cosine = np.where(s.valid, (s.wi * n).sum(axis=0), 0)
        expected = np.where(cosine > 0, cosine * np.where(s.valid, s.radiance, 0), 0)
        np.testing.assert_allclose(light.irradiance(at, p, n), expected, rtol=1e-13)


@given(st.integers(-307, 307), st.integers(-300, 300))
def test_at_the_ends_of_the_range_of_numbers(size: int, power: int):
    """Whatever the scale, what is valid is finite, of unit direction, and right to 1e-12; nothing warns."""
    d, intensity = float(10.0**size), float(10.0**power)
    for source in (
        PointLight(np.array([0.6 * d, 0.0, 0.8 * d]), intensity * RGB),
        SpotLight(np.array([0.6 * d, 0.0, 0.8 * d]), np.array([-0.6, 0.0, -0.8]), intensity * RGB, 1.0, 0.5),
    ):
        s = sample(lights(source), (0, 0, 0))
        expected = power - 2 * size
        if s.valid[0]:
            assert np.isfinite(s.radiance).all()
            np.testing.assert_allclose(s.wi[:, 0], [0.6, 0, 0.8], atol=1e-15)
            assert s.dist[0] == pytest.approx(d, rel=1e-14)
            if expected > -300:
                np.testing.assert_allclose(s.radiance[0, 0] / 3 / 10.0**expected, 1, rtol=1e-12)
        else:
            assert expected > 306 or expected < -306


def test_at_the_light_itself_nothing_is_valid():
    for source in (POINT, SPOT):
        assert sample(lights(source), (0, 0, 2), (0, 0, 2 - 1e-15)).valid.tolist() == [False, True]


@pytest.mark.parametrize("source", [POINT, SPOT, DISTANT])
def test_a_black_light_is_never_valid(source):
    name = "irradiance" if source is DISTANT else "intensity"
    assert not sample(lights(dataclasses.replace(source, **{name: np.zeros(3)})), (0, 0, 0)).valid.any()


@given(st.integers(0, 2**32), st.floats(-6, 7))
def test_moving_turning_and_scaling_a_spot_light_moves_turns_and_scales_what_it_gives(
    seed: int, log_scale: float
):
    """Coordinates from 1e-6 to 1e7: E goes with the inverse square.

    To 1e-9 off the edge, where rounding of points shows.
    """
    rng = np.random.default_rng(seed)
    turn, scale = Rotation.random(random_state=rng).as_matrix(), float(10**log_scale)
    points = rng.uniform(-1, 1, (20, 3))
    shift = rng.uniform(-1, 1, 3)
    a = sample(lights(SPOT), *points)
    moved = dataclasses.replace(SPOT, position=scale * (turn @ SPOT.position + shift), axis=turn @ SPOT.axis)
    b = sample(lights(moved), *(scale * (points @ turn.T + shift)))
    sure = np.where(a.valid, a.radiance[0] * a.dist**2, 0) > 1e-6
    assert b.valid[sure].all()
    np.testing.assert_allclose(b.radiance[:, sure] * scale * scale, a.radiance[:, sure], rtol=1e-8)


def test_lights_side_by_side_keep_their_own():
    other = dataclasses.replace(
        SPOT, position=np.array([1.0, 0, 4]), intensity=2 * RGB, cone=20.0, falloff_start=5.0
    )
    both = LIGHTS["spot"].make([SPOT, other], [4, 9])
    assert both.parts.source.tolist() == [4, 9]
    p = np.array([[0.1, 1.1], [0.2, 0.1], [0.0, 0.0]])
    s = both.techniques["area"].sample_direction(np.array([0, 1]), p, p, np.zeros((2, 2)))
    for j, source in enumerate((SPOT, other)):
        one = sample(lights(source), p[:, j])
        assert np.array_equal(s.wi[:, j], one.wi[:, 0]) and np.array_equal(
            s.radiance[:, j], one.radiance[:, 0]
        )


@pytest.mark.parametrize(
    ("source", "change", "message"),
    [
        (
            POINT,
            {"intensity": -RGB},
            "a point light's intensity must be finite and not negative, not -3, -2, -1",
        ),
        (POINT, {"position": np.array([0, np.nan, 0])}, "a point light's position must be finite"),
        (SPOT, {"intensity": np.array([1, np.inf, 1])}, "a spot light's intensity must be finite"),
        (SPOT, {"cone": 20.0}, "a spot light's cone is 20 degrees and its falloff starts at 30"),
        (SPOT, {"cone": 181.0}, "allowed is 0 <= start <= cone <= 180"),
        (SPOT, {"falloff_start": np.nan}, "falloff starts at nan"),
        (SPOT, {"axis": np.zeros(3)}, "a spot light's axis must not be zero"),
        (DISTANT, {"wi": np.zeros(3)}, "a distant light's direction must not be zero"),
        (DISTANT, {"irradiance": -RGB}, "a distant light's irradiance must be finite and not negative"),
    ],
)
def test_what_is_no_light_is_an_error_with_its_place(source, change, message):
    with pytest.raises(SceneError, match=f"^sky.pbrt:4:1: .*{message}"):
        lights(dataclasses.replace(source, where=Location("sky.pbrt", 4, 1), **change))
