"""Portals against the closed form of a rectangle and against the masked sky, and skies that add up."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.references.closed_form.radiometry import polygon_irradiance
from renderer.build import build
from renderer.interfaces.light import LIGHTS
from renderer.light_sampling.surroundings import SumOfSurroundings
from renderer.lights.environment import EnvironmentLights
from renderer.lights.portal import PortalLights
from renderer.math.piecewise import WindowedPiecewiseConstant2D
from renderer.spherical.octahedral import square_to_sphere
from scenes.description.lights import Environment, Light, PortalLight
from scenes.errors import SceneError
from tests.kit.scenes import floor, reflect, scene

RGB = np.array([3.0, 2.0, 1.0])
# Above the floor, turned about y, as one looks out upwards.
CORNERS = np.array([[1.0, 2, -0.5], [1.3, 2, 1.0], [-0.7, 2, 1.4], [-1.0, 2, -0.1]])
POINTS = np.array([[0.0, 0, 0], [2.0, 0, -1.0], [-3.0, 0, 2.0]])
UP = np.array([0.0, 1.0, 0.0])
TURN = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()


def portal(sky: Environment) -> PortalLights:
    return PortalLights.make([PortalLight(sky, CORNERS)], [0])


def lit_floor(*lights: Light):
    return build(dataclasses.replace(scene([floor(20.0)]), lights=lights))


def smooth(w: np.ndarray) -> np.ndarray:
    """A sky (3, n) without edges, of slope 1.5 at most, in units of its mean."""
    return 1 + 0.5 * np.sin(np.stack([2 * w[0] + w[1], 3 * w[2], w[0] - 2 * w[1]]))


def sky_of(size: int) -> Environment:
    middle = (np.arange(size) + 0.5) / size
    w = square_to_sphere(np.stack([np.tile(middle, size), middle.repeat(size)]))
    return Environment(np.ones(3), smooth(w).T.reshape(size, size, 3), frame=TURN)


@pytest.mark.parametrize("estimator", ["solid-angle", "environment", "mis", "cosine", "bsdf"])
def test_a_constant_sky_through_a_portal_is_a_rectangle_of_its_radiance(estimator: str):
    """0.5/pi times the polygon's irradiance in closed form, within 4.5 errors of at most 1.5 %."""
    truth = 0.5 / np.pi * polygon_irradiance(POINTS, UP, CORNERS, RGB)
    if truth.max() == 0:
        truth = 0.5 / np.pi * polygon_irradiance(POINTS, UP, CORNERS[::-1], RGB)
    spp = 60_000 if estimator in ("cosine", "bsdf") else 2000
    built = lit_floor(PortalLight(Environment(RGB), CORNERS))
    mean, error = reflect(built, POINTS, UP, 0, estimator, spp)
    assert (error < 0.05 * truth).all() and truth.min() > 0
    assert (np.abs(mean - truth) <= 4.5 * error + 1e-12).all()


def test_the_sky_through_a_portal_is_the_sky_masked_by_the_portal():
    """Towards random directions: the ray's own intersection with the rectangle decides.

    The resampled texels are pi/256 wide at most, and the sky's slope is 1.5: their middles are off by 0.02.
    """
    light, n = portal(sky_of(256)), 20_000
    rng = np.random.default_rng(3)
    wi = rng.normal(size=(3, n))
    wi /= np.linalg.norm(wi, axis=0)
    p = rng.uniform(-2, 3, (3, n))
    got = light.radiance_along(np.zeros(n, dtype=np.int64), p, wi)
    t = (2 - p[1]) / wi[1]
    at = p + t * wi - CORNERS[0][:, None]
    across, up = CORNERS[3] - CORNERS[0], CORNERS[1] - CORNERS[0]
    inside = (t > 0) & (wi[1] > 0)
    for edge in (across, up):
        share = edge @ at / (edge @ edge)
        inside &= (share > 0) & (share < 1)
    want = np.where(inside, smooth(TURN.T @ wi), 0.0)
    assert 0.01 < inside.mean() < 0.5
    assert np.array_equal(got.any(axis=0), inside)
    assert np.abs(got - want).max() < 0.03


def test_a_portal_seen_from_behind_is_dark():
    light = portal(Environment(RGB))
    p, wi = np.array([[0.0], [3.0], [0.5]]), np.array([[0.0], [-1.0], [0.0]])
    at = np.zeros(1, dtype=np.int64)
    assert not light.radiance_along(at, p, wi).any()
    for technique in light.techniques.values():
        assert not technique.sample_direction(at, p, p, np.full((2, 1), 0.5)).valid.any()
        assert technique.pdf_direction(at, p, p, wi) == [0]


