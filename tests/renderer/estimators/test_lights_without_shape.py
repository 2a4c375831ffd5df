"""Environments, distant, point and spot lights, alone and with others, at exact points of a floor, by every
estimator.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.references.closed_form.radiometry import sphere_irradiance
from renderer import build
from renderer.interfaces.estimator import ESTIMATORS, RADIANCE
from scenes.description.lights import DistantLight, Environment, PointLight, SpotLight
from scenes.description.shapes import Sphere
from tests.kit.scenes import floor, light, reflect, scene

UP = np.array([0.0, 1.0, 0.0])
POINTS = np.array([[0.0, 0, 0], [0.7, 0, -0.4], [-1.5, 0, 1.0]])
RGB = np.array([3.0, 2.0, 1.0])
RHO = 0.5  # of the floor
WI = np.array([0.48, 0.6, 0.64])
AT = np.array([0.4, 1.5, -0.3])
# Half of the sky, tilted by 60 degrees: its own z axis is what it is about.
TILT = np.array([[1.0, 0, 0], [0, 0.5, np.sqrt(0.75)], [0, -np.sqrt(0.75), 0.5]])[:, [0, 2, 1]]


def point_light(p: np.ndarray) -> np.ndarray:
    away = AT - p
    d2 = (away**2).sum(axis=1)
    return away[:, 1] / d2**1.5


def spot_light(p: np.ndarray) -> np.ndarray:
    away = p - AT
    cosine = -away[:, 1] / np.linalg.norm(away, axis=1)  # of the angle off an axis that points down
    inner, outer = np.cos(np.radians([20.0, 50.0]))
    t = np.clip((cosine - outer) / (inner - outer), 0, 1)
    return point_light(p) * t * t * (3 - 2 * t)


CASES = {
    "constant": (Environment(RGB), lambda p: np.full(len(p), np.pi)),
    "hemisphere": (
        Environment(RGB, frame=TILT, hemisphere=True),
        lambda p: np.full(len(p), np.pi * (1 + TILT[1, 2]) / 2),
    ),
    "distant": (DistantLight(WI, RGB), lambda p: np.full(len(p), WI[1])),
    "point": (PointLight(AT, RGB), point_light),
    "spot": (SpotLight(AT, -UP, RGB, 50.0, 20.0), spot_light),
}
BALL = light(Sphere(np.array([-0.5, 2.0, 0.5]), 0.4), (1.0, 1.0, 1.0))


def applicable(given) -> list[str]:
    names = [n for n in ESTIMATORS.names() if ESTIMATORS[n].quantity == RADIANCE and not ESTIMATORS[n].ratio]
    return [n for n in names if not ESTIMATORS[n].refuses(given)]


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.usefixtures("statistical")
def test_every_estimator_gives_the_closed_form(case, mixed):
    """4.5 standard errors of at most 1 %, or the closed form to 1e-9 where there is no noise: 60 comparisons
    or so.
    """
    lamp, closed = CASES[case]
    given = replace(scene([floor(), *([BALL] if mixed else [])]), lights=(lamp,))
    truth = closed(POINTS)[:, None] * RGB * RHO / np.pi
    if mixed:
        truth = truth + (sphere_irradiance(POINTS, UP, BALL.geometry.center, 0.4) * RHO / np.pi)[:, None]
        if case in (
            "constant",
            "hemisphere",
        ):  # the ball hides what is behind it, though not all of it is sky
            truth = None
    names = applicable(given)
    assert {"hemisphere", "cosine", "bsdf", "mis", "solid-angle"} <= set(names)
    means, errors = [], []
    for name in names:
        mean, se = reflect(build(given), POINTS, UP, 0, name, 40_000)
        means.append(mean)
        errors.append(se)
        if truth is not None:
            assert np.all(np.abs(mean - truth) < 4.5 * se + 1e-9 * truth + 1e-15), name
            bound = 0.05 if name in ("hemisphere", "cosine", "bsdf") and mixed else 0.012
            assert np.all(se < bound * np.maximum(truth, 0.1)), name
    if truth is None:
        for mean, se, name in zip(means, errors, names, strict=True):
            assert np.all(np.abs(mean - means[0]) < 4.5 * np.hypot(se, errors[0])), name


def test_a_sky_with_one_sun_texel_is_found_by_importance_and_missed_by_chance():
    """E = L cos omega of the texel's 4 pi / 64^2 sr: 1e6 in one texel, 0 elsewhere.

    What never finds it must not be believed.
    """
    image = np.zeros((64, 64, 3))
    image[40, 20] = 1e6
    given = replace(scene([floor()]), lights=(Environment(np.ones(3), image),))
    built = build(given)
    kind, _ = built.lights.environment
    one = np.zeros(1, dtype=np.int64)
    sample = kind.techniques["environment"].sample_direction(
        one, np.zeros((3, 1)), UP[:, None], np.full((2, 1), 0.5)
    )
    if sample.wi[1, 0] < 0:
        given = replace(given, lights=(replace(given.lights[0], frame=np.diag([1.0, -1.0, 1.0])),))
        built = build(given)
    u = np.random.default_rng(3).random((2, 20_000))
    wi = (
        built.lights.environment[0]
        .techniques["environment"]
        .sample_direction(
            np.zeros(20_000, dtype=np.int64), np.zeros((3, 20_000)), np.repeat(UP[:, None], 20_000, 1), u
        )
        .wi
    )
    truth = 1e6 * wi[1].mean() * 4 * np.pi / 64**2 * RHO / np.pi
    for name in ("environment", "mis", "mis-balance", "mis-compensated"):
        mean, _ = reflect(built, POINTS, UP, 0, name, 20_000)
        np.testing.assert_allclose(mean, truth, rtol=2e-2 if name.startswith("mis") else 2e-3)


def test_an_environment_of_zeros_is_black_and_finite():
    for lamp in (Environment(np.zeros(3)), Environment(np.ones(3), np.zeros((8, 8, 3)))):
        built = build(replace(scene([floor()]), lights=(lamp,)))
        for name in applicable(built.description):
            mean, se = reflect(built, POINTS, UP, 0, name, 100)
            assert not mean.any() and not se.any(), name
