"""Emission of area lights, and `area`, the technique that all of them have: points uniform over the
surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np

from renderer.interfaces.light import Index, Source
from renderer.math.vectors import Floats, dot, gather, normalize
from renderer.records import LightSample
from scenes.arrays import Mask
from scenes.description.shapes import Geometry, ShapeDescription

G = TypeVar("G", bound=Geometry)


def geometries(sources: Sequence[Source], kind: type[G]) -> list[G]:
    """The geometries of emitting shapes of one kind, in the order of the sources."""
    shapes = [s.geometry for s in sources if isinstance(s, ShapeDescription)]
    return [g for g in shapes if isinstance(g, kind)]


def receivers(center: Floats, size: float) -> tuple[Floats, Floats]:
    """Reference points (3, 6) and normals (3, 6) around a light at `center` (3,), for the contract tests:
    below, far, aside, grazing, near, and with the normal turned.
    """
    away = np.array(
        [[0, -2, 0], [30, -40, 10], [2, -1, 1], [3, -1e-2, 0.3], [0.1, -1e-2, 0.2], [0.3, -1.5, 0.1]]
    ).T
    n = np.array([[0, 1, 0], [0, 1, 0], [-1, 1, 0], [0, 1, 0], [0, 1, 0], [1, 0.1, 0]], dtype=np.float64).T
    return center[:, None] + away * size, normalize(n)


@dataclass(frozen=True, eq=False)
class Emitters:
    """Emission of area lights. radiance: (3, k). two_sided: (k,) bool."""

    radiance: Floats
    two_sided: Mask

    def emits(self, index: Index, cos_light: Floats) -> Mask:
        """(n,): whether a surface point sends light to its side at cos_light (n,), the cosine with the
        emitting normal.
        """
        if not self.two_sided.any():
            return cos_light > 0
        return (cos_light > 0) | (self.two_sided.take(index) & (cos_light < 0))

    def repeat(self, each: Sequence[int]) -> Emitters:
        """The emitters with each repeated as often as `each` says, for shapes of several lights."""
        return Emitters(
            self.radiance.repeat(each, axis=1),
            self.two_sided.repeat(each, axis=0),
        )

    @staticmethod
    def of(sources: Sequence[Source]) -> Emitters:
        """The emitters of a sequence of emitting shapes."""
        shapes = [s for s in sources if isinstance(s, ShapeDescription)]
        emissions = [s.emission for s in shapes if s.emission is not None]
        return Emitters(
            np.stack([e.radiance for e in emissions], axis=1).astype(np.float64),
            np.array([e.two_sided for e in emissions], dtype=np.bool_),
        )


@runtime_checkable
class Surface(Protocol):
    """The surface of a light: points on it, and the point that a ray meets first."""

    @property
    def emitters(self) -> Emitters:
        """The emission of the lights."""
        ...

    @property
    def area(self) -> Floats:
        """(k,) areas."""
        ...

    def emits(self, index: Index, ref_p: Floats, cos_light: Floats) -> Mask:
        """(n,): whether a surface point sends light to ref_p past the rest of its own surface."""
        ...

    def position(self, index: Index, u: Floats) -> tuple[Floats, Floats]:
        """Points (3, n) uniform over the surface, and the emitting unit normals (3, n) or (3, 1) there."""
        ...

    def intersect(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Distance (n,) to the emitting side that a ray meets first, inf for none, and the cosine
        (n,) there.
        """
        ...


@dataclass(frozen=True, eq=False)
class AreaSampling:
    """Points uniform over the light's surface: pdf = d^2 / (cos_light A) [pharr2023, sec. 6.1]. Weights are
    unbounded as d goes to 0.
    """

    surface: Surface

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        y, ny = self.surface.position(index, u)
        d = y - ref_p
        d2 = dot(d, d)
        # d = 0 (a point on the light itself) has no direction; the row is masked, its numbers never used.
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            dist = np.sqrt(d2)
            wi = d / dist
            cos_light = -dot(wi, ny)
            pdf = d2 / (np.abs(cos_light) * gather(self.surface.area, index))
        valid = self.surface.emits(index, ref_p, cos_light) & (pdf > 0) & (pdf < np.inf)
        return LightSample(wi, dist, ny, gather(self.surface.emitters.radiance, index), pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        dist, cos_light = self.surface.intersect(index, ref_p, wi)
        hit = dist < np.inf
        denominator = np.where(hit, np.abs(cos_light) * gather(self.surface.area, index), 1.0)
        return np.where(hit, np.where(hit, dist, 0.0) ** 2 / denominator, 0.0)
