"""What the worker is given: plain dataclasses and arrays, in the space of an OpenGL camera.

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
    """A shape as triangles. positions, normals: (3 t, 3), three corners a triangle, normals unit and
    outwards.

    color: (3,) albedo, or a metal's reflectance at normal incidence. emission: (3,), W/(m^2 sr). roughness:
    alpha of a metal; None: diffuse.
    """

    positions: Array
    normals: Array
    color: Array
    emission: Array
    two_sided: bool = False
    roughness: float | None = None


@dataclass(frozen=True, eq=False)
class Lamp:
    """A light without size. kind: "point", "spot", "flat" (a point that falls off with the cosine to its
    axis) or "distant".

    power: (3,), W/sr, along the axis; of a distant one W/m^2. position: (3,). axis: (3,), unit, the way it
    shines. falloff, cone: of a spot, radians.
    """

    kind: str
    power: Array
    position: Array
    axis: Array
    falloff: float = 0.0
    cone: float = np.pi / 2


@dataclass(frozen=True, eq=False)
class Task:
    """An image to rasterise. ambient: (3,), the radiance that comes from all around; background: (h, w, 3),
    what is seen where nothing is.

    film: left, top, width and height of a pixel, at distance 1. unit: the scene's units in one of the task's.
    """

    width: int
    height: int
    film: tuple[float, float, float, float]
    surfaces: tuple[Surface, ...]
    lamps: tuple[Lamp, ...]
    ambient: Array
    background: Array
    unit: float
