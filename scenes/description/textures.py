"""Textures: what varies over a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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


@dataclass(frozen=True, eq=False)
class Checkerboard:
    """pbrt's two-dimensional checkerboard: `first` where floor(s) + floor(t) is even."""

    first: Texture
    second: Texture
    mapping: UVMapping = UVMapping()


@dataclass(frozen=True, eq=False)
class Product:
    """pbrt's texture "scale"."""

    first: Texture
    second: Texture


@dataclass(frozen=True, eq=False)
class Mix:
    """(1 - amount) first + amount second."""

    first: Texture
    second: Texture
    amount: Texture


# An array (3,) is a constant.
Texture = Array | ImageTexture | Checkerboard | Product | Mix
