"""Environments: what shines from where, against pbrt's look-up written out again; sampling against what
shines.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from renderer.interfaces.light import LIGHTS
from renderer.lights.environment import EnvironmentLights
from scenes.description.lights import Environment

pytestmark = pytest.mark.usefixtures("thorough")

ONE = np.ones(3)
POLAR = "latitude-longitude"
TECHNIQUES = ("solid-angle", "environment", "environment-compensated")


def lights(*environments: Environment) -> EnvironmentLights:
    return EnvironmentLights.make(environments, range(len(environments)))


def zeros(n: int) -> np.ndarray:
    return np.zeros(n, dtype=np.int64)


def sample(light: EnvironmentLights, technique: str, count: int, seed: int = 1):
    u = np.random.default_rng(seed).random((2, count))
    return light.techniques[technique].sample_direction(
        zeros(count), np.zeros((3, count)), np.ones((3, count)), u
    )


def pdf(light: EnvironmentLights, technique: str, wi: np.ndarray) -> np.ndarray:
    n = wi.shape[1]
    return light.techniques[technique].pdf_direction(zeros(n), np.zeros((3, n)), np.ones((3, n)), wi)


def seen(light: EnvironmentLights, wi: np.ndarray) -> np.ndarray:
    return light.radiance_along(zeros(wi.shape[1]), np.zeros((3, 1)), wi)


def sphere_grid(n: int) -> tuple[np.ndarray, float]:
    """Midpoints of n by 2n cells of equal solid angle in z and the angle, and that solid angle."""
    z = (np.arange(n) + 0.5) / n * 2 - 1
    angle = (np.arange(2 * n) + 0.5) / n * np.pi
    z, angle = (a.reshape(-1) for a in np.meshgrid(z, angle))
    sine = np.sqrt(1 - z * z)
    return np.stack([sine * np.cos(angle), sine * np.sin(angle), z]), 4 * np.pi / (2 * n * n)


def texel_of(w: np.ndarray, shape: tuple[int, ...], mapping: str) -> tuple[np.ndarray, np.ndarray]:
    """Row and column that directions fall on: pbrt's EqualAreaSphereToSquare and nearest look-up, or the
    description's definition.
    """
    x, y, z = w
    if mapping == POLAR:
        down, along = np.arccos(z) / np.pi, np.arctan2(y, x) / (2 * np.pi) % 1
    else:
        r = np.sqrt(1 - np.abs(z))
        v = np.arctan2(np.abs(y), np.abs(x)) * 2 / np.pi * r
        u = r - v
        u, v = np.where(z < 0, 1 - v, u), np.where(z < 0, 1 - u, v)
        along, down = 0.5 * (np.copysign(u, x) + 1), 0.5 * (np.copysign(v, y) + 1)
    return tuple(
        np.minimum((a * n).astype(int), n - 1) for a, n in zip((down, along), shape[:2], strict=True)
    )


def an_image(shape: tuple[int, int], seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).exponential(size=(*shape, 3)) * np.array([1.0, 0.5, 0.2])


MAPS = [
    pytest.param(Environment(ONE, an_image((8, 8))), id="octahedral"),
    pytest.param(Environment(ONE, an_image((7, 7))), id="octahedral-odd"),
    pytest.param(Environment(ONE, an_image((8, 12)), POLAR), id="latitude-longitude"),
    pytest.param(Environment(ONE, an_image((5, 4)), POLAR), id="latitude-longitude-odd"),
    pytest.param(Environment(ONE, an_image((8, 8)), hemisphere=True), id="half-octahedral"),
    pytest.param(Environment(ONE, an_image((3, 3)), hemisphere=True), id="half-octahedral-odd"),
    pytest.param(
        Environment(ONE, an_image((5, 4)), POLAR, hemisphere=True), id="half-latitude-longitude-odd"
    ),
    pytest.param(Environment(ONE), id="constant"),
    pytest.param(Environment(ONE, hemisphere=True), id="half-constant"),
]


@pytest.mark.parametrize(
    ("row", "column", "size", "direction"),
    [
        (0, 0, 2, (-np.sqrt(0.5), -np.sqrt(0.5), 0)),
        (1, 2, 4, (0.5 * np.sqrt(0.875), -0.5 * np.sqrt(0.875), 0.75)),
        (0, 3, 4, (0.5 * np.sqrt(0.875), -0.5 * np.sqrt(0.875), -0.75)),
        (3, 1, 4, (-np.cos(np.pi * 3 / 8), np.sin(np.pi * 3 / 8), 0)),
        (1, 1, 3, (0, 0, 1)),
    ],
)
def test_one_bright_texel_is_where_pbrt_has_it(row, column, size, direction):
    """The middle of the texel by hand from pbrt's formulas: catches rows read upwards, swapped axes, another
    pole.
    """
    image = np.zeros((size, size, 3))
    image[row, column] = [5, 6, 7]
    light = lights(Environment(2 * ONE, image))
    wi = np.array(direction, dtype=float)[:, None]
    assert seen(light, wi)[:, 0].tolist() == [10, 12, 14]
    assert pdf(light, "environment", wi)[0] == pytest.approx(size * size / (4 * np.pi), rel=1e-14)
    s = sample(light, "environment", 2000)
    assert s.valid.all() and (s.radiance == np.array([[10], [12], [14]])).all()
    np.testing.assert_allclose(
        s.wi.mean(axis=1) / np.sqrt((s.wi.mean(axis=1) ** 2).sum()), direction, atol=0.15
    )


def test_the_frame_has_the_light_axes_in_its_columns():
    image = np.zeros((3, 3, 3))
    image[1, 1] = 1  # about the light's own +z
    frame = np.stack([[0, 1, 0], [0, 0, 1], [1, 0, 0]], axis=1).astype(float)
    assert seen(lights(Environment(ONE, image, frame=frame)), np.eye(3)).tolist() == [[1, 0, 0]] * 3


@pytest.mark.parametrize("environment", MAPS)
def test_rays_see_the_nearest_texel(environment: Environment):
    """At 20,000 directions, those within 1e-6 of an edge aside."""
    image = np.ones((1, 1, 3)) if environment.image is None else environment.image
    wi = sample(lights(Environment(ONE)), "solid-angle", 20_000, seed=9).wi
    expected = image[texel_of(wi, image.shape, environment.mapping)].T
    if environment.hemisphere:
        expected = np.where(wi[2] > 0, expected, 0)
    differs = (seen(lights(environment), wi) != expected).any(axis=0)
    assert differs.mean() < 2e-4


@pytest.mark.parametrize("technique", TECHNIQUES)
@pytest.mark.parametrize("environment", MAPS)
def test_texels_are_sampled_in_proportion_to_what_they_give(environment: Environment, technique: str):
    """Chi-square at 0.01 % (27 cases) against brightness times solid angle, by 720,000 midpoints of the
    test's own.

    With 1e5 samples in up to 96 texels it catches a texel's chance that is off by some 10 %, a seam, a wrong
    half, a missing sine.
    """
    image = np.ones((1, 1, 3)) if environment.image is None else environment.image
    grid, cell = sphere_grid(600)
    row, column = texel_of(grid, image.shape, environment.mapping)
    above = grid[2] > 0 if environment.hemisphere else np.ones(grid.shape[1], dtype=bool)
    number = row * image.shape[1] + column
    omega = np.bincount(number, cell * above, minlength=image.shape[0] * image.shape[1])
    bright = image.mean(axis=2).reshape(-1)
    mean = (bright * omega).sum() / (4 * np.pi)
    weight = {
        "solid-angle": omega,
        "environment": bright * omega,
        "environment-compensated": np.maximum(bright - mean, 0) * omega,
    }[technique]
    weight = weight if weight.sum() > 1e-9 else omega
    expected = weight / weight.sum()
    count = 100_000
    s = sample(lights(environment), technique, count)
    assert s.valid.all() and (np.isinf(s.dist)).all() and np.array_equal(s.normal, -s.wi)
    row, column = texel_of(s.wi, image.shape, environment.mapping)
    observed = np.bincount(row * image.shape[1] + column, minlength=omega.size)
    big = expected * count > 10
    assert observed[expected == 0].sum() <= 3
    statistic = ((observed - expected * count)[big] ** 2 / (expected * count)[big]).sum()
    assert chi2.sf(statistic, max(big.sum() - 1, 1)) > 1e-4
    np.testing.assert_allclose(pdf(lights(environment), technique, s.wi), s.pdf, rtol=1e-12)


@pytest.mark.parametrize("technique", TECHNIQUES)
@pytest.mark.parametrize("environment", MAPS)
def test_pdfs_integrate_to_one(environment: Environment, technique: str):
    """By 720,000 midpoints, to 0.5 %: half of a texel lost or counted twice along a horizon would be 1 % and
    more.
    """
    grid, cell = sphere_grid(600)
    assert pdf(lights(environment), technique, grid).sum() * cell == pytest.approx(1, abs=5e-3)


@pytest.mark.parametrize("environment", MAPS)
def test_of_a_gray_map_every_sample_gives_the_whole(environment: Environment):
    """L / pdf of `environment` is the map's integral over the sphere, sample by sample, to 1e-12: no
    variance, no bias.
    """
    gray = None if environment.image is None else environment.image[:, :, :1].repeat(3, axis=2)
    half, mapping = environment.hemisphere, environment.mapping
    light = lights(Environment(ONE, gray, mapping, hemisphere=half))
    s = sample(light, "environment", 1000)
    whole = s.radiance / s.pdf
    np.testing.assert_allclose(whole, whole[0, 0], rtol=1e-12)
    grid, cell = sphere_grid(600)
    assert whole[0, 0] == pytest.approx(seen(light, grid)[0].sum() * cell, rel=5e-3)


def test_compensation_is_the_excess_over_the_mean():
    """max(0, L - mean) over its integral [karlik2019], the mean being the sphere's; 0 below it."""
    image = np.array([[1.0, 2.0], [3.0, 10.0]])[:, :, None].repeat(3, axis=2)
    wi = np.array([[-1, 1, -1, 1], [-1, -1, 1, 1], [0, 0, 0, 0]]) * np.sqrt(0.5)
    light = lights(Environment(ONE, image))
    np.testing.assert_allclose(
        pdf(light, "environment", wi), np.array([1, 2, 3, 10]) / (16 * np.pi), rtol=1e-14
    )
    np.testing.assert_allclose(
        pdf(light, "environment-compensated", wi), np.array([0, 0, 0, 1]) / np.pi, rtol=1e-14
    )


