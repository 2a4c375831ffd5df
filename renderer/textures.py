"""Textures as pbrt-v4 defines them: constants, images, patterns, noise, and combinations of these.

Nothing is prefiltered: the samples of a pixel average what varies within it [pharr2023, sec. 10.4].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch

import numpy as np

from renderer.math.noise import fbm, noise, turbulence
from renderer.math.vectors import Floats, dot
from renderer.records import SurfaceHit
from renderer.spherical.octahedral import wrapped_texels
from scenes.arrays import Index, Mask
from scenes.description.textures import (
    Bilerp,
    Checkerboard,
    CylindricalMapping,
    DirectionMix,
    Dots,
    ImageTexture,
    Marble,
    Mix,
    NoiseTexture,
    PlanarMapping,
    PointMapping,
    Product,
    SphericalMapping,
    Texture,
    UVMapping,
)


@dataclass(frozen=True, eq=False)
class Places:
    """Places at which textures are evaluated. uv: (2, n) coordinates. p: (3, n) points. n: (3, n) geometric
    normals, of either side.
    """

    uv: Floats
    p: Floats
    n: Floats

    @staticmethod
    def of(hit: SurfaceHit, rows: Index) -> Places:
        """Some rows (n,) of points on surfaces."""
        uv = hit.uv.take(rows, axis=1) if hit.uv.shape[1] > 1 else np.zeros((2, rows.size))
        return Places(uv, hit.p.take(rows, axis=1), hit.n.take(rows, axis=1))


@singledispatch
def evaluate(texture: Texture, at: Places) -> Floats:
    """The values (3, n) of a texture."""
    raise TypeError(f"no values of a {type(texture).__name__} are known")


@evaluate.register
def _(texture: np.ndarray, at: Places) -> Floats:
    return np.repeat(texture.astype(np.float64)[:, None], at.p.shape[1], axis=1)


@evaluate.register
def _(texture: Product, at: Places) -> Floats:
    return evaluate(texture.first, at) * evaluate(texture.second, at)


@evaluate.register
def _(texture: Mix, at: Places) -> Floats:
    amount = evaluate(texture.amount, at)
    return (1.0 - amount) * evaluate(texture.first, at) + amount * evaluate(texture.second, at)


@evaluate.register
def _(texture: Checkerboard, at: Places) -> Floats:
    even = np.floor(coordinates(texture.mapping, at)).sum(axis=0) % 2 == 0
    return np.where(even, evaluate(texture.first, at), evaluate(texture.second, at))


@evaluate.register
def _(texture: ImageTexture, at: Places) -> Floats:
    s, t = coordinates(texture.mapping, at)
    look = bilinear if texture.filter == "bilinear" else nearest
    return texture.value(look(texture.image, np.stack([s, 1.0 - t]), texture.wrap))


@evaluate.register
def _(texture: DirectionMix, at: Places) -> Floats:
    amount = np.abs(dot(at.n, texture.direction[:, None]))
    return amount * evaluate(texture.first, at) + (1.0 - amount) * evaluate(texture.second, at)


@evaluate.register
def _(texture: Bilerp, at: Places) -> Floats:
    s, t = coordinates(texture.mapping, at)
    left, right = (
        (1.0 - t) * low[:, None] + t * high[:, None]
        for low, high in ((texture.v00, texture.v01), (texture.v10, texture.v11))
    )
    return (1.0 - s) * left + s * right


@evaluate.register
def _(texture: Dots, at: Places) -> Floats:
    return np.where(
        _in_dot(coordinates(texture.mapping, at)),
        evaluate(texture.within, at),
        evaluate(texture.around, at),
    )


RADIUS = 0.35  # of a dot, in cells


def _in_dot(st: Floats) -> Mask:
    """(n,): whether points (2, n) lie in the dot of their cell."""
    cell = np.floor(st + 0.5)

    def random(s: float, t: float) -> Floats:
        return noise(np.stack([cell[0] + s, cell[1] + t, np.full(cell.shape[1], 0.5)]))

    shift = (0.5 - RADIUS) * np.stack([random(1.5, 2.8), random(4.5, 9.8)])
    off = st - (cell + shift)
    return (random(0.5, 0.5) > 0) & (off[0] * off[0] + off[1] * off[1] < RADIUS * RADIUS)


@evaluate.register
def _(texture: NoiseTexture, at: Places) -> Floats:
    p = coordinates(texture.mapping, at)
    if texture.kind == "windy":
        value = np.abs(fbm(0.1 * p, 0.5, 3)) * fbm(p, 0.5, 6)
    else:
        value = (fbm if texture.kind == "fbm" else turbulence)(p, texture.roughness, texture.octaves)
    return np.repeat(value[None], 3, axis=0)


@evaluate.register
def _(texture: Marble, at: Places) -> Floats:
    p = coordinates(texture.mapping, at) * texture.scale
    phase = p[1] + texture.variation * fbm(p, texture.roughness, texture.octaves)
    return texture.color(0.5 + 0.5 * np.sin(phase))


@singledispatch
def brightest(texture: Texture) -> Floats:
    """An upper bound (3,) on a texture's values; for noise, on their absolute values. It is 0 only for a
    black texture.
    """
    raise TypeError(f"no bound of a {type(texture).__name__} is known")


@brightest.register
def _(texture: np.ndarray) -> Floats:
    return texture


@brightest.register
def _(texture: Product) -> Floats:
    return brightest(texture.first) * brightest(texture.second)


@brightest.register
def _(texture: Checkerboard | Mix | DirectionMix) -> Floats:
    return np.maximum(brightest(texture.first), brightest(texture.second))


@brightest.register
def _(texture: Dots) -> Floats:
    return np.maximum(brightest(texture.around), brightest(texture.within))


@brightest.register
def _(texture: Bilerp) -> Floats:
    """Outside of [0, 1]^2 it goes on rising, as far as coordinates go: to 1e18 each."""
    corners = np.abs([texture.v00, texture.v01, texture.v10, texture.v11]).max(axis=0)
    return corners * 1e37


@brightest.register
def _(texture: NoiseTexture) -> Floats:
    return np.full(3, 1.5 * float(np.abs(texture.heights).sum()))


@brightest.register
def _(texture: Marble) -> Floats:
    return texture.colors.max(axis=0)


@brightest.register
def _(texture: ImageTexture) -> Floats:
    """An image's values rise or fall with the texels."""
    image = texture.image
    least = np.zeros(3) if texture.wrap == "black" else image.min(axis=(0, 1))
    return np.maximum(texture.value(least), texture.value(image.max(axis=(0, 1))))


