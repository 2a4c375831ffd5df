"""The sum of a scene's environments as one latitude-longitude image for Mitsuba, with its measured error.

pbrt takes the nearest texel of a square equal-area map, and Penumbra also of a latitude-longitude one.
Mitsuba has one environment at most, in latitude and longitude, and interpolates: its first and last rows lie
on the poles, its columns' middles at (i + 1/2) / width. So each of its texels gets the mean of the truth over
the cell around it, and the image is so fine that the ramps between texels are narrow. `compare` measures the
error that is left.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenes.arrays import Index
from scenes.description.lights import Environment
from scenes.description.shapes import Array

ROWS = 1024  # at least so many, so that a ramp is at most 0.35 degrees wide
MOST_ROWS = 2048  # 2048 x 4096 texels are 100 MB in float32
FINENESS = 8  # wanted: rows for one texel of the source
SUBCELLS = 2**12  # along a meridian, at least: four along each side of a cell of the coarsest image
HORIZON_ROWS = 4096  # of an image that depends on latitude only
COLUMNS = 256  # at least
PROBES = 2**16
DIRECTIONS = 12
QUADRATURE = 512  # parts of the truth from pole to pole, at least


@dataclass(frozen=True, eq=False)
class LatitudeLongitude:
    """An image in latitude and longitude.

    image: (rows, columns, 3), rows from pole to pole inclusive. frame: (3, 3), its axes in world space as
    columns. irradiance_error: the largest error of the irradiance of `DIRECTIONS` surfaces, over the largest
    irradiance. mean_error: the mean absolute error of radiance, over the mean radiance.
    """

    image: Array
    frame: Array
    irradiance_error: float
    mean_error: float


def radiance(environment: Environment, own: Array) -> Array:
    """pbrt's radiance (..., 3), in W/(m^2 sr). own: unit vectors (..., 3) in the environment's own space."""
    value = np.broadcast_to(environment.radiance, own.shape)
    if environment.image is not None:
        value = value * environment.image[_texel(environment, own)]
    return np.where(own[..., 2:] >= 0, value, 0.0) if environment.hemisphere else value


def _texel(environment: Environment, own: Array) -> tuple[Index, Index]:
    """Row and column of the nearest texel for directions in the light's own space."""
    assert environment.image is not None
    height, width = environment.image.shape[:2]
    place = equal_area_square(own) if environment.mapping == "equal-area" else _latitude_longitude(own)
    x, y = place[..., 0] * width, place[..., 1] * height
    return np.minimum(y.astype(np.int64), height - 1), np.minimum(x.astype(np.int64), width - 1)


def _latitude_longitude(d: Array) -> Array:
    """Coordinates (u, v) in [0, 1], (..., 2): the angle from +x towards +y, and the angle from +z."""
    angle = np.arctan2(d[..., 1], d[..., 0]) / (2 * np.pi)
    polar = np.arctan2(np.hypot(d[..., 0], d[..., 1]), d[..., 2]) / np.pi
    return np.stack([angle - np.floor(angle), polar], axis=-1)


def equal_area_square(d: Array) -> Array:
    """Map unit vectors (..., 3) to the square [0, 1]^2 by the equal-area octahedral map [pharr2023,
    3.8.3].
    """
    x, y, z = (np.abs(d[..., i]) for i in range(3))
    # 1 - |z| would cancel near the poles.
    r = np.hypot(x, y) / np.sqrt(1 + z)
    v = np.arctan2(y, x) * (2 / np.pi) * r
    u = r - v
    below = d[..., 2] < 0
    u, v = np.where(below, 1 - v, u), np.where(below, 1 - u, v)
    return (np.stack([np.copysign(u, d[..., 0]), np.copysign(v, d[..., 1])], axis=-1) + 1) / 2


@functools.lru_cache(maxsize=2)
def resampled(environments: tuple[Environment, ...]) -> LatitudeLongitude:
    """The sum of environments as one image, in the frame of the first with an image or a hemisphere."""
    first = next((one for one in environments if one.image is not None or one.hemisphere), environments[0])
    rows, columns = _size(environments)
    image = np.concatenate([_rows(environments, first.frame, rows, columns, j) for j in range(0, rows, 64)])
    return LatitudeLongitude(image, first.frame, *compare(environments, image, first.frame))


