"""Lights on parts of spheres, disks and cylinders under any affine map: `area` and `solid-angle`.

`area` draws points that are uniform in object space; their density in the world is divided by the map's
stretch |det M| |M^-T n| there. `solid-angle` draws directions uniform in the cone of the whole sphere or disk
of object space, whose density turns with |M^-1 wi|^3 |det M|; those that miss the part are without light.
Cylinders have no such cone: theirs are points by area, converted, as pbrt does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.geometry import quadrics
from renderer.geometry.analytic import AnalyticPrimitives, join, primitives_of
from renderer.interfaces.light import LIGHTS, DirectionSampler, Index, LightExample, LightKind, Parts, Source
from renderer.light_sampling.area import Emitters, geometries, receivers
from renderer.lights.disk import DiskLights, DiskSolidAngle
from renderer.lights.sphere import SphereLights, SphereSolidAngle
from renderer.math.vectors import Floats, dot, gather, normalize
from renderer.records import LightSample
from scenes.arrays import Mask
from scenes.description.materials import Diffuse
from scenes.description.shapes import Disk, Emission, Quadric, ShapeDescription, Sphere
from scenes.errors import SceneError

SAME_POINT = 1e-6  # of a distance: roots of grazing rays are good to 1e-8
# Of the distance to the farther root: a root nearer than this is the surface that a point lies on.
ON_SURFACE = 1e-10


@dataclass(frozen=True, eq=False)
class QuadricLights:
    """surface: the k lights as primitives. area: (k,) in object space. determinant: (k,) of the maps to
    object space. whole: techniques by form for the k whole spheres and disks of object space, lit on both
    sides; cylinders have none.
    """

    parts: Parts
    emitters: Emitters
    surface: AnalyticPrimitives
    area: Floats
    determinant: Floats
    whole: Mapping[str, DirectionSampler]

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        return {"area": QuadricArea(self), "solid-angle": QuadricSolidAngle(self)}

    @classmethod
    def make(cls, sources: Sequence[Source], index: Sequence[int]) -> QuadricLights:
        """The lights of a scene; SceneError for a shape without area."""
        made = geometries(sources, Quadric)
        for source, geometry in zip(sources, made, strict=True):
            if not geometry.area_in_object > 0:
                raise SceneError("a light has no area", source.where)
        own = join([one for g in made for one in primitives_of(g, 0)])
        rows = np.stack([own.x, own.y, own.z])
        determinant = np.abs(np.linalg.det(rows.transpose(2, 0, 1)))
        area = np.array([g.area_in_object for g in made])
        return cls(Parts.whole(index), Emitters.of(sources), own, area, determinant, _whole(made))

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats | None:
        return None

    def position(self, index: Index, u: Floats) -> tuple[Floats, Floats]:
        """Points (3, n), uniform in object space, and the emitting unit normals (3, n) there."""
        which = np.asarray(index, dtype=np.int64)
        p, normal = np.zeros((3, which.size)), np.zeros((3, which.size))
        for form, rows in self.surface.quadrics_among(which):
            own = which[rows]
            axes = self.surface.axes(own)
            local, n = quadrics.positions(form, self.surface.part(own), u.take(rows, axis=1))
            p[:, rows] = quadrics.to_world(*axes, local) + self.surface.origin.take(own, axis=1)
            normal[:, rows] = quadrics.normal_to_world(*axes, n) * self.surface.side.take(own)
        return p, normal

    def emits(self, index: Index, cos_light: Floats) -> Mask:
        """(n,): whether a light sends light from its side of cos_light (n,)."""
        return self.emitters.emits(index, cos_light)

    def intersect(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats, Floats]:
        """Distance (n,) to the surface that a ray meets first, inf where that does not emit; cosine (n,) and
        normal (3, n) there.
        """
        dist, normal = self.first(index, origin, wi)
        cos_light = -dot(wi, normal)
        return np.where(self.emits(index, cos_light), dist, np.inf), cos_light, normal

    def first(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Distance (n,) to the surface that a ray meets first, lit or not, and the normal (3, n) there. A
        root at the ray's start counts as the surface that the ray leaves.
        """
        which = np.asarray(index, dtype=np.int64)
        dist, normal = np.full(which.size, np.inf), np.zeros((3, which.size))
        for form, rows in self.surface.quadrics_among(which):
            own = which[rows]
            axes = self.surface.axes(own)
            p = self.surface.in_object(own, origin.take(rows, axis=1))
            q = quadrics.to_object(*axes, wi.take(rows, axis=1))
            near, far = quadrics.roots(form, self.surface.part(own), p, q)
            at_start = ON_SURFACE * np.where(far > 0, far, 0.0)
            t = np.where(near > at_start, near, np.where(far > 0, far, np.inf))
            _, n = quadrics.onto(form, self.surface.part(own), p + q * np.where(t < np.inf, t, 0.0))
            normal[:, rows] = quadrics.normal_to_world(*axes, n) * self.surface.side.take(own)
            dist[rows] = t
        return dist, normal

    def density(self, index: Index, normal: Floats) -> Floats:
        """(n,): density in 1/m^2 of the points of `area` in the world, where the unit normal is `normal` (3,
        n).

        |det M| |M^-T n| of the object's unit normal n equals |det M| / |M^T N| of the world's N.
        """
        which = np.asarray(index, dtype=np.int64)
        x, y, z = self.surface.axes(which)
        units = np.eye(3)[:, :, None] * np.ones(which.size)
        a, b, c = (dot(quadrics.to_world(x, y, z, unit), normal) for unit in units)
        length = np.sqrt(a * a + b * b + c * c)
        return self.determinant.take(which) * length / self.area.take(which)