def test_a_window_deals_out_its_own_share_of_each_cell():
    """A cell of 100 and cells of 0 among others, windows that cut them: counts of a fine grid of u against
    areas times values, to the 2 cells of u that an edge may cut along each side.
    """
    rng = np.random.default_rng(2)
    values = rng.random((6, 6))
    values[2, 3], values[4] = 100.0, 0.0
    texels = WindowedPiecewiseConstant2D.of([values, np.ones((1, 1))])
    m = 400
    u = np.stack([v.ravel() for v in np.meshgrid((np.arange(m) + 0.5) / m, (np.arange(m) + 0.5) / m)])
    for low, high in (([0.0, 0.0], [1.0, 1.0]), ([0.21, 0.3], [0.83, 0.97]), ([0.05, 0.05], [0.1, 0.06])):
        ends = [np.repeat(np.array(end)[:, None], u.shape[1], axis=1) for end in (low, high)]
        index = np.zeros(u.shape[1], dtype=np.int64)
        place, density = texels.sample(index, *ends, u)
        assert (place >= ends[0]).all() and (place <= ends[1]).all() and (density > 0).all()
        column, row = np.minimum((place * 6).astype(int), 5)
        found = np.bincount(row * 6 + column, minlength=36).reshape(6, 6) / m**2
        edges = np.arange(7) / 6
        x, y = (np.diff(np.clip(edges, low[i], high[i])) for i in range(2))
        mass = values * x * y[:, None]
        np.testing.assert_allclose(found, mass / mass.sum(), atol=2 / m)
        np.testing.assert_allclose(density, values[row, column] / mass.sum(), rtol=1e-12)


def test_a_window_over_black_is_not_sampled():
    texels = WindowedPiecewiseConstant2D.of([np.diag([0.0, 1.0])])
    low, high = np.zeros((2, 1)), np.full((2, 1), 0.4)
    assert texels.sample(np.zeros(1, dtype=np.int64), low, high, np.full((2, 1), 0.5))[1] == [0]


SKIES = (
    Environment(RGB, 1 + np.arange(48.0).reshape(4, 4, 3) % 7, frame=TURN),
    Environment(RGB, np.eye(4)[:, :, None] * [30.0, 20.0, 40.0]),
    Environment(np.array([0.0, 0.0, 9.0]), frame=TURN, hemisphere=True),
    PortalLight(Environment(30 * RGB), CORNERS),
)


def test_skies_add_up_in_every_direction():
    built = lit_floor(*SKIES)
    assert built.lights.environment is not None
    around, number = built.lights.environment
    assert (len(built.lights), number, built.lights.pmf.tolist()) == (1, 0, [1.0])
    n = 4000
    rng = np.random.default_rng(1)
    wi, p = rng.normal(size=(3, n)), rng.uniform(-3, 3, (3, n))
    wi /= np.linalg.norm(wi, axis=0)
    at = np.zeros(n, dtype=np.int64)
    alone = [EnvironmentLights.make([sky], [0]).radiance_along(at, p, wi) for sky in SKIES[:3]]
    alone.append(PortalLights.make([SKIES[3]], [0]).radiance_along(at, p, wi))
    np.testing.assert_allclose(around.radiance_along(at, p, wi), sum(alone), rtol=1e-14)


@pytest.mark.parametrize("technique", ["solid-angle", "environment", "environment-compensated"])
def test_the_density_of_several_skies_is_the_one_that_they_are_sampled_by(technique: str):
    """sum over samples of g/pdf for g = 1 + x y is its integral over where the pdf is above 0.

    A chance left out of the density, or one sky's density alone, is off by a third; 4.5 errors are 3 %.
    """
    groups = [EnvironmentLights.make(SKIES[:3], [0, 1, 2]), PortalLights.make(SKIES[3:], [3])]
    around = SumOfSurroundings.of(groups)
    assert around.chance.sum() == pytest.approx(1) and (around.chance > 0.01).all()
    sampler, n = around.techniques[technique], 100_000
    u = np.random.default_rng(4).random((2, n))
    p, at = np.repeat(POINTS[:1].T, n, axis=1), np.zeros(n, dtype=np.int64)
    s = sampler.sample_direction(at, p, p, u)
    asked = sampler.pdf_direction(at, p, p, s.wi)
    # On an edge of a texel the two may take different sides.
    assert (np.abs(asked / s.pdf - 1) < 1e-9)[s.valid].mean() > 0.99
    np.testing.assert_array_equal(s.valid, True)
    value = (1 + s.wi[0] * s.wi[1]) / s.pdf
    uniform = np.random.default_rng(5).normal(size=(3, n))
    uniform /= np.linalg.norm(uniform, axis=0)
    inside = sampler.pdf_direction(at, p, p, uniform) > 0
    other = 4 * np.pi * inside * (1 + uniform[0] * uniform[1])
    error = np.hypot(value.std(), other.std()) / np.sqrt(n)
    assert error < 0.01 * other.mean()
    assert abs(value.mean() - other.mean()) < 4.5 * error


