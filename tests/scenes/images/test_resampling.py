"""Resizing to powers of two: against the definition written out texel by texel, and by properties."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenes.images.resampling import resized, rounded_up, weights

SHAPES = [(3, 5), (1, 7), (7, 1), (4, 6), (6, 4), (100, 60), (70, 3)]


def unchanged(rows: np.ndarray) -> np.ndarray:
    return rows


def lanczos(x: float) -> float:
    """The windowed sinc of radius and period 2, by its closed form: 2 sin(pi x) sin(pi x / 2) / (pi x)^2."""
    if abs(x) >= 2:
        return 0.0
    return 1.0 if x == 0 else 2 * math.sin(math.pi * x) * math.sin(math.pi * x / 2) / (math.pi * x) ** 2


def outside(index: int, size: int, wrap: str) -> int | None:
    if wrap == "repeat":
        return index - size * math.floor(index / size)
    return min(max(index, 0), size - 1) if wrap == "clamp" or 0 <= index < size else None


def by_definition(image: np.ndarray, wrap: str) -> np.ndarray:
    """Each new texel the weighted mean of every old one whose centre is nearer than 2 to its own, along both
    sides at once.
    """
    height, width, channels = image.shape
    tall, wide = 2 ** math.ceil(math.log2(height)), 2 ** math.ceil(math.log2(width))
    out = np.zeros((tall, wide, channels))
    for y in range(tall):
        for x in range(wide):
            cy, cx = (y + 0.5) * height / tall, (x + 0.5) * width / wide
            total = 0.0
            for i in range(math.floor(cy) - 4, math.floor(cy) + 5):
                for j in range(math.floor(cx) - 4, math.floor(cx) + 5):
                    weight = lanczos(i + 0.5 - cy) * lanczos(j + 0.5 - cx)
                    total += weight
                    row, column = outside(i, height, wrap), outside(j, width, wrap)
                    if row is not None and column is not None:
                        out[y, x] += weight * image[row, column]
            out[y, x] /= total
    return np.maximum(out, 0.0)


@pytest.mark.parametrize("wrap", ["repeat", "clamp", "black"])
@pytest.mark.parametrize("shape", [*SHAPES[:5], (13, 9)])
def test_a_resized_image_is_the_one_that_the_definition_gives(shape: tuple[int, int], wrap: str) -> None:
    """Rounding alone may differ: 1e-12.

    An index off by one, another border or a weight left out differ by 1e-2 and more.
    """
    image = np.random.default_rng(3).uniform(-0.1, 1.0, (*shape, 3))
    np.testing.assert_allclose(
        resized(image, wrap, unchanged), by_definition(image, wrap), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("shape", SHAPES)
def test_constants_stay_constant_but_for_black_borders(shape: tuple[int, int]) -> None:
    for wrap in ("repeat", "clamp"):
        np.testing.assert_allclose(resized(np.full((*shape, 1), 0.7), wrap, unchanged), 0.7, rtol=1e-14)
    black = resized(np.full((*shape, 1), 0.7), "black", unchanged)[..., 0]
    np.testing.assert_allclose(black[black.shape[0] // 2, black.shape[1] // 2], 0.7, rtol=0.1)
    sides = [
        0 if shape[0] != black.shape[0] else slice(None),
        0 if shape[1] != black.shape[1] else slice(None),
    ]
    assert np.all(black[tuple(sides)] < 0.69)


@pytest.mark.parametrize("old", [1, 2, 3, 5, 60, 100, 513, 8191])
def test_weights_add_up_to_one_and_reach_no_further_than_two_texels(old: int) -> None:
    new = rounded_up(old)
    first, weight = weights(old, new)
    np.testing.assert_allclose(weight.sum(axis=1), 1.0, rtol=1e-15)
    centre = (np.arange(new) + 0.5) * old / new
    distance = np.abs(first[:, None] + np.arange(4) + 0.5 - centre[:, None])
    assert np.all((distance <= 2) | (weight == 0))
    assert np.all(np.abs(first + 2 - centre) <= 0.5)  # two texels on each side


@pytest.mark.parametrize("shape", [(1, 1), (8, 4), (1, 16)])
def test_powers_of_two_are_left_alone(shape: tuple[int, int]) -> None:
    image = np.random.default_rng(4).random((*shape, 3))
    assert resized(image, "repeat", unchanged) is image
    tall = np.random.default_rng(4).random((5, shape[1], 3))  # and so is the side that is one
    np.testing.assert_array_equal(
        resized(tall, "repeat", unchanged)[:, :1], resized(tall[:, :1], "repeat", unchanged)
    )


def test_sizes_are_rounded_up() -> None:
    assert [rounded_up(n) for n in (1, 2, 3, 4, 5, 1023, 1024, 1025)] == [1, 2, 4, 4, 8, 1024, 1024, 2048]


def test_long_images_are_the_same_whichever_block_a_row_is_in() -> None:
    """200 rows become 256, four blocks; the same rows repeated below themselves are the same again."""
    image = np.random.default_rng(5).random((100, 3, 2))
    whole = resized(np.concatenate([image, image]), "repeat", unchanged)
    np.testing.assert_allclose(whole[:128], whole[128:], rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(whole[:128], resized(image, "repeat", unchanged), rtol=1e-12, atol=1e-13)


def test_what_rings_below_zero_becomes_zero_and_above_one_stays() -> None:
    image = np.zeros((1, 12, 1))
    image[:, 4:8] = 1.0
    row = resized(image, "clamp", unchanged)[0, :, 0]
    assert row.min() == 0.0
    assert row.max() > 1.01
