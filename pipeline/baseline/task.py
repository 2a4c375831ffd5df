"""The worker's task: plain dataclasses and arrays, in the space of an OpenGL camera.

That space has the camera at its origin, x to the right, y up and the view along -z, and the farthest corner
in view at depth 1, so that float32 serves the camera rather than some far origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Surface:
    """A shape as triangles.

    positions, normals: (3 t, 3), three corners a triangle; normals unit and outwards. color: (3,), albedo, or
    a metal's reflectance at normal incidence. emission: (3,), W/(m^2 sr). roughness: alpha of a metal; None
    if diffuse.
    """

    positions: Array
    normals: Array
    color: Array
    emission: Array
    two_sided: bool = False
    roughness: float | None = None


@dataclass(frozen=True, eq=False)
class SizelessLight:
    """A light without size.

    power: (3,), W/sr along the axis; W/m^2 for a light at infinity. position: (3,), None at infinity.
    axis: (3,), unit, the direction it shines in; None for all directions. inner, outer: angles off the axis,
    in radians, at which a spot begins and ends to fade. linear: whether it fades with the cosine, or with the
    smoothstep of it.
    """

    power: Array
    position: Array | None
    axis: Array | None = None
    inner: float = 0.0
    outer: float = np.pi / 2
    linear: bool = False


@dataclass(frozen=True, eq=False)
class Task:
    """An image to rasterise.

    ambient: (3,), radiance from all directions. background: (h, w, 3), radiance of pixels without a surface.
    film: left, top, width and height of a pixel, at distance 1. unit: the scene's units in one of the task's.
    """

    width: int
    height: int
    film: tuple[float, float, float, float]
    surfaces: tuple[Surface, ...]
    lights: tuple[SizelessLight, ...]
    ambient: Array
    background: Array
    unit: float
