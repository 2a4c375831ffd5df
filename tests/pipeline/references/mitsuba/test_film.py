"""Images on lights, and pixel filters, through Mitsuba against closed forms."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.special import erf  # pyright: ignore[reportMissingTypeStubs]

from pipeline.references.mitsuba.film import density, offsets
from pipeline.references.protocol import ReferenceRequest
from scenes.description.materials import Diffuse
from scenes.description.scene import Film, PixelFilter, SceneDescription
from scenes.description.shapes import Array, Emission, ShapeDescription
from scenes.description.textures import ImageTexture
from tests.kit.mitsuba_checks import BACKEND, picture, render
from tests.kit.mitsuba_scenes import above, floor, look_at, rectangle, scene, shape, vector
from tests.pipeline.references.mitsuba.test_surfaces import image_at

X, Y, Z = np.eye(3)
O = np.zeros(3)  # noqa: E741
IMAGE = np.random.default_rng(3).random((3, 2, 3)) * (1, 2, 3)
BLACK = Diffuse(np.zeros(3))


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.usefixtures("mitsuba")
def test_an_image_on_a_light_lies_as_pbrt_lays_it(reverse: bool):
    """Its first row at v = 1, u to the right and v up here, interpolated between the texels' centres and
    clamped beyond them.

    The mean error of a pixel is that of 4,096 samples; an image that is mirrored, or of nearest texels, is
    off by 0.1 and more on average.
    """
    light = rectangle(O, 0.9 * X, 0.9 * Y, not reverse)
    if reverse:  # seen from behind, where u runs to the left
        light = rectangle(O, -0.9 * X, 0.9 * Y, False)
    shown = ShapeDescription(light, BLACK, Emission(vector(1, 2, 3), image=IMAGE))
    camera = look_at(-5 * Z, O, Y)
    image = picture(scene([shown], camera, float(np.degrees(2 * np.arctan(0.9 / 5))), 6, 6), 4096)
    wanted = interpolated(60).reshape(6, 10, 6, 10, 3).mean(axis=(1, 3))
    wanted = wanted[:, ::-1] if reverse else wanted
    np.testing.assert_allclose(image, wanted, atol=0.03)
    assert np.abs(image - wanted).mean() < 0.005


def interpolated(size: int) -> Array:
    """IMAGE times the light's radiance at the middles of size x size parts of it, the first row at the top:
    (size, size, 3).
    """
    v, u = (np.mgrid[:size, :size] + 0.5) / size
    texture = ImageTexture(IMAGE, wrap="clamp")
    return image_at(texture, np.stack([u, 1 - v], axis=-1)) * (1, 2, 3)


def irradiance_of_polygon(corners: Array) -> float:
    a = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    b = np.roll(a, -1, axis=0)
    edge = np.cross(a, b)
    angle = np.arccos(np.clip(np.sum(a * b, axis=1), -1, 1))
    return abs(float(np.sum(angle * edge[:, 1] / np.linalg.norm(edge, axis=1)))) / 2


@pytest.mark.parametrize("two_sided", [False, True])
@pytest.mark.usefixtures("mitsuba")
def test_an_image_on_a_light_shines_as_it_looks(two_sided: bool):
    """Each of 30 x 30 parts a polygon of its own, by Lambert's formula; at 4 standard errors 0.4 % is caught,
    one texel amiss is 5 %.
    """
    corner, u, v = vector(-0.9, 1, -0.8), vector(1.5, 0.2, 0), vector(0, 0, 1.4)
    light = rectangle(corner + (u + v) / 2, u / 2, v / 2, reverse=True)
    light = dataclasses.replace(light, reverse=float(np.cross(u, v)[1]) > 0)
    shown = ShapeDescription(light, BLACK, Emission(vector(1, 2, 3), two_sided, IMAGE))
    value, error = render(scene([floor(), shown], *above(O, 0.01, 0.3)), 2**17)
    want = np.zeros(3)
    parts, n = interpolated(30), 30
    for row, column in np.ndindex(n, n):
        low = corner + column / n * u + (1 - (row + 1) / n) * v
        quad = np.stack([low, low + u / n, low + (u + v) / n, low + v / n])
        want += parts[row, column] * irradiance_of_polygon(quad) / (2 * np.pi)
    print(f"relative error {value / want - 1}, would have caught {(4 * error / want).max():.2%}")
    assert np.all(4 * error < 4e-3 * want)
    assert np.all(np.abs(value - want) < 4 * error + 2e-4 * want)


FILTERS = {
    "box": PixelFilter("box", 1.3, 0.8),
    "triangle": PixelFilter("triangle", 2.0, 1.1),
    "gaussian": PixelFilter("gaussian", 1.5, 2.0, 0.5),
    "wide gaussian": PixelFilter("gaussian", 2.0, 1.5, 3.0),
}


def cumulative(chosen: PixelFilter, radius: float, x: Array) -> Array:
    """The filter's integral from -radius to x over its whole, by pbrt's own formulas."""
    x = np.clip(x, -radius, radius)
    if chosen.kind == "box":
        return (x + radius) / (2 * radius)
    if chosen.kind == "triangle":
        return 0.5 + x / radius - np.sign(x) * x * x / (2 * radius**2)

    def integral(to: Array | float) -> Array | float:
        level = np.exp(-radius * radius / (2 * chosen.sigma**2))
        return chosen.sigma * np.sqrt(np.pi / 2) * erf(to / (np.sqrt(2) * chosen.sigma)) - to * level

    return (integral(x) / integral(radius) + 1) / 2


def edge(chosen: PixelFilter, along: int) -> SceneDescription:
    """A light that fills the view up to a straight edge a third of a pixel past the middle of a pixel of the
    middle column (or row).
    """
    reach, place = 50.0, (5 + 0.5 + 1 / 3 - 8) / 8  # of the half film, to the left or up
    axis, other = (X, Y) if along == 0 else (-Y, X)
    light = rectangle((place - reach) * axis, reach * axis, reach * other)
    both = dataclasses.replace(shape(light, 0.0), emission=Emission(np.ones(3), two_sided=True))
    given = scene([both], look_at(-Z, O, Y), 90.0, 16, 16)
    return dataclasses.replace(given, film=Film(16, 16, "", chosen))


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.usefixtures("mitsuba")
def test_an_edge_is_blurred_by_the_filter(name: str, along: int):
    """Pixel by pixel against the filter's integral: at 5 standard errors of 16 x 65,536 samples 0.3 % is
    caught.

    Mitsuba's own gaussian, which ends at four sigmas instead of 1.5 pixels, is 0.8 % off here; a shift by
    0.01 pixels is 0.8 %.
    """
    chosen = FILTERS[name]
    image = BACKEND.render(edge(chosen, along), ReferenceRequest(2**14)).mean[..., 0]
    profile = image.mean(axis=along)
    radius = chosen.xradius if along == 0 else chosen.yradius
    want = cumulative(chosen, radius, 5 + 0.5 + 1 / 3 - (np.arange(16) + 0.5))
    error = 5 * np.sqrt(want * (1 - want) / (2**14 * 16)) + 1e-5
    print(f"{name}: {np.abs(profile - want).max():.1e}, would have caught {error.max():.1e}")
    assert np.all(np.abs(profile - want) < error)


@pytest.mark.parametrize("name", FILTERS)
def test_offsets_are_the_filters_quantiles(name: str):
    chosen = FILTERS[name]
    for table, radius in zip(
        offsets(Film(1, 1, "", chosen)) or (), (chosen.xradius, chosen.yradius), strict=True
    ):
        np.testing.assert_allclose(
            cumulative(chosen, radius, table), np.linspace(0, 1, len(table)), atol=1e-8
        )
        assert density(chosen, radius, np.array([radius]))[0] == (1.0 if chosen.kind == "box" else 0.0)
    assert offsets(Film(1, 1)) is None
