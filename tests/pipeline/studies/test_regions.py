"""The regions of a picture against geometry worked out by hand, and against a reference that is exact."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scenes
from pipeline.backends import BACKENDS
from pipeline.references.protocol import ReferenceRequest
from pipeline.run.region_maps import region_map
from pipeline.statistics.numerics import box_maximum
from pipeline.studies.regions import CONTACT, Regions, find_regions, from_channels, to_channels
from renderer import RenderScene, build
from renderer.math.vectors import Floats
from tests.kit.prepared import prepare

SIZE = {"xresolution": 64.0, "yresolution": 48.0}
HEIGHT, LAMP, LIGHT = 1.2, 3.0, 2.0  # knife-edge's parameters


def corners(scene: RenderScene) -> Floats:
    """z of the floor points (4, h, w) seen through the corners of each pixel; nan where the floor is not
    seen.
    """
    w, h = scene.camera.width, scene.camera.height
    pixel = np.arange(w * h)
    out = []
    for x, y in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
        _, d = scene.camera.rays(pixel, np.repeat([[x], [y]], pixel.size, axis=1))
        o = scene.camera.origin[:, 0]
        t = np.where(d[1] < 0, -o[1] / d[1], np.nan)
        above = (
            o[2] + d[2] * (HEIGHT - o[1]) / d[1]
        )  # z where the ray passes the sheet's height, if it comes from above it
        hidden = (o[1] > HEIGHT) & (above > 0)
        out.append(np.where(hidden, np.nan, o[2] + d[2] * t).reshape(h, w))
    return np.stack(out)


def test_a_knife_edge_divides_the_floor_where_geometry_says() -> None:
    """Lit for z below -0.67, in the umbra above 0.67, between them in the penumbra, which two borders of a
    pixel may widen.
    """
    scene = build(scenes.load("knife-edge", SIZE))
    found = find_regions(scene)
    assert found is not None
    masks, z = found.masks(), corners(scene)
    edge = LIGHT / 2 * HEIGHT / (LAMP - HEIGHT)
    margin = 0.3  # a pixel on the floor, and one more for those that border on another region
    bordering = box_maximum(np.isnan(z).any(axis=0).astype(np.float64), 3) > 0  # on the lit top of the sheet
    lit, dark = (z < -edge - margin).all(axis=0), (z > edge + margin).all(axis=0) & ~bordering
    between = (np.abs(z) < edge - margin).all(axis=0)
    assert lit.sum() > 500 and dark.sum() > 100 and between.sum() > 300
    assert masks["lit"][lit].all() and masks["umbra"][dark].all() and masks["penumbra"][between].all()
    assert "contact" not in masks and "light" not in masks


def test_visibility_is_the_share_of_the_light() -> None:
    """Under a light parallel to the edge the visible share of its area falls linearly across the penumbra; by
    solid angle nearly so.
    """
    scene = build(scenes.load("knife-edge", SIZE))
    found = find_regions(scene, spp=256)
    assert found is not None
    z = corners(scene).mean(axis=0)
    edge = LIGHT / 2 * HEIGHT / (LAMP - HEIGHT)
    inside = np.abs(z) < 0.8 * edge
    assert np.abs(found.visibility[inside] - (0.5 - 0.5 * z[inside] / edge)).max() < 0.15


@pytest.fixture(scope="module")
def touching() -> tuple[Regions, np.ndarray]:
    """The regions of a light that nearly touches the floor, and its exact picture."""
    description = scenes.load("touching-light", {"xresolution": 128.0, "yresolution": 96.0, "gap": 0.001})
    found = find_regions(build(description))
    assert found is not None
    return found, BACKENDS["closed-form"].render(description, ReferenceRequest()).mean


def test_every_pixel_has_one_region(touching: tuple[Regions, np.ndarray]) -> None:
    found = touching[0]
    assert (np.sum(list(found.masks().values()), axis=0) == 1).all()


def test_the_umbra_is_black_and_what_shows_the_light_is_light(touching: tuple[Regions, np.ndarray]) -> None:
    """Radiance 3 of the light, below 0.75 on the floor: what is brighter sees the light at least in part."""
    found, truth = touching
    masks = found.masks()
    assert found.dark.sum() > 50 and (truth[found.dark] == 0).all()
    assert (truth[masks["umbra"]] == 0).all()
    assert masks["light"][truth[..., 0] > 0.75].all()
    assert (truth[masks["lit"]] > 0).all() and truth[masks["lit"]].max() < 0.75
    assert truth[masks["background"]].max() < 1e-3


def test_contact_is_where_the_light_meets_the_floor(touching: tuple[Regions, np.ndarray]) -> None:
    """Just below the light's pixels, and not where the gap is wider than CONTACT of the distance."""
    contact = touching[0].masks()["contact"]
    light = np.argwhere(touching[0].masks()["light"])
    assert contact.sum() > 3
    for row, column in np.argwhere(contact):
        assert np.abs(light - (row, column)).max(axis=1).min() <= 2
    wide = find_regions(build(scenes.load("touching-light", SIZE | {"gap": 10 * CONTACT * 5})))
    assert wide is not None and "contact" not in wide.masks()


def test_a_scene_without_lights_has_no_regions() -> None:
    description = scenes.load("touching-light", SIZE)
    unlit = type(description)(
        description.name,
        description.camera,
        description.film,
        tuple(shape for shape in description.shapes if shape.emission is None),
    )
    assert find_regions(build(unlit)) is None


def test_a_label_image_is_made_once_and_again_if_damaged(tmp_path: Path) -> None:
    scene = prepare("touching-light", {"xresolution": 16.0, "yresolution": 12.0})
    first = region_map(tmp_path, scene)
    assert first is not None
    path = tmp_path / first[0].image
    written = path.stat().st_mtime_ns
    second = region_map(tmp_path, scene)
    assert second is not None and path.stat().st_mtime_ns == written
    assert np.array_equal(first[1].label, second[1].label) and np.array_equal(first[1].dark, second[1].dark)
    assert sum(first[0].pixels.values()) == 16 * 12
    path.write_bytes(path.read_bytes()[:100])
    third = region_map(tmp_path, scene)
    assert third is not None and np.array_equal(first[1].label, third[1].label)


def test_channels_come_back_as_they_went() -> None:
    label = np.arange(6, dtype=np.int64).reshape(2, 3)
    one = Regions(label, np.full((2, 3), 0.25), label == 2)
    two = from_channels(to_channels(one))
    assert np.array_equal(one.label, two.label) and np.array_equal(one.dark, two.dark)
