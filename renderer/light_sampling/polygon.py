"""Rectangular and triangular lights: `projected-solid-angle`, and irradiance in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from renderer.interfaces.light import Index
from renderer.light_sampling.area import Emitters
from renderer.math.vectors import Floats, dot, gather
from renderer.records import LightSample
from renderer.spherical.projected import projected_solid_angle, sample


@runtime_checkable
class Polygons(Protocol):
    """Convex planar lights."""

    @property
    def emitters(self) -> Emitters:
        """The emission of the lights."""
        ...

    @property
    def normal(self) -> Floats:
        """(3, k) unit, the emitting side."""
        ...

    def corners(self, index: Index, p: Floats) -> tuple[Floats, Floats]:
        """The first corner (3, n) relative to p (3, n), and the others as offsets from the first, (3, v - 1,
        n) or (3, v - 1, 1).
        """
        ...

    def intersect(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """The distance (n,) and the cosine (n,); see `Surface`."""
        ...


def irradiance(lights: Polygons, index: Index, ref_p: Floats, ref_n: Floats) -> Floats:
    """Irradiance (3, n) in W/m^2 at ref_p (3, n) facing ref_n; 0 behind the light and in its plane."""
    corner, others = lights.corners(index, ref_p)
    lit = lights.emitters.emits(index, -dot(corner, gather(lights.normal, index)))
    e = np.where(lit, projected_solid_angle(corner, others, ref_n), 0.0)
    return gather(lights.emitters.radiance, index) * e


@dataclass(frozen=True, eq=False)
class ProjectedSolidAngle:
    """Directions with pdf = cos / E, so that all samples of an unshadowed diffuse surface are equal
    [peters2021].

    E is the projected solid angle above the horizon. Where E is 0 no sample is valid, and none would bring
    light.
    """

    lights: Polygons

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        li = self.lights
        normal = gather(li.normal, index)
        corner, others = li.corners(index, ref_p)
        height = -dot(corner, normal)
        wi, cosine, e = sample(u, corner, others, ref_n)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            dist = np.abs(height) / np.abs(dot(wi, normal))
            pdf = cosine / e
        valid = (e > 0) & (pdf > 0) & (pdf < np.inf) & (dist < np.inf) & li.emitters.emits(index, height)
        return LightSample(wi, dist, normal, gather(li.emitters.radiance, index), pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        corner, others = self.lights.corners(index, ref_p)
        e = projected_solid_angle(corner, others, ref_n)
        cosine = dot(ref_n, wi)
        hit = (self.lights.intersect(index, ref_p, wi)[0] < np.inf) & (cosine > 0) & (e > 0)
        return np.where(hit, cosine / np.where(hit, e, 1.0), 0.0)