def test_compensated_and_uniform_sampling_combined_are_unbiased():
    """The balance heuristic over two techniques gives the map's integral within 4.5 standard errors (2 %)."""
    light = lights(MAPS[0].values[0])
    total = np.zeros((3, 50_000))
    for seed, technique in enumerate(TECHNIQUES[::2]):
        s = sample(light, technique, 50_000, seed)
        both = pdf(light, TECHNIQUES[0], s.wi) + pdf(light, TECHNIQUES[2], s.wi)
        total += np.where(s.valid, s.radiance / both, 0)
    exact = MAPS[0].values[0].image.mean(axis=(0, 1)) * 4 * np.pi
    error = total.std(axis=1) / np.sqrt(50_000)
    assert (np.abs(total.mean(axis=1) - exact) < 4.5 * error).all()
    assert (4.5 * error < 0.02 * exact).all()


def test_a_constant_image_falls_back_to_uniform():
    """Also where its texels differ by rounding: the excess over the mean would then be noise."""
    noise = 1 + 4e-16 * np.random.default_rng(1).integers(0, 2, (6, 6, 1)) * ONE
    for mapping in ("equal-area", POLAR):
        p = pdf(lights(Environment(ONE, noise, mapping)), "environment-compensated", sphere_grid(20)[0])
        np.testing.assert_allclose(p, 1 / (4 * np.pi), rtol=1e-12)


