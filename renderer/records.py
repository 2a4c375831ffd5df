"""Records that the stages of the wavefront hand on."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from renderer.math.vectors import Floats, dot
from scenes.arrays import Index, Mask


@dataclass(frozen=True, eq=False)
class SurfaceHit:
    """Points on surfaces, seen from outside along wo.

    p: (3, n) points. n: (3, n) unit geometric normals on the side of wo. wo: (3, n) unit, leaving the
    surface. shape: (n,) number of the scene's shape, -1 for none. triangle, primitive: (n,) number of the
    triangle or analytic primitive, -1 for none. uv: (2, n) texture coordinates; zeros (2, 1) in a scene
    without textures. front: (n,), or (1,) for all, whether wo lies outside by the surface's orientation.
    tangent: (3, n) dp/du of any length, 0 for none; zeros (3, 1) in a scene of isotropic materials.
    shading_n: (3, n) unit shading normals on the side of wo, None in a scene shaded by geometric normals.
    material: (n,) the row of each point's material, None in a scene without mixes.
    """

    p: Floats
    n: Floats
    wo: Floats
    shape: Index
    triangle: Index
    primitive: Index
    uv: Floats
    front: Mask = field(default_factory=lambda: np.ones(1, dtype=np.bool_))
    tangent: Floats = field(default_factory=lambda: np.zeros((3, 1)))
    shading_n: Floats | None = None
    material: Index | None = None

    @property
    def ns(self) -> Floats:
        """(3, n): the normals of BSDFs and their cosines. Rays start off surfaces along `n`."""
        return self.n if self.shading_n is None else self.shading_n

    def normal_towards(self, wi: Floats) -> Floats:
        """(3, n): the geometric normals on the side of wi (3, n), which transmission turns over."""
        return np.where(dot(wi, self.n) < 0, -self.n, self.n)

    def take(self, rows: Index) -> SurfaceHit:
        """The points of some rows (m,)."""
        return SurfaceHit(
            self.p.take(rows, axis=1),
            self.n.take(rows, axis=1),
            self.wo.take(rows, axis=1),
            self.shape[rows],
            self.triangle[rows],
            self.primitive[rows],
            self.uv if self.uv.shape[1] == 1 else self.uv.take(rows, axis=1),
            self.front if self.front.size == 1 else self.front[rows],
            self.tangent if self.tangent.shape[1] == 1 else self.tangent.take(rows, axis=1),
            None if self.shading_n is None else self.shading_n.take(rows, axis=1),
            None if self.material is None else self.material[rows],
        )

    def of_one_material(self) -> SurfaceHit:
        """The points with the rows of their materials as their shapes, by which materials are numbered."""
        return self if self.material is None else replace(self, shape=self.material, material=None)


@dataclass(frozen=True, eq=False)
class BSDFSample:
    """Directions that surfaces scatter along.

    wi: (3, n) unit. value: (3, n) f in 1/sr. pdf: (n,) in 1/sr; a sample of pdf 0 counts as zero. specular:
    (n,) whether the sample follows a delta lobe, None for nowhere. Only value |cos| / pdf has a meaning
    there: the lobe's share of the light.
    """

    wi: Floats
    value: Floats
    pdf: Floats
    specular: Mask | None = None


@dataclass(frozen=True, eq=False)
class LightSample:
    """Directions to light.

    wi: (3, n) unit. dist: (n,), inf for a light at infinity. normal: (3, n) or (3, 1), the light's unit
    normal, of either side; -wi where it has none. radiance: (3, n) or (3, 1), Le towards the reference point;
    for a light of a single direction, the irradiance on a surface that faces it. pdf: (n,) 1/sr; 1 for a
    light of a single direction. valid: (n,) bool; a sample that is not valid counts as zero, and its other
    fields mean nothing.
    """

    wi: Floats
    dist: Floats
    normal: Floats
    radiance: Floats
    pdf: Floats
    valid: Mask


@dataclass(frozen=True)
class RayCounts:
    """Numbers of rays traced, without those that the plan leaves out."""

    primary: int = 0
    shadow: int = 0

    def __add__(self, other: RayCounts) -> RayCounts:
        return RayCounts(self.primary + other.primary, self.shadow + other.shadow)


@dataclass(frozen=True)
class Seconds:
    """Wall-clock seconds of the parts of a render. `cpu`: processor seconds of the passes alone."""

    build: float
    plan: float
    render: float
    cpu: float