def _whole(made: Sequence[Quadric]) -> dict[str, DirectionSampler]:
    """Techniques for the whole spheres and disks of object space, one for each form in `made`, lit on both
    sides.
    """
    black, lit = Diffuse(np.zeros(3)), Emission(np.ones(3), two_sided=True)
    axis = np.array([0.0, 0.0, 1.0])
    balls: list[Source] = [ShapeDescription(Sphere(np.zeros(3), g.radius), black, lit) for g in made]
    plates: list[Source] = [ShapeDescription(Disk(axis * g.zmin, axis, g.radius), black, lit) for g in made]
    number = range(len(made))
    return {
        "sphere": SphereSolidAngle(SphereLights.make(balls, number)),
        "disk": DiskSolidAngle(DiskLights.make(plates, number)),
    }


@dataclass(frozen=True, eq=False)
class QuadricArea:
    """Points uniform over the surface in object space. Weights are unbounded as the distance goes to 0."""

    lights: QuadricLights

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        li = self.lights
        y, ny = li.position(index, u)
        d = y - ref_p
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            d2 = dot(d, d)
            dist = np.sqrt(d2)
            wi = d / dist
            cos_light = -dot(wi, ny)
            pdf = d2 * li.density(index, ny) / np.abs(cos_light)
        valid = li.emits(index, cos_light) & (pdf > 0) & (pdf < np.inf)
        # The goal of a shadow ray never hides itself: its own nearer side is looked for here.
        valid &= li.first(index, ref_p, wi)[0] > dist * (1 - SAME_POINT)
        return LightSample(wi, dist, ny, gather(li.emitters.radiance, index), pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        dist, cos_light, normal = self.lights.intersect(index, ref_p, wi)
        hit = dist < np.inf
        with np.errstate(divide="ignore", invalid="ignore"):
            pdf = np.where(hit, dist, 0.0) ** 2 * self.lights.density(index, normal) / np.abs(cos_light)
        return np.where(hit, pdf, 0.0)


@dataclass(frozen=True, eq=False)
class QuadricSolidAngle:
    """Directions uniform in solid angle of object space, over the whole sphere or disk that the light is a
    part of. A cylinder is sampled by area.
    """

    lights: QuadricLights

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        li, which = self.lights, np.asarray(index, dtype=np.int64)
        by_area = QuadricArea(li).sample_direction(index, ref_p, ref_n, u)
        wi, pdf = by_area.wi, by_area.pdf
        dist, normal, valid = by_area.dist, by_area.normal, by_area.valid
        for form, rows in li.surface.quadrics_among(which):
            if form not in li.whole:
                continue
            own = which[rows]
            axes, p = li.surface.axes(own), ref_p.take(rows, axis=1)
            local = li.surface.in_object(own, p)
            seen = li.whole[form].sample_direction(own, local, local, u.take(rows, axis=1))
            wi[:, rows] = normalize(quadrics.to_world(*axes, seen.wi))
            dist[rows], _, normal[:, rows] = li.intersect(own, p, wi.take(rows, axis=1))
            pdf[rows] = seen.pdf * self._turned(own, wi.take(rows, axis=1))
            valid[rows] = seen.valid & (dist[rows] < np.inf) & (pdf[rows] > 0) & (pdf[rows] < np.inf)
        return LightSample(wi, dist, normal, by_area.radiance, pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        li, which = self.lights, np.asarray(index, dtype=np.int64)
        out = QuadricArea(li).pdf_direction(index, ref_p, ref_n, wi)
        for form, rows in li.surface.quadrics_among(which):
            if form not in li.whole:
                continue
            own, d = which[rows], wi.take(rows, axis=1)
            local = li.surface.in_object(own, ref_p.take(rows, axis=1))
            along = normalize(quadrics.to_object(*li.surface.axes(own), d))
            pdf = li.whole[form].pdf_direction(own, local, local, along) * self._turned(own, d)
            out[rows] = np.where(out[rows] > 0, pdf, 0.0)
        return out

    def _turned(self, which: NDArray[np.int64], wi: Floats) -> Floats:
        """(n,): solid angle of object space for each of the world, about directions wi (3, n)."""
        along = quadrics.to_object(*self.lights.surface.axes(which), wi)
        return self.lights.determinant.take(which) / dot(along, along) ** 1.5


def _examples() -> list[LightExample]:
    black, lit = Diffuse(np.zeros(3)), Emission(np.array([3.0, 2.0, 1.0]))
    center = np.array([0.0, 2.0, 0.0])
    # z of object space points down, so that disks shine on what lies below; sheared and stretched
    down = np.array([[0.7, 0.2, 0.0, 0.0], [0.1, 0.0, -1.0, 2.0], [0.0, 0.6, 0.3, 0.0]])
    round_ = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 2.0], [0.0, 1.0, 0.0, 0.0]])
    p, n = receivers(center, 0.6)
    made = {
        "an ellipsoid": (Quadric("sphere", down, 0.6, -0.6, 0.6), [0, 2, 5]),
        "a bowl": (Quadric("sphere", round_, 0.5, 0.1, 0.45, phimax=300.0), [0, 2]),
        "a ring": (Quadric("disk", down, 0.7, 0.1, 0.1, inner=0.3, phimax=250.0), [0, 2, 5]),
        "a sheared tube": (Quadric("cylinder", down[:, [2, 0, 1, 3]], 0.3, -0.5, 0.6), [1, 2]),
    }
    examples = [
        LightExample(name, ShapeDescription(g, black, lit), p[:, at], n[:, at])
        for name, (g, at) in made.items()
    ]
    slit = Quadric("cylinder", round_, 0.5, -0.4, 0.4, phimax=320.0)
    both = ShapeDescription(slit, black, replace(lit, two_sided=True))
    within = np.stack([center, p[:, 2]], axis=1)
    return [*examples, LightExample("a tube with a slit, both sides", both, within, n[:, :2])]


ABSENT = {"projected-solid-angle": "only polygons are sampled so, and a quadric is none"}
LIGHTS.add(
    "quadric",
    LightKind(
        Quadric,
        QuadricLights.make,
        "quadrics",
        ("area", "solid-angle"),
        _examples,
        ABSENT,
        closed_form=False,
    ),
)