@pytest.mark.parametrize("technique", TECHNIQUES[1:])
def test_a_black_map_has_no_samples(technique: str):
    light = lights(Environment(ONE, np.zeros((4, 4, 3))))
    assert not sample(light, technique, 100).valid.any()
    assert (pdf(light, technique, sphere_grid(10)[0]) == 0).all()


@pytest.mark.parametrize("scale", [1e-300, 1.0, 1e300])
def test_a_sun_of_one_texel(scale: float):
    """1e6 over 0, and over a sky of 1e-9; at the ends of the range of numbers as well."""
    for sky in (0.0, 1e-9):
        image = np.full((64, 64, 3), sky * scale)
        image[10, 50] = 1e6 * scale
        for technique in TECHNIQUES[1:]:
            s = sample(lights(Environment(ONE, image)), technique, 1000)
            assert s.valid.all() and (s.radiance == 1e6 * scale).all()
            np.testing.assert_allclose(s.pdf, 64 * 64 / (4 * np.pi), rtol=1e-9)


@settings(max_examples=25)
@given(st.integers(0, 2**32), st.booleans(), st.sampled_from(TECHNIQUES))
def test_turning_or_mirroring_the_light_turns_its_directions(seed: int, mirror: bool, technique: str):
    """Density and radiance go with the frame; left-handed frames too."""
    frame = Rotation.random(random_state=np.random.default_rng(seed)).as_matrix() * [
        1,
        1,
        -1 if mirror else 1,
    ]
    still = Environment(ONE, an_image((9, 4)), POLAR, hemisphere=True)
    a, b = lights(still), lights(Environment(ONE, still.image, POLAR, frame, hemisphere=True))
    s, t = sample(a, technique, 50), sample(b, technique, 50)
    np.testing.assert_allclose(np.einsum("ij,jn->in", frame, s.wi), t.wi, atol=1e-14)
    assert np.array_equal(s.pdf, t.pdf) and np.array_equal(s.radiance, t.radiance)
    inside = np.abs(t.wi.T @ frame)[:, 2] > 1e-9
    assert np.array_equal(pdf(b, technique, t.wi)[inside], t.pdf[inside])
    assert np.array_equal(seen(b, t.wi)[:, inside], t.radiance[:, inside])


