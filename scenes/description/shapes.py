"""Shapes in world space, with their material and emission."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.materials import Material
from scenes.errors import Location

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Emission:
    """Diffuse area emission. radiance: (3,) float64, W/(m^2 sr), `scale`, `power` and the like already in it.

    image: (h, w, 3) float64, what to multiply the radiance by over a rectangle, first row at v = 1; looked up
    bilinearly and clamped at the edges, as pbrt does.
    """

    radiance: Array
    two_sided: bool = False
    image: Array | None = None


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles; a face's normal is (p1-p0) x (p2-p0), turned round where `reverse` is set.

    vertices: (m, 3) float64, world space. faces: (t, 3) int64. uv: (m, 2), or None: every face is (0,0),
    (1,0), (1,1), as in pbrt.
    """

    vertices: Array
    faces: NDArray[np.int64]
    reverse: bool = False
    uv: Array | None = None


@dataclass(frozen=True, eq=False)
class BilinearMesh:
    """Planar bilinear patches, corners in pbrt's order p00 p10 p01 p11; normal (p10-p00) x (p01-p00), turned
    if `reverse`.

    vertices: (m, 3) float64, world space. faces: (q, 4) int64. uv: (m, 2), or None: a patch's own parameters,
    p10 at (1, 0).
    """

    vertices: Array
    faces: NDArray[np.int64]
    reverse: bool = False
    uv: Array | None = None


@dataclass(frozen=True, eq=False)
class Sphere:
    """A full sphere; its normal points outwards, inwards if `reverse`. center: (3,) float64, world space.

    frame: (3, 3) float64, its columns the object's axes in world space, unit and orthogonal (left-handed
    under a mirror); None but where a texture is laid on them.
    """

    center: Array
    radius: float
    reverse: bool = False
    frame: Array | None = None


@dataclass(frozen=True, eq=False)
class Disk:
    """A full disk. center: (3,) float64; normal: (3,) float64, unit, the side it emits on
    (`ReverseOrientation` is already in it).

    frame: as a sphere's.
    """

    center: Array
    normal: Array
    radius: float
    frame: Array | None = None


Geometry = TriangleMesh | BilinearMesh | Sphere | Disk


@dataclass(frozen=True, eq=False)
class ShapeDescription:
    """One `Shape` of the scene file. `where` is for messages and no part of the content."""

    geometry: Geometry
    material: Material
    emission: Emission | None = None
    where: Location | None = field(default=None, metadata={"content": False})

    def scaled(self, factor: float) -> ShapeDescription:
        """The shape with its emission multiplied."""
        if self.emission is None:
            return self
        return replace(self, emission=replace(self.emission, radiance=self.emission.radiance * factor))
