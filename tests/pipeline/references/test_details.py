"""Details of references: what later rounds draw, a pixel's error, how many samples a target takes, and every
colour of a material.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np
import pytest

from pipeline.references.accumulator import Accumulator, precision
from pipeline.references.batches import Batches, accumulate, missing
from pipeline.references.pbrt.channels import gray_scenes
from pipeline.references.protocol import Image, ReferenceRequest
from scenes.description.materials import Conductor, Diffuse, Material
from scenes.description.scene import Film, SceneDescription
from scenes.description.shapes import Array, Emission
from scenes.description.textures import Checkerboard, Mix, UVMapping
from tests.kit.fake_batches import small
from tests.kit.mitsuba_scenes import floor


def test_no_batch_is_drawn_twice_on_the_way_to_a_target() -> None:
    """A round that began at batch 0 again would count the same noise twice and report too small a
    variance.
    """
    drawn: list[int] = []

    def draw(wanted: Batches) -> Generator[Image]:
        for number in range(wanted.first, wanted.first + wanted.count):
            drawn.append(number)
            yield 2 + np.random.default_rng(number).normal(size=(4, 6, 3)) / np.sqrt(wanted.spp)

    accumulator = accumulate(draw, Film(6, 4), ReferenceRequest(spp=8, batches=4, target=0.02), 1000)
    assert accumulator.batches > 4
    assert drawn == list(range(accumulator.batches))


def test_a_pixels_error_is_the_root_mean_square_of_its_channels() -> None:
    """Variances 0, 0, 3: the root of their mean is 1, the mean of their roots 0.58."""
    variance = np.broadcast_to(np.array([0.0, 0.0, 3.0]), (4, 6, 3)).copy()
    found = precision(np.full((4, 6, 3), 2.0), variance)
    assert (found.median, found.p99) == pytest.approx((0.5, 0.5))


def test_half_the_error_takes_four_times_the_samples() -> None:
    """Median twice the target after 64 samples: 3 times as many again, with the margin of 5 % 205; in 64
    batches of 4 at most.
    """
    batches, spp = 16, 64
    m2 = np.full((4, 6, 3), 0.04 * spp * (batches - 1))  # a relative error of 0.2 / 1
    accumulator = Accumulator(np.ones((4, 6, 3)), m2, spp, batches)
    wanted = missing(accumulator, ReferenceRequest(spp=spp, batches=batches, target=0.1), 1000)
    assert wanted is not None and wanted.first == batches
    assert 205 <= wanted.count * wanted.spp < 205 + wanted.spp


COLOURS = np.array([0.2, 0.5, 0.7])


def gray_materials(material: Material) -> list[Material]:
    """Of a floor of that material under a light, one for each channel."""
    whole: SceneDescription = small()
    split = gray_scenes(replace(whole, shapes=(*whole.shapes, replace(floor(), material=material))))
    return [one.shapes[-1].material for one in split]


def test_both_optical_constants_of_a_metal_are_split() -> None:
    for c, one in enumerate(gray_materials(Conductor(COLOURS + 1.0, 3.0 * COLOURS, 0.3))):
        assert isinstance(one, Conductor)
        np.testing.assert_array_equal(one.eta, np.full(3, COLOURS[c] + 1.0))
        np.testing.assert_array_equal(one.k, np.full(3, 3.0 * COLOURS[c]))


def test_every_part_of_a_texture_is_split() -> None:
    first, second, amount = COLOURS, COLOURS**2, COLOURS[::-1].copy()
    for c, one in enumerate(
        gray_materials(Diffuse(Mix(first, Checkerboard(first, second, UVMapping()), amount)))
    ):
        assert isinstance(one, Diffuse) and isinstance(one.reflectance, Mix)
        board = one.reflectance.second
        assert isinstance(board, Checkerboard)
        for part, colour in ((one.reflectance.first, first), (one.reflectance.amount, amount)):
            np.testing.assert_array_equal(part, gray(colour, c))
        np.testing.assert_array_equal(board.first, gray(first, c))
        np.testing.assert_array_equal(board.second, gray(second, c))


def gray(colour: Array, c: int) -> Array:
    """That channel of a colour in all three."""
    return np.full(3, colour[c])


def test_the_image_of_a_light_is_split() -> None:
    whole = small()
    image = np.random.default_rng(1).random((2, 2, 3))
    lamp = replace(whole.shapes[1], emission=Emission(np.ones(3), image=image))
    for c, one in enumerate(gray_scenes(replace(whole, shapes=(whole.shapes[0], lamp)))):
        emission = one.shapes[1].emission
        assert emission is not None and emission.image is not None
        np.testing.assert_array_equal(emission.image, np.repeat(image[..., c : c + 1], 3, axis=2))