def _size(environments: Sequence[Environment]) -> tuple[int, int]:
    images = [one for one in environments if one.image is not None]
    if not images and len({one.frame.tobytes() for one in environments if one.hemisphere}) == 1:
        return HORIZON_ROWS + 1, COLUMNS
    if len(environments) == 1 and images[0].image is not None and images[0].mapping == "latitude-longitude":
        # Whole numbers of rows and columns for a texel: edges of texels fall on rows, and between columns.
        height, width = images[0].image.shape[:2]
        factor = max(1, min(-(-ROWS // height), 2 * MOST_ROWS // width))
        return height * factor + 1, width * max(factor, -(-COLUMNS // width))
    texels = [
        np.sqrt(4 * np.pi / (one.image.shape[0] * one.image.shape[1]))
        for one in images
        if one.image is not None
    ]
    wanted = FINENESS * np.pi / min(texels, default=np.pi)
    rows = int(min(MOST_ROWS, max(ROWS, 2 ** np.ceil(np.log2(wanted)))))
    return rows + 1, 2 * rows


def _rows(environments: Sequence[Environment], frame: Array, rows: int, columns: int, start: int) -> Array:
    """64 rows of the image from `start` on: means over cells, weighted by solid angle."""
    step = np.pi / (rows - 1)
    cells = np.arange(start, min(start + 64, rows))
    parts = 2 * max(
        1, round(SUBCELLS / (rows - 1) / 2)
    )  # even: edges of texels may lie on the middle of a cell
    inner = (np.arange(parts) + 0.5) / parts - 0.5
    polar = (cells[:, None] + inner).ravel() * step
    weight = np.where((polar > 0) & (polar < np.pi), np.sin(polar), 0.0)
    azimuth = (np.arange(columns)[:, None] + 0.5 + inner).ravel() * (2 * np.pi / columns)
    value = _sum(environments, _directions(polar[:, None], azimuth[None]), frame) * weight[:, None, None]
    blocks = value.reshape(len(cells), parts, columns, parts, 3).sum(axis=(1, 3))
    return blocks / (parts * weight.reshape(-1, parts).sum(axis=1))[:, None, None]


def _directions(polar: Array, azimuth: Array) -> Array:
    sine = np.sin(polar)
    parts = (sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar) + 0 * azimuth)
    return np.stack(parts, axis=-1)


def _sum(environments: Sequence[Environment], d: Array, frame: Array) -> Array:
    """The summed radiance of all environments towards unit vectors d (..., 3) in `frame`."""
    own = (d if one.frame is frame else d @ (frame.T @ one.frame) for one in environments)
    return functools.reduce(np.add, (radiance(one, its) for one, its in zip(environments, own, strict=True)))


def interpolated(image: Array, d: Array) -> Array:
    """Mitsuba's interpolated values (m, 3) of an image towards unit vectors d (m, 3) in its own frame."""
    rows, columns = image.shape[:2]
    place = _latitude_longitude(d) * (columns, rows - 1) - (0.5, 0.0)
    low = np.floor(place).astype(np.int64)
    i, j = low[:, 0], np.minimum(low[:, 1], rows - 2)
    a, b = (place[:, 0] - i)[:, None], (place[:, 1] - j)[:, None]
    upper = (1 - a) * image[j, i % columns] + a * image[j, (i + 1) % columns]
    lower = (1 - a) * image[j + 1, i % columns] + a * image[j + 1, (i + 1) % columns]
    return (1 - b) * upper + b * lower


def compare(environments: Sequence[Environment], image: Array, frame: Array) -> tuple[float, float]:
    """Measure `irradiance_error` and `mean_error` of an image, see LatitudeLongitude.

    Irradiance is summed over parts of the truth's own texels, which no edge cuts, and over the image's cells.
    Each sum is exact to about 1e-6, so that their difference is the error of resampling.
    """
    normals = fibonacci(DIRECTIONS)
    truth = functools.reduce(np.add, (_irradiance(*_parts(one), normals) for one in environments))
    ours = _irradiance(*_cells(image, frame), normals)
    d = fibonacci(PROBES)
    value = _sum(environments, d, frame)
    if not truth.max() > 0:
        return 0.0, 0.0
    error = np.abs(interpolated(image, d) - value)
    return float(np.abs(ours - truth).max() / truth.max()), float(error.mean() / value.mean())


def _irradiance(d: Array, value: Array, normals: Array) -> Array:
    """Irradiance (k, 3) of surfaces. d: (m, 3). value: (m, 3), radiance times solid angle. normals: (k,
    3).
    """
    return np.stack([np.maximum(d @ normal, 0.0) @ value for normal in normals])


def _cells(image: Array, frame: Array) -> tuple[Array, Array]:
    """Directions of the image's texels, and the integrals of their tents when it is interpolated, (m, 3)
    each.
    """
    rows, columns = len(image), len(image[0])
    step, wide = np.pi / (rows - 1), 2 * np.pi / columns
    polar = np.linspace(0.0, np.pi, rows)
    weight = np.sin(polar) * 2 * (1 - np.cos(step)) / step  # the integral of a tent times the sine
    weight[[0, -1]] = 1 - np.sin(step) / step
    azimuth = (np.linspace(0.0, columns - 1.0, columns) + 0.5) * wide
    d = _directions(polar[:, None], azimuth[None]) @ frame.T
    return d.reshape(-1, 3), (image * (weight * wide)[:, None, None]).reshape(-1, 3)


def _parts(environment: Environment) -> tuple[Array, Array]:
    """Directions of equal parts of the environment's texels, and their radiance times solid angle."""
    height, width = (2, 4) if environment.image is None else environment.image.shape[:2]
    by_latitude = environment.image is None or environment.mapping != "equal-area"
    cut = [2 * -(-QUADRATURE // (2 * count)) for count in (height, width // 2 if by_latitude else width)]
    y, x = (np.arange(count * n) + 0.5 for count, n in zip((height, width), cut, strict=True))
    v, u = (y / len(y))[:, None], (x / len(x))[None]
    if by_latitude:
        edges = np.cos(np.arange(len(y) + 1) * (np.pi / len(y)))
        own, share = _directions(np.pi * v, 2 * np.pi * u), (edges[:-1] - edges[1:])[:, None] / (2 * len(x))
    else:
        own, share = equal_area_direction(u, v), np.full((1, 1), 1 / (len(x) * len(y)))
    value = np.broadcast_to(environment.radiance, own.shape)
    if environment.image is not None:
        value = value * environment.image.repeat(cut[0], axis=0).repeat(cut[1], axis=1)
    if environment.hemisphere:  # a part on the horizon is cut in half by it
        share = share * np.where(np.abs(own[..., 2]) < 1e-12, 0.5, own[..., 2] > 0)
    return (own @ environment.frame.T).reshape(-1, 3), (value * (4 * np.pi * share)[..., None]).reshape(-1, 3)


def equal_area_direction(u: Array, v: Array) -> Array:
    """Unit vectors (..., 3) of points u, v in [0, 1], broadcast: the inverse of `equal_area_square`."""
    x, y = np.broadcast_arrays(2 * u - 1, 2 * v - 1)
    ax, ay = np.abs(x), np.abs(y)
    inside = 1 - ax - ay
    r = 1 - np.abs(inside)
    angle = (np.divide(ay - ax, r, out=np.zeros_like(r), where=r > 0) + 1) * (np.pi / 4)
    flat = r * np.sqrt(2 - r * r)
    parts = (
        np.copysign(np.cos(angle), x) * flat,
        np.copysign(np.sin(angle), y) * flat,
        np.copysign(1 - r * r, inside),
    )
    return np.stack(parts, axis=-1)


def fibonacci(count: int) -> Array:
    """Unit vectors (count, 3), spread evenly over the sphere."""
    i = np.arange(count)
    z = 1 - (2 * i + 1) / count
    azimuth = i * (np.pi * (3 - np.sqrt(5.0)))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(azimuth), r * np.sin(azimuth), z], axis=-1)