@pytest.mark.parametrize("hemisphere", [False, True])
def test_irradiance_of_a_constant_sky(hemisphere: bool):
    """pi L, or pi L (1 + cos t)/2 under a tilted half, against 720,000 midpoints to 0.2 %; sideways and from
    below as well.
    """
    axes = Rotation.from_euler("xyz", [20, 50, -30], degrees=True).as_matrix()
    light = lights(Environment(np.array([1.0, 2.0, 3.0]), frame=axes, hemisphere=hemisphere))
    grid, cell = sphere_grid(600)
    normals = np.stack([axes[:, 2], axes[:, 0], -axes[:, 2], [0.6, 0.0, 0.8], [0.0, -0.8, 0.6]], axis=1)
    exact = light.irradiance(zeros(5), np.zeros((3, 5)), normals)
    assert exact is not None
    for j in range(5):
        cosine = np.maximum(normals[:, j] @ grid, 0)
        np.testing.assert_allclose(
            exact[:, j], (seen(light, grid) * cosine).sum(axis=1) * cell, rtol=2e-3, atol=2e-3
        )


def test_irradiance_of_an_image_has_no_closed_form():
    light = lights(Environment(ONE), Environment(ONE, np.ones((2, 2, 3))))
    p = np.zeros((3, 1))
    assert light.irradiance(np.array([1]), p, p) is None
    assert light.irradiance(np.array([0]), p, p) is not None


def test_environments_side_by_side_change_no_bit():
    """Constant, octahedral, latitude-longitude, halves: each row as if its light were alone; and rows stand
    alone.
    """
    environments = [case.values[0] for case in MAPS[:7]]
    rng = np.random.default_rng(3)
    n = 300
    index, u, p = rng.integers(0, 7, n), rng.random((2, n)), np.zeros((3, n))
    many = lights(*environments)
    for technique in TECHNIQUES:
        s = many.techniques[technique].sample_direction(index, p, p, u)
        for k, environment in enumerate(environments):
            rows = np.flatnonzero(index == k)
            alone = lights(environment)
            o, at = p[:, rows], zeros(rows.size)
            t = alone.techniques[technique].sample_direction(at, o, o, u[:, rows])
            assert np.array_equal(s.wi[:, rows], t.wi) and np.array_equal(s.pdf[rows], t.pdf)
            assert np.array_equal(s.radiance[:, rows], t.radiance)
            assert np.array_equal(many.radiance_along(index[rows], np.zeros((3, 1)), t.wi), seen(alone, t.wi))


def test_what_is_missing_is_explained():
    kind = LIGHTS["environment"]
    for technique in ("area", "projected-solid-angle", "other"):
        assert kind.missing(technique)
    for case in MAPS:
        light = lights(case.values[0])
        assert set(light.techniques) == set(TECHNIQUES) == {t for t in TECHNIQUES if kind.missing(t) is None}
