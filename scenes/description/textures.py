"""Textures as data: values that vary over a surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar

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
    needs_uv: ClassVar[bool] = True


@dataclass(frozen=True, eq=False)
class PointMapping:
    """Points in the texture's own space. from_texture: (4, 4), from that space to the world."""

    from_texture: Array = field(default_factory=lambda: np.eye(4))
    needs_uv: ClassVar[bool] = False


@dataclass(frozen=True, eq=False)
class SphericalMapping(PointMapping):
    """pbrt's `mapping "spherical"`: (s, t) = (theta / pi, phi / 2 pi) about the texture's z."""


@dataclass(frozen=True, eq=False)
class CylindricalMapping(PointMapping):
    """pbrt's `mapping "cylindrical"`: (s, t) = (1/2 + atan2(y, x) / 2 pi, z)."""


@dataclass(frozen=True, eq=False)
class PlanarMapping(PointMapping):
    """pbrt's `mapping "planar"`: (s, t) = (p . v1 + udelta, p . v2 + vdelta). v1, v2: (3,)."""

    v1: Array = field(default_factory=lambda: np.eye(3)[0])
    v2: Array = field(default_factory=lambda: np.eye(3)[1])
    udelta: float = 0.0
    vdelta: float = 0.0


Mapping2D = UVMapping | SphericalMapping | CylindricalMapping | PlanarMapping


@dataclass(frozen=True, eq=False)
class ImageTexture:
    """An image laid on a surface. image: (h, w, 3) float64, linear RGB, none below 0, the first row at t = 1.

    wrap: "repeat", "black" or "clamp". filter: "bilinear" or "point". What it finds is multiplied by `scale`,
    taken from 1 if `invert`, cut off below 0 and, if `clamped` as colours are in pbrt and numbers are not,
    above 1.
    """

    image: Array
    mapping: Mapping2D = UVMapping()
    wrap: str = "repeat"
    filter: str = "bilinear"
    scale: float = 1.0
    invert: bool = False
    clamped: bool = True

    @property
    def needs_uv(self) -> bool:
        return self.mapping.needs_uv

    def value(self, found: Array) -> Array:
        """The texture's values where the image, looked up, is `found`: an array of the same shape."""
        scaled = found * self.scale
        return np.clip(1.0 - scaled if self.invert else scaled, 0.0, 1.0 if self.clamped else None)

    def plain(self) -> ImageTexture | None:
        """The texture as an image of its values; None if clamping after interpolation makes that impossible.

        It is exact but for rounding: linear maps commute with interpolation, and any map with the choice of
        the nearest texel.
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
    """pbrt's checkerboard: `first` where floor(s) + floor(t) is even; under a `PointMapping`, where the sum
    over three coordinates is even.
    """

    first: Texture
    second: Texture
    mapping: Mapping2D | PointMapping = UVMapping()

    @property
    def needs_uv(self) -> bool:
        return self.mapping.needs_uv or needs_uv(self.first, self.second)

    def mean(self) -> Array:
        return (mean(self.first) + mean(self.second)) / 2

    def map_colors(self, change: ColorMap) -> Checkerboard:
        first, second = map_colors(self.first, change), map_colors(self.second, change)
        return replace(self, first=first, second=second)


@dataclass(frozen=True, eq=False)
class Product:
    """pbrt's texture "scale": the product of two textures."""

    first: Texture
    second: Texture

    @property
    def needs_uv(self) -> bool:
        return needs_uv(self.first, self.second)

    def mean(self) -> Array:
        """The product of the means, exact unless the two vary together."""
        return mean(self.first) * mean(self.second)

    def map_colors(self, change: ColorMap) -> Product:
        return Product(map_colors(self.first, change), map_colors(self.second, change))


@dataclass(frozen=True, eq=False)
class Mix:
    """The texture (1 - amount) first + amount second."""

    first: Texture
    second: Texture
    amount: Texture

    @property
    def needs_uv(self) -> bool:
        return needs_uv(self.first, self.second, self.amount)

    def mean(self) -> Array:
        """The mix of the means, exact unless the amount varies with the textures."""
        amount = mean(self.amount)
        return (1 - amount) * mean(self.first) + amount * mean(self.second)

    def map_colors(self, change: ColorMap) -> Mix:
        return Mix(*(map_colors(one, change) for one in (self.first, self.second, self.amount)))


@dataclass(frozen=True, eq=False)
class DirectionMix:
    """The texture |n . direction| first + (1 - |n . direction|) second, n being the geometric normal.
    direction: (3,) unit, in the world.
    """

    first: Texture
    second: Texture
    direction: Array

    @property
    def needs_uv(self) -> bool:
        return needs_uv(self.first, self.second)

    def mean(self) -> Array:
        """The mean over all directions of normals."""
        return (mean(self.first) + mean(self.second)) / 2

    def map_colors(self, change: ColorMap) -> DirectionMix:
        return replace(self, first=map_colors(self.first, change), second=map_colors(self.second, change))