@pytest.mark.parametrize("estimator", ["solid-angle", "environment", "mis", "mis-compensated", "bsdf"])
def test_a_floor_under_several_skies_reflects_the_sum_of_what_each_sends(estimator: str):
    """Each alone and all together, independent estimates: each sky is 10 % of the sum somewhere, and 4.5
    errors are below 9 %.
    """
    mean, error = reflect(lit_floor(*SKIES), POINTS, UP, 0, estimator, 30_000)
    alone = each_alone()
    want = sum(m for m, _ in alone)
    assert all((m / want).max() > 0.1 for m, _ in alone)
    error = np.sqrt(error**2 + sum(e**2 for _, e in alone))
    assert (error < 0.02 * want).all()
    assert (np.abs(mean - want) < 4.5 * error).all()


@cache
def each_alone() -> list[tuple[np.ndarray, np.ndarray]]:
    return [reflect(lit_floor(sky), POINTS, UP, 0, "mis", 20_000, seed=7 + i) for i, sky in enumerate(SKIES)]


def test_one_sky_is_itself():
    """No mixture where nothing has to be mixed: the bits of scenes with one sky stay."""
    built = lit_floor(SKIES[0])
    assert isinstance(built.lights.kinds[0], EnvironmentLights)


@pytest.mark.parametrize(
    ("sky", "words"),
    [
        (Environment(RGB, hemisphere=True), "whole"),
        (Environment(RGB, np.ones((2, 4, 3)), "latitude-longitude"), "mapping"),
        (Environment(RGB, np.ones((2, 4, 3))), "square"),
        (Environment(-RGB), "not negative"),
    ],
)
def test_skies_that_no_portal_has(sky: Environment, words: str):
    with pytest.raises(SceneError, match=words):
        LIGHTS["portal"].make([PortalLight(sky, CORNERS)], [0])


def test_portals_are_pbrt_s() -> None:
    """PortalImageInfiniteLight of src/pbrt/lights.h and lights.cpp, by its own formulas, point by point.

    Catches a frame whose axes are swapped, a window from the wrong corners, weights at texels' corners, and a
    density without the Jacobian: each is off by more than 1 % somewhere.
    """
    n = 32
    sky = sky_of(n)
    lights = portal(sky)
    x, y = (CORNERS[i] - CORNERS[0] for i in (3, 1))  # Frame::FromXY(p03, p01)
    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    z = np.cross(x, y)

    def render_from_image(u: float, v: float) -> tuple[np.ndarray, float]:
        w = np.array([np.tan(np.pi * (u - 0.5)), np.tan(np.pi * (v - 0.5)), 1.0])
        w /= np.linalg.norm(w)
        return w[0] * x + w[1] * y + w[2] * z, np.pi**2 * (1 - w[0] ** 2) * (1 - w[1] ** 2) / w[2]

    def image_from_render(w: np.ndarray) -> np.ndarray:
        return 0.5 + np.array([np.arctan2(w @ x, w @ z), np.arctan2(w @ y, w @ z)]) / np.pi

    middle = (np.arange(n) + 0.5) / n
    texels = np.array(
        [[smooth(TURN.T @ render_from_image(u, v)[0][:, None])[:, 0] for u in middle] for v in middle]
    )
    weights = np.array([[lights.radiance[n * j + i].mean() * render_from_image(u, v)[1]
                         for i, u in enumerate(middle)] for j, v in enumerate(middle)])  # fmt: skip
    # Between texels of a smooth sky, and across edges of its map: axes swapped would be off by up to 1.
    np.testing.assert_allclose(lights.radiance.reshape(n, n, 3), texels, atol=0.1)
    p = POINTS[0]
    low, high = (image_from_render(CORNERS[i] - p) for i in (0, 2))
    edges = np.arange(n + 1) / n
    share = [
        np.diff(np.clip(edges, low[i], high[i])) * n for i in range(2)
    ]  # of each texel inside the window
    total = (weights * share[1][:, None] * share[0]).sum() / n**2
    technique = lights.techniques["environment"]
    for place in low + (high - low) * np.random.default_rng(4).random((40, 2)):
        w, stretch = render_from_image(*place)
        i, j = (np.minimum(place * n, n - 1)).astype(int)
        row = np.zeros(1, dtype=np.int64)
        seen = lights.radiance_along(row, p[:, None], w[:, None])[:, 0]
        np.testing.assert_allclose(seen, lights.radiance[n * j + i], rtol=1e-12)
        pdf = technique.pdf_direction(row, p[:, None], UP[:, None], w[:, None])[0]
        np.testing.assert_allclose(pdf, weights[j, i] / total / stretch, rtol=1e-9)
    outside, _ = render_from_image(*(high + 0.01))
    assert not lights.radiance_along(np.zeros(1, dtype=np.int64), p[:, None], outside[:, None]).any()
