"""Textures: what varies over a surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ColorMap = Callable[[Array], Array]  # of colours (..., 3), the shape kept


@dataclass(frozen=True, eq=False)
class UVMapping:
    """pbrt's `mapping "uv"`: (s, t) = (su u + du, sv v + dv)."""

    su: float = 1.0
    sv: float = 1.0
    du: float = 0.0
    dv: float = 0.0


@dataclass(frozen=True, eq=False)
class ImageTexture:
    """An image laid on a surface. image: (h, w, 3) float64, linear RGB, none below 0, the first row at t = 1.

    wrap: "repeat", "black" or "clamp". filter: "bilinear" or "point". What it finds is multiplied by `scale`,
    taken from 1 if `invert`, cut off below 0 and, if `clamped` as colours are in pbrt and numbers are not,
    above 1.
    """

    image: Array
    mapping: UVMapping = UVMapping()
    wrap: str = "repeat"
    filter: str = "bilinear"
    scale: float = 1.0
    invert: bool = False
    clamped: bool = True

    def value(self, found: Array) -> Array:
        """What the texture is where the image, looked up, is `found`: an array of the same shape."""
        scaled = found * self.scale
        return np.clip(1.0 - scaled if self.invert else scaled, 0.0, 1.0 if self.clamped else None)

    def plain(self) -> ImageTexture | None:
        """The same texture by its texels alone; None where a bound lies between looking up and the value,
        which no texels can do.

        Exact but for rounding: a mean of texels goes through what is linear, and the nearest one through
        anything.
        """
        top = float(self.image.max(initial=0.0)) * self.scale
        bounded = top > 1.0 and (self.clamped or self.invert)
        if (self.invert and self.wrap == "black") or (bounded and self.filter != "point"):
            return None
        return ImageTexture(
            self.value(self.image), self.mapping, self.wrap, self.filter, clamped=self.clamped
        )

    def mean(self) -> Array:
        """(3,) over one period."""
        return self.value(self.image).mean(axis=(0, 1))

    def map_colors(self, change: ColorMap) -> ImageTexture:
        return replace(self, image=change(self.image))


@dataclass(frozen=True, eq=False)
class Checkerboard:
    """pbrt's two-dimensional checkerboard: `first` where floor(s) + floor(t) is even."""

    first: Texture
    second: Texture
    mapping: UVMapping = UVMapping()

    def mean(self) -> Array:
        return (mean(self.first) + mean(self.second)) / 2

    def map_colors(self, change: ColorMap) -> Checkerboard:
        first, second = map_colors(self.first, change), map_colors(self.second, change)
        return replace(self, first=first, second=second)


@dataclass(frozen=True, eq=False)
class Product:
    """pbrt's texture "scale"."""

    first: Texture
    second: Texture

    def mean(self) -> Array:
        """Exact where the two do not vary together."""
        return mean(self.first) * mean(self.second)

    def map_colors(self, change: ColorMap) -> Product:
        return Product(map_colors(self.first, change), map_colors(self.second, change))


@dataclass(frozen=True, eq=False)
class Mix:
    """(1 - amount) first + amount second."""

    first: Texture
    second: Texture
    amount: Texture

    def mean(self) -> Array:
        """Exact where the amount does not vary with the textures."""
        amount = mean(self.amount)
        return (1 - amount) * mean(self.first) + amount * mean(self.second)

    def map_colors(self, change: ColorMap) -> Mix:
        return Mix(*(map_colors(one, change) for one in (self.first, self.second, self.amount)))


# An array (3,) is a constant.
Texture = Array | ImageTexture | Checkerboard | Product | Mix


def mean(texture: Texture) -> Array:
    """(3,) the mean of a texture over its surface, for those who draw one colour."""
    return texture if isinstance(texture, np.ndarray) else texture.mean()


def map_colors(texture: Texture, change: ColorMap) -> Texture:
    """The texture with `change` applied to the colours (..., 3) that it is made of."""
    return change(texture) if isinstance(texture, np.ndarray) else texture.map_colors(change)