@dataclass(frozen=True, eq=False)
class Bilerp:
    """pbrt's `bilerp`: (1 - s)(1 - t) v00 + s (1 - t) v10 + (1 - s) t v01 + s t v11, of (3,) each."""

    v00: Array
    v01: Array
    v10: Array
    v11: Array
    mapping: Mapping2D = UVMapping()

    @property
    def needs_uv(self) -> bool:
        return self.mapping.needs_uv

    def mean(self) -> Array:
        """The mean over [0, 1]^2."""
        return (self.v00 + self.v01 + self.v10 + self.v11) / 4

    def map_colors(self, change: ColorMap) -> Bilerp:
        low, high = (change(self.v00), change(self.v01)), (change(self.v10), change(self.v11))
        return Bilerp(*low, *high, self.mapping)


@dataclass(frozen=True, eq=False)
class Dots:
    """Disks of radius 0.35 in half of the cells of (s, t), shifted at random, by pbrt's noise.

    pbrt's parameter "inside" is `around` here and its "outside" is `within`, since it mixes them up.
    """

    around: Texture
    within: Texture
    mapping: Mapping2D = UVMapping()

    @property
    def needs_uv(self) -> bool:
        return self.mapping.needs_uv or needs_uv(self.around, self.within)

    def mean(self) -> Array:
        share = np.pi * 0.35**2 / 2
        return (1 - share) * mean(self.around) + share * mean(self.within)

    def map_colors(self, change: ColorMap) -> Dots:
        return replace(self, around=map_colors(self.around, change), within=map_colors(self.within, change))


@dataclass(frozen=True, eq=False)
class NoiseTexture:
    """Numbers from Perlin's noise at points: pbrt's "fbm", "wrinkled" or "windy", by `kind`.

    octaves, roughness: how many octaves, each 1.99 times as fine as the one before, and the ratio of their
    heights; "windy" has its own. Nothing is left out for the size of a pixel.
    """

    kind: str
    octaves: int = 8
    roughness: float = 0.5
    mapping: PointMapping = field(default_factory=PointMapping)
    needs_uv: ClassVar[bool] = False

    @property
    def heights(self) -> Array:
        """(octaves + 1,) the heights of the octaves and of the one after them."""
        return self.roughness ** np.arange(self.octaves + 1.0)

    def mean(self) -> Array:
        """0 but for "wrinkled", of whose octaves pbrt takes the mean for 0.2 of their height."""
        return np.full(3, 0.2 * self.heights.sum() if self.kind == "wrinkled" else 0.0)

    def map_colors(self, change: ColorMap) -> NoiseTexture:
        return self


VEINS = 1.5 * np.array(
    [[0.58, 0.58, 0.6], [0.58, 0.58, 0.6], [0.58, 0.58, 0.6], [0.5, 0.5, 0.5], [0.6, 0.59, 0.58],
     [0.58, 0.58, 0.6], [0.58, 0.58, 0.6], [0.2, 0.2, 0.33], [0.58, 0.58, 0.6]]
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Marble:
    """pbrt's `marble`: veins across the texture's y, bent by noise. colors: (9, 3) of the spline across one.

    octaves, roughness: as of `NoiseTexture`. scale: of the points. variation: how far the noise bends.
    """

    octaves: int = 8
    roughness: float = 0.5
    scale: float = 1.0
    variation: float = 0.2
    mapping: PointMapping = field(default_factory=PointMapping)
    colors: Array = field(default_factory=lambda: VEINS)
    needs_uv: ClassVar[bool] = False

    def color(self, t: Array) -> Array:
        """(3, n) across a vein, t (n,) in [0, 1]: four of the colours in turn as a cubic Bezier curve."""
        pieces = len(self.colors) - 3
        first = np.clip(np.floor(t * pieces), 0, pieces - 1).astype(np.int64)
        t = t * pieces - first
        weights = ((1 - t) ** 3, 3 * (1 - t) ** 2 * t, 3 * (1 - t) * t**2, t**3)
        parts = [weight * self.colors[first + i].T for i, weight in enumerate(weights)]
        return parts[0] + parts[1] + parts[2] + parts[3]

    def mean(self) -> Array:
        phase = (np.arange(4096.0) + 0.5) * (2 * np.pi / 4096)
        return self.color(0.5 + 0.5 * np.sin(phase)).mean(axis=1)

    def map_colors(self, change: ColorMap) -> Marble:
        return replace(self, colors=change(self.colors))


# An array (3,) is a constant.
Texture = (
    Array | ImageTexture | Checkerboard | Product | Mix | DirectionMix | Bilerp | Dots | NoiseTexture | Marble
)


def needs_uv(*textures: Texture) -> bool:
    """Whether a texture depends on texture coordinates."""
    return any(not isinstance(one, np.ndarray) and one.needs_uv for one in textures)


def mean(texture: Texture) -> Array:
    """(3,) the mean of a texture over its surface, for programs that draw one colour."""
    return texture if isinstance(texture, np.ndarray) else texture.mean()


def map_colors(texture: Texture, change: ColorMap) -> Texture:
    """The texture with `change` applied to the colours (..., 3) of its parts."""
    return change(texture) if isinstance(texture, np.ndarray) else texture.map_colors(change)
