"""Textures by their coordinates: constants, images, checkerboards, and what is made of them, as pbrt-v4
defines them.

There is no prefiltering: what varies within a pixel is averaged by the pixel's samples [pharr2023, sec.
10.4].
"""

from __future__ import annotations

from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats
from scenes.description.textures import Checkerboard, ImageTexture, Mix, Product, Texture, UVMapping

Integers = NDArray[np.int64]


@singledispatch
def evaluate(texture: Texture, uv: Floats) -> Floats:
    """The values (3, n) of a texture at uv (2, n)."""
    raise TypeError(f"no values of a {type(texture).__name__} are known")


@evaluate.register
def _(texture: np.ndarray, uv: Floats) -> Floats:
    return np.repeat(texture.astype(np.float64)[:, None], uv.shape[1], axis=1)


@evaluate.register
def _(texture: Product, uv: Floats) -> Floats:
    return evaluate(texture.first, uv) * evaluate(texture.second, uv)


@evaluate.register
def _(texture: Mix, uv: Floats) -> Floats:
    amount = evaluate(texture.amount, uv)
    return (1.0 - amount) * evaluate(texture.first, uv) + amount * evaluate(texture.second, uv)


@evaluate.register
def _(texture: Checkerboard, uv: Floats) -> Floats:
    s, t = _mapped(texture.mapping, uv)
    even = (np.floor(s) + np.floor(t)) % 2 == 0
    return np.where(even, evaluate(texture.first, uv), evaluate(texture.second, uv))


@evaluate.register
def _(texture: ImageTexture, uv: Floats) -> Floats:
    s, t = _mapped(texture.mapping, uv)
    look = bilinear if texture.filter == "bilinear" else nearest
    return texture.value(look(texture.image, np.stack([s, 1.0 - t]), texture.wrap))


@singledispatch
def brightest(texture: Texture) -> Floats:
    """(3,) no value of the texture is above this."""
    raise TypeError(f"no bound of a {type(texture).__name__} is known")


@brightest.register
def _(texture: np.ndarray) -> Floats:
    return texture


@brightest.register
def _(texture: Product) -> Floats:
    return brightest(texture.first) * brightest(texture.second)


@brightest.register
def _(texture: Checkerboard | Mix) -> Floats:
    return np.maximum(brightest(texture.first), brightest(texture.second))


@brightest.register
def _(texture: ImageTexture) -> Floats:
    """What an image becomes rises or falls with what is found in it."""
    image = texture.image
    least = np.zeros(3) if texture.wrap == "black" else image.min(axis=(0, 1))
    return np.maximum(texture.value(least), texture.value(image.max(axis=(0, 1))))


def _mapped(mapping: UVMapping, uv: Floats) -> tuple[Floats, Floats]:
    return mapping.su * uv[0] + mapping.du, mapping.sv * uv[1] + mapping.dv


def nearest(image: Floats, st: Floats, wrap: str) -> Floats:
    """The texel (3, n) that each point lies in. image: (h, w, 3). st: (2, n), (0, 0) at the first texel's
    outer corner.
    """
    height, width, _ = image.shape
    return _texels(
        image, np.floor(st[1] * height).astype(np.int64), np.floor(st[0] * width).astype(np.int64), wrap
    )


def bilinear(image: Floats, st: Floats, wrap: str) -> Floats:
    """Interpolated between the centres of the four nearest texels. As `nearest` otherwise."""
    height, width, _ = image.shape
    x, y = st[0] * width - 0.5, st[1] * height - 0.5
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    dx, dy = x - column, y - row
    upper = _texels(image, row, column, wrap) * (1.0 - dx) + _texels(image, row, column + 1, wrap) * dx
    lower = (
        _texels(image, row + 1, column, wrap) * (1.0 - dx) + _texels(image, row + 1, column + 1, wrap) * dx
    )
    return upper * (1.0 - dy) + lower * dy


def _texels(image: Floats, row: Integers, column: Integers, wrap: str) -> Floats:
    """Texels (3, n), those outside the image as `wrap` has it: "repeat", "clamp" or "black"."""
    height, width, _ = image.shape
    if wrap == "repeat":
        r, c = row % height, column % width
    else:
        r, c = np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)
    out = np.ascontiguousarray(image[r, c].T)
    return np.where((r == row) & (c == column), out, 0.0) if wrap == "black" else out
