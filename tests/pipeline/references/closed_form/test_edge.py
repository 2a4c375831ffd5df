"""The closed form of a straight edge's penumbra, against integrals by a method of its own and against the
renderer.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scenes
from examples.penumbra_width import width_of
from pipeline.references.backends.closed_form_edge import EdgeBackend
from pipeline.references.closed_form.edge_image import edge_image, irradiance, project
from pipeline.references.closed_form.edge_scene import EdgeScene, analyse_edge
from pipeline.references.closed_form.film import FilmPlane, film_plane
from pipeline.references.protocol import BACKENDS, ReferenceRequest
from renderer import render
from scenes.description.materials import Diffuse
from scenes.description.scene import PixelFilter, SceneDescription
from scenes.description.shapes import Array
from scenes.errors import PenumbraError, SceneError

pytestmark = pytest.mark.usefixtures("thorough")

SIZE = {"xresolution": 24, "yresolution": 24}
CASES = [
    ("penumbra", {}),
    ("penumbra", {"light_size": 0.3, "occluder_height": 2.5}),
    ("penumbra", {"light_size": 4.0, "occluder_height": 0.2}),
    ("knife-edge", {}),
    ("knife-edge", {"height": 2.0, "size": 0.7}),
]


def scene(name: str, parameters: dict[str, float]) -> SceneDescription:
    return scenes.load(name, {**SIZE, **parameters})


def by_hand(description: SceneDescription, points: np.ndarray) -> np.ndarray:
    """Radiance (n, 3) at points of the floor y = 0 under a square light facing down: Gauss over the part of
    the light that the edge z = 0 leaves.

    A point (x, 0, z) sees the light's points with z' below the line through it and the edge; area form of the
    rendering equation.
    """
    light = next(shape for shape in description.shapes if shape.emission)
    floor, sheet = description.shapes[:2]
    h, lamp = sheet.geometry.vertices[0, 1], light.geometry.vertices[0, 1]
    half = np.ptp(light.geometry.vertices[:, 0]) / 2
    nodes, weights = np.polynomial.legendre.leggauss(40)
    limit = np.clip(points[:, 2] * (1 - lamp / h), -half, half)  # the line at the light's height
    x, wx = nodes * half, weights * half
    z = -half + (nodes + 1) / 2 * (limit[:, None] + half)
    wz = weights / 2 * (limit[:, None] + half)
    d2 = (x[None, :, None] - points[:, :1, None]) ** 2 + (z[:, None, :] - points[:, 2:, None]) ** 2 + lamp**2
    e = np.einsum("nij,i,nj->n", lamp**2 / d2**2, wx, wz)
    return np.multiply.outer(e, floor.material.reflectance * light.emission.radiance / np.pi)


def seen_radiance(scene: EdgeScene, film: FilmPlane, points: Array) -> Array:
    """Exact radiance (n, 3) seen at film points (n, 3)."""
    total, free = np.zeros_like(points), np.ones(len(points), dtype=np.bool_)
    for receiver, plane in ((scene.sheet, scene.sheet_plane), (scene.floor, scene.floor_plane)):
        seen = np.flatnonzero(free & np.all(points @ film.planes(receiver.patch.outline).T > 0, axis=1))
        e = irradiance(scene, plane, project(film, plane, points[seen]))
        total[seen] = e[:, None] * (receiver.reflectance * scene.radiance / np.pi)
        free[seen] = False
    return total


@pytest.mark.parametrize(("name", "parameters"), CASES)
def test_the_floor_s_radiance_is_the_light_that_the_edge_leaves(
    name: str, parameters: dict[str, float]
) -> None:
    """At the pixels' middles, to 1e-9; catches an edge that hides the wrong side, and a light cut at the
    wrong place.
    """
    description = scene(name, parameters)
    edge, film = analyse_edge(description), film_plane(description.camera, description.film)
    at = film.centers()
    d = at @ film.to_world.T
    on_sheet = np.all(at @ film.planes(edge.sheet.patch.outline).T > 0, axis=1)
    floor = np.flatnonzero(~on_sheet & np.all(at @ film.planes(edge.floor.patch.outline).T > 0, axis=1))
    points = film.eye + d * (-film.eye[1] / d[:, 1])[:, None]
    found = seen_radiance(edge, film, at)[floor]
    expected = by_hand(description, points[floor])
    assert np.count_nonzero(expected[:, 0] == 0) > 5 and np.count_nonzero(expected[:, 0] > 0) > 50
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("name", "parameters"), CASES)
def test_a_pixel_is_the_mean_over_its_square(name: str, parameters: dict[str, float]) -> None:
    """Against 24 x 24 midpoints in each pixel: up to half of 1/24 of a step where an edge cuts a pixel, in
    one row of 16; far less elsewhere.
    """
    description = scenes.load(name, {"xresolution": 16, "yresolution": 16, **parameters})
    edge, film = analyse_edge(description), film_plane(description.camera, description.film)
    image = edge_image(edge, film)
    mean, bound = image.mean, image.bound
    share = (np.arange(24) + 0.5) / 24
    low, high = film.squares(np.arange(film.pixels))[:, 0], film.squares(np.arange(film.pixels))[:, 2]
    total = np.zeros_like(mean)
    for u in share:
        at = low + (high - low) * np.stack([np.full(24, u), share, np.zeros(24)], axis=1)[:, None]
        total += seen_radiance(edge, film, at.reshape(-1, 3)).reshape(24, -1, 3).sum(axis=0) / 24**2
    largest = mean.max()
    assert bound.max() < 1e-6 * largest
    apart = np.abs(mean - total).max(axis=1) / largest
    assert apart.max() < 0.03
    assert np.median(apart) < 3e-5
    assert abs(mean.mean() / total.mean() - 1) < 2e-3


def test_the_renderer_agrees() -> None:
    """Image mean within five standard errors (a bias of 0.2 % would show), and black where nothing is lit."""
    description = scene("penumbra", {})
    reference = EdgeBackend().render(description, ReferenceRequest())
    result = render(description, estimator="solid-angle", spp=256, seed=1)
    error = np.sqrt(result.variance.sum(axis=(0, 1))) / (24 * 24)
    mean = reference.mean.mean(axis=(0, 1))
    assert (5 * error / mean < 0.02).all()
    assert (np.abs(result.image.mean(axis=(0, 1)) - mean) < 5 * error).all()
    assert not result.image[reference.mean == 0].any()


def test_it_is_registered_and_says_what_made_it() -> None:
    found = BACKENDS["closed-form-edge"].render(scene("penumbra", {}), ReferenceRequest())
    assert found.provenance["backend"] == "closed-form-edge"
    assert (found.spp, found.batches) == (0, 0)
    assert BACKENDS["closed-form"].refuses(scene("penumbra", {})) is not None


def test_what_is_no_edge_is_refused_in_words() -> None:
    backend, good = EdgeBackend(), scene("penumbra", {})
    floor, sheet, light = good.shapes
    emission = light.emission
    assert emission is not None

    def told(*shapes: object, **changes: object) -> str:
        return backend.refuses(replace(good, shapes=shapes or good.shapes, **changes)) or "nothing"

    assert told() == "nothing"
    assert "one area light, one floor and one sheet" in told(floor, light)
    assert "one-sided light" in told(floor, sheet, replace(light, emission=replace(emission, two_sided=True)))
    narrow = replace(sheet.geometry, vertices=sheet.geometry.vertices * np.array([0.01, 1, 1]))
    assert "one edge of the sheet before the light, and 3 may be" in told(
        floor, replace(sheet, geometry=narrow), light
    )
    wide = replace(
        sheet.geometry,
        vertices=sheet.geometry.vertices - np.array([0, 0, 20.0]) * (sheet.geometry.vertices[:, 2:] == 0),
    )
    assert "and 0 may be" in told(floor, replace(sheet, geometry=wide), light)
    raised = replace(light.geometry, vertices=light.geometry.vertices - np.array([0, 2.99, 0]))
    assert "of its extent or more above the sheet" in told(floor, sheet, replace(light, geometry=raised))
    assert "parallel" in told(
        floor,
        replace(sheet, geometry=replace(sheet.geometry, vertices=sheet.geometry.vertices @ TILT)),
        light,
    )
    assert "box filter" in told(film=replace(good.film, pixel_filter=PixelFilter("gaussian", 1.5, 1.5)))
    textured = scenes.load("furnace").shapes[0].material
    assert "one diffuse reflectance" in told(replace(floor, material=textured), sheet, light)
    assert isinstance(floor.material, Diffuse)
    assert backend.refuses(good, "ambient-occlusion") == "there is no closed form of ambient-occlusion here"
    with pytest.raises(PenumbraError, match="scene soft-shadow: the closed form of an edge needs"):
        backend.render(scene("soft-shadow", {}), ReferenceRequest())


TILT = np.array([[1.0, 0, 0], [0, 0.999, 0.0447], [0, -0.0447, 0.999]])


@pytest.mark.parametrize(("size", "height"), [(0.5, 1.0), (1.0, 2.5), (2.0, 1.0), (4.0, 0.5)])
def test_the_width_is_that_of_the_closed_form(size: float, height: float) -> None:
    """In the exact image to 0.7 of a row, by which pixels blur it, or 1 %; exactly, 0.9 of that by similar
    triangles or less.
    """
    description = scenes.load(
        "penumbra", {"xresolution": 96, "yresolution": 96, "light_size": size, "occluder_height": height}
    )
    found = width_of(EdgeBackend().render(description, ReferenceRequest()).mean, description)
    assert found.similar_triangles == pytest.approx(size * height / (4 - height), rel=1e-12)
    assert found.measured == pytest.approx(found.exact, rel=0.01, abs=0.7 * found.pixel)
    assert 0.84 < found.exact / found.similar_triangles <= 0.9


def test_the_width_of_a_noisy_image_is_found_too() -> None:
    """Within 5 %, from 16 samples a pixel; an image of another light is found out."""
    description = scenes.load("penumbra", {"xresolution": 64, "yresolution": 64, "light_size": 2})
    image = render(description, estimator="solid-angle", spp=16, seed=4).image
    assert abs(width_of(image, description).error) < 0.05
    other = scenes.load("penumbra", {"xresolution": 64, "yresolution": 64, "light_size": 1})
    assert abs(width_of(image / image.max() * render(other, spp=1).image.max(), other).error) > 0.3


def test_a_width_that_cannot_be_seen_is_no_width() -> None:
    description = scene("penumbra", {})
    with pytest.raises(PenumbraError, match="not wholly in view: the light is nowhere 5% visible"):
        width_of(np.zeros((24, 24, 3)), description)
    with pytest.raises(SceneError, match="one area light, one floor and one sheet"):
        width_of(np.zeros((24, 24, 3)), scene("soft-shadow", {}))
