"""Closed-form images under lights that are no shapes: against Mitsuba and by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.references.backends.closed_form import ClosedFormBackend
from pipeline.references.backends.mitsuba import MitsubaBackend
from pipeline.references.protocol import Quantity, ReferenceRequest
from pipeline.statistics.welch import Moments, compare_images
from scenes.description.lights import DistantLight, Environment, Light, PointLight, SpotLight
from scenes.description.materials import Diffuse
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Array, ShapeDescription, Sphere
from scenes.description.textures import Checkerboard
from tests.kit.closed_form_scenes import EYE, TARGET, unit
from tests.kit.mitsuba_scenes import floor, look_at, rectangle, scene, shape, vector

SUN = DistantLight(unit(1, 2, -1), vector(2.0, 1.5, 1.0))
LOW_SUN = DistantLight(unit(1, -2, -1), vector(9.0, 9.0, 9.0))
SKY = Environment(vector(0.3, 0.4, 0.6))
LAMP = PointLight(vector(0.3, 0.4, -0.2), vector(2.0, 1.5, 1.0))
CHECKS = Diffuse(Checkerboard(np.ones(3), np.zeros(3)))


def under(*lights: Light, shapes: tuple[ShapeDescription, ...] = ()) -> SceneDescription:
    """Two floors side by side, one darker, and some sky in view."""
    dark = shape(rectangle(vector(3, 0, 0), vector(0, 0, 2), vector(1, 0, 0)), 0.2)
    made = scene([floor(2.0), dark, *shapes], look_at(EYE, TARGET, vector(0, 1, 0)), 60.0, 32, 24)
    return replace(made, lights=lights)


def image(given: SceneDescription, quantity: Quantity = "radiance") -> Array:
    return ClosedFormBackend().render(given, ReferenceRequest(quantity=quantity)).mean


@pytest.mark.parametrize(
    ("lights", "quantity"),
    [
        ((LAMP,), "radiance"),
        ((SUN,), "radiance"),
        ((SKY,), "radiance"),
        ((SUN, SKY, LOW_SUN), "radiance"),
        ((), "ambient-occlusion"),
    ],
    ids=["lamp", "sun", "sky", "both", "occlusion"],
)
@pytest.mark.usefixtures("mitsuba")
def test_agrees_with_mitsuba(lights: tuple[Light, ...], quantity: Quantity) -> None:
    """By region too; 0.5 % more light would be caught."""
    given, request = under(*lights), ReferenceRequest(1024, 64, quantity=quantity)
    exact, other = ClosedFormBackend().render(given, request), MitsubaBackend().render(given, request)
    sampled = Moments(other.mean, other.variance, other.batches - 1)
    for result in compare_images(Moments(exact.mean, exact.variance, np.inf), sampled, alpha=1e-3):
        print(result)
        assert not result.reject
    wrong = Moments(exact.mean * 1.005, exact.variance, np.inf)
    assert any(result.reject for result in compare_images(wrong, sampled, alpha=1e-3))


def test_pixels_by_hand() -> None:
    """The middle of the floor, the open sky, and a bound that is far below both."""
    made = ClosedFormBackend().render(under(SUN, SKY), ReferenceRequest())
    cosine = 2 / np.sqrt(6)
    np.testing.assert_allclose(
        made.mean[14, 16], 0.5 * (SUN.irradiance * cosine / np.pi + SKY.radiance), rtol=1e-12
    )
    np.testing.assert_allclose(made.mean[0, 0], SKY.radiance, rtol=1e-12)
    assert 0 < made.variance.max() < 1e-22
    assert (made.spp, made.batches) == (0, 0)
    np.testing.assert_array_equal(image(under(LOW_SUN)), 0.0)


def test_shares_of_pixels_add_up_to_the_area_in_view() -> None:
    """Ambient occlusion of open floors is their coverage; seen from straight above it is a ratio of areas."""
    camera = look_at(vector(0, 4, 0), vector(0, 0, 0), vector(0, 0, 1))
    given = scene(
        [shape(rectangle(vector(0.013, 0, 0), vector(0, 0, 0.7), vector(0.4, 0, 0)))], camera, 40.0, 16, 12
    )
    seen = image(given, "ambient-occlusion")
    pixel = 2 * 4 * np.tan(np.radians(20)) / 12
    assert seen.sum() / 3 * pixel**2 == pytest.approx(0.8 * 1.4, rel=1e-12)
    assert seen.min() == 0 and seen.max() == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize("height", [1.0, 1e-2, 1e-4])
def test_a_pixel_under_a_point_light_by_brute_force(height: float) -> None:
    """The pixel with the light's foot, seen from straight above: polar integrals of I h / d^3 over a square,
    256 nodes a side.
    """
    camera = look_at(vector(0, 2, 0), vector(0, 0, 0), vector(0, 0, 1))
    lamp = PointLight(vector(0, height, 0), vector(3.0, 3.0, 3.0))
    given = replace(scene([floor(4.0)], camera, 40.0, 9, 9), lights=(lamp,))
    half = 2 * np.tan(np.radians(20)) / 9
    nodes, weights = np.polynomial.legendre.leggauss(256)
    edge = half / np.cos(
        np.pi / 4 * nodes
    )  # the square's rim, by angle; the radial integral is in closed form
    radial = 1 - height / np.hypot(height, edge)
    wanted = 0.5 / np.pi * 3 * np.sum(weights * radial) * np.pi / 4 * 4 / (2 * half) ** 2
    made = ClosedFormBackend().render(given, ReferenceRequest())
    error, bound = abs(made.mean[4, 4, 0] / wanted - 1), np.sqrt(made.variance[4, 4, 0]) / wanted
    print(f"height {height:g}: relative error {error:.1e}, bound {bound:.1e}")
    assert error <= bound + 1e-12 and bound < 1e-6


REFUSED: dict[str, SceneDescription] = {
    "a sky of one radiance all around": under(Environment(np.ones(3), hemisphere=True)),
    "no spot lights": under(SpotLight(vector(0, 1, 0), vector(0, -1, 0), np.ones(3), 30.0, 20.0)),
    "on the same side of the receivers' plane": under(PointLight(vector(0, -1, 0), np.ones(3))),
    "exactly one light, and this scene has 3": under(SUN, SKY, PointLight(vector(0, 1, 0), np.ones(3))),
    "there is a sphere": under(SKY, shapes=(shape(Sphere(vector(0, 1, 0), 0.5)),)),
    "exactly one light, and this scene has 2": under(
        SKY, shapes=(shape(Sphere(vector(0, 1, 0), 0.5), 0.0, (1, 1, 1)),)
    ),
    "receivers of one diffuse reflectance": under(SKY, shapes=(replace(floor(1.0), material=CHECKS),)),
}


@pytest.mark.parametrize("reason", REFUSED)
def test_refusals(reason: str) -> None:
    assert reason in (ClosedFormBackend().refuses(REFUSED[reason]) or "accepted")


def test_occlusion_by_a_light_is_refused() -> None:
    lit = under(shapes=(shape(Sphere(vector(0, 1, 0), 0.5), 0.0, (1, 1, 1)),))
    assert "in the way" in str(ClosedFormBackend().refuses(lit, "ambient-occlusion"))
