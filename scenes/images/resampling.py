"""Textures resized to powers of two before any look-up, as pbrt-v4 does [pharr2023, section B.5].

The functions there are `Image::GeneratePyramid`, `Image::FloatResizeUp` and `Image::ResampleWeights`.
Environments and images on lights are not resized.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

RADIUS = 2.0  # of the filter, and the period tau of its window, in texels of the original
TAPS = 4
ROWS = 64  # resized at a time: the intermediate arrays stay small beside the image


def rounded_up(size: int) -> int:
    """The smallest power of two that is at least `size`."""
    return 1 << (size - 1).bit_length()


def weights(old: int, new: int) -> tuple[Index, Array]:
    """For each of `new` texels along one side: the first of the 4 old ones that it is made of, (new,), and
    their weights, (new, 4).

    Lanczos' windowed sinc over the distance between the centres, in old texels, normalised to a sum of 1. The
    first index may be negative and the last beyond the side: those are the texels around the image. At a
    distance of exactly 2 the weight is 0 whichever of two texels is counted as the first, so that rounding of
    the centre decides nothing. Only upwards: new >= old.
    """
    centre = (np.arange(new) + 0.5) * (old / new)
    first = np.floor(centre - RADIUS + 0.5)
    x = first[:, None] + np.arange(TAPS) + 0.5 - centre[:, None]
    weight = np.where(np.abs(x) > RADIUS, 0.0, np.sinc(x) * np.sinc(x / RADIUS))
    return first.astype(np.int64), weight / weight.sum(axis=1, keepdims=True)


def resized(image: Array, wrap: str, stored: Callable[[Array], Array]) -> Array:
    """`image` (h, w, c) with both sides the next powers of two; the very same array if they are that already.

    wrap: what lies around it, "repeat", "clamp" or "black". stored: gives some rows the precision of the
    result. Sums below 0, which the filter's negative lobes make beside bright texels, become 0, as in pbrt. A
    side that is a power of two is left alone (pbrt's weights are 0 and 1 there but for rounding). With
    "black" what lies outside counts as 0; pbrt-v4 itself stops on such an image.
    """
    height, width, channels = image.shape
    tall, wide = rounded_up(height), rounded_up(width)
    if (tall, wide) == (height, width):
        return image
    out = np.zeros((tall, wide, channels))
    down, across = _side(height, tall), _side(width, wide)
    for top in range(0, tall, ROWS):
        rows = _filtered(image, down, slice(top, top + ROWS), wrap)
        columns = _filtered(np.ascontiguousarray(rows.swapaxes(0, 1)), across, slice(0, wide), wrap)
        out[top : top + ROWS] = stored(np.maximum(columns, 0.0)).swapaxes(0, 1)
    return out


def _side(old: int, new: int) -> tuple[Index, Array] | None:
    return None if old == new else weights(old, new)


def _filtered(image: Array, side: tuple[Index, Array] | None, some: slice, wrap: str) -> Array:
    """The resized image's slices `some` along its first axis."""
    if side is None:
        return image[some]
    first, weight = side[0][some], side[1][some]
    out = np.zeros((len(first), *image.shape[1:]))
    for tap in range(TAPS):
        index, factor = first + tap, weight[:, tap]
        inside = index % len(image) if wrap == "repeat" else np.clip(index, 0, len(image) - 1)
        factor = np.where(index == inside, factor, 0.0) if wrap == "black" else factor
        out += factor[:, None, None] * image.take(inside, axis=0)
    return out