@singledispatch
def coordinates(mapping: UVMapping | PointMapping, at: Places) -> Floats:
    """(s, t) (2, n) for a texture in two dimensions, or the points (3, n) for one in three."""
    raise TypeError(f"no coordinates by a {type(mapping).__name__} are known")


@coordinates.register
def _(mapping: UVMapping, at: Places) -> Floats:
    return np.stack([mapping.su * at.uv[0] + mapping.du, mapping.sv * at.uv[1] + mapping.dv])


@coordinates.register
def _(mapping: PointMapping, at: Places) -> Floats:
    return _in_texture(mapping, at)


@coordinates.register
def _(mapping: SphericalMapping, at: Places) -> Floats:
    x, y, z = _in_texture(mapping, at)
    return np.stack([np.arctan2(np.sqrt(x * x + y * y), z) / np.pi, np.arctan2(y, x) / (2 * np.pi) % 1.0])


@coordinates.register
def _(mapping: CylindricalMapping, at: Places) -> Floats:
    x, y, z = _in_texture(mapping, at)
    return np.stack([0.5 + np.arctan2(y, x) / (2 * np.pi), z])


@coordinates.register
def _(mapping: PlanarMapping, at: Places) -> Floats:
    p = _in_texture(mapping, at)
    s, t = dot(p, mapping.v1[:, None]), dot(p, mapping.v2[:, None])
    return np.stack([s + mapping.udelta, t + mapping.vdelta])


def _in_texture(mapping: PointMapping, at: Places) -> Floats:
    """The points (3, n) in the texture's own space."""
    rows = np.linalg.inv(mapping.from_texture)[:3]
    return np.stack([dot(row[:3, None], at.p) + row[3] for row in rows])


def nearest(image: Floats, st: Floats, wrap: str) -> Floats:
    """The texel (3, n) of each point. image: (h, w, 3). st: (2, n), with (0, 0) at the first texel's outer
    corner.
    """
    height, width, _ = image.shape
    return _texels(
        image, np.floor(st[1] * height).astype(np.int64), np.floor(st[0] * width).astype(np.int64), wrap
    )


def bilinear(image: Floats, st: Floats, wrap: str) -> Floats:
    """Values (3, n) interpolated between the centres of the four nearest texels. Arguments as for
    `nearest`.
    """
    height, width, _ = image.shape
    x, y = st[0] * width - 0.5, st[1] * height - 0.5
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    dx, dy = x - column, y - row
    upper = _texels(image, row, column, wrap) * (1.0 - dx) + _texels(image, row, column + 1, wrap) * dx
    lower = (
        _texels(image, row + 1, column, wrap) * (1.0 - dx) + _texels(image, row + 1, column + 1, wrap) * dx
    )
    return upper * (1.0 - dy) + lower * dy


def _texels(image: Floats, row: Index, column: Index, wrap: str) -> Floats:
    """Texels (3, n), where `wrap` decides on those outside the image: "repeat", "clamp", "black" or
    "octahedralsphere".
    """
    height, width, _ = image.shape
    if wrap == "octahedralsphere":
        column, row = wrapped_texels(column, row, width)
    if wrap == "repeat":
        r, c = row % height, column % width
    else:
        r, c = np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)
    out = np.ascontiguousarray(image[r, c].T)
    return np.where((r == row) & (c == column), out, 0.0) if wrap == "black" else out
