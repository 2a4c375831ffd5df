"""Spherical lights: `area`, and `solid-angle` by the cone that they subtend, or all directions from inside.

1 - cos(theta) is carried instead of cos(theta): the cone of a light of 1e-6 rad then keeps all its digits,
with no branch [pharr2023, sec. 6.2.4 switches to a Taylor series instead]. Squares of distances to the
surface are taken as products, (d - r)(d + r), so that a point 1e-12 outside is as good as any. A point on the
surface, as far as float64 can tell, counts as inside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from renderer.interfaces.light import LIGHTS, DirectionSampler, Index, LightExample, LightKind, Parts, Source
from renderer.light_sampling.area import AreaSampling, Emitters, geometries, receivers
from renderer.math.vectors import Floats, combine, dot, frame_about, gather
from renderer.math.warp import uniform_sphere
from renderer.records import LightSample
from renderer.spherical.disk_irradiance import sphere_irradiance
from scenes.arrays import Mask
from scenes.description.materials import Diffuse
from scenes.description.shapes import Emission, ShapeDescription, Sphere


@dataclass(frozen=True, eq=False)
class SphereLights:
    """center: (3, k). radius: (k,). side: (k,), 1 where the outside emits, -1 where the inside does."""

    parts: Parts
    emitters: Emitters
    center: Floats
    radius: Floats
    side: Floats

    @property
    def area(self) -> Floats:
        """(k,) areas."""
        return 4 * np.pi * self.radius * self.radius

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        return {"area": AreaSampling(self), "solid-angle": SphereSolidAngle(self)}

    @classmethod
    def make(cls, sources: Sequence[Source], index: Sequence[int]) -> SphereLights:
        spheres = geometries(sources, Sphere)
        center = np.stack([s.center for s in spheres], axis=1)
        radius = np.array([s.radius for s in spheres], dtype=np.float64)
        side = np.array([-1.0 if s.reverse else 1.0 for s in spheres])
        return cls(Parts.whole(index), Emitters.of(sources), center, radius, side)

    def position(self, index: Index, u: Floats) -> tuple[Floats, Floats]:
        n = uniform_sphere(u)
        return gather(self.center, index) + n * gather(self.radius, index), n * gather(self.side, index)

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats | None:
        """Irradiance by the cone's closed form. Inside a sphere that emits inwards it is pi L everywhere, as
        in an integrating sphere.
        """
        cone = self.cone(index, ref_p)
        e = sphere_irradiance(cone.sine, cone.cosine, np.clip(dot(ref_n, cone.axis), -1.0, 1.0))
        e = np.where(cone.outside, e, np.pi)
        emits = self.emitters.emits(index, cone.sign * gather(self.side, index))
        return gather(self.emitters.radiance, index) * np.where(emits, e, 0.0)

    def emits(self, index: Index, ref_p: Floats, cos_light: Floats) -> Mask:
        """(n,): whether a point sends light to ref_p. From outside, the near half hides the far half, so that
        only the outer side counts.
        """
        d = gather(self.center, index) - ref_p
        outside = np.sqrt(dot(d, d)) > gather(self.radius, index)
        return self.emitters.emits(index, cos_light) & (outside == (cos_light * gather(self.side, index) > 0))

    def intersect(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Distance and cosine at the first point met; from inside, at the wall."""
        d = gather(self.center, index) - origin
        r = gather(self.radius, index)
        far = np.sqrt(dot(d, d))
        outside = far > r
        along = dot(d, wi)
        off = d - wi * along
        half = r * r - dot(off, off)
        with np.errstate(invalid="ignore", divide="ignore"):
            root = np.sqrt(half)
            # The two roots have the product (far - r)(far + r): taking the smaller from it spares a
            # difference.
            power = (far - r) * (far + r)
            dist = np.where(outside, power / (along + root), _inner(along, root, power))
        cos_light = np.where(outside, root, -root) / r * gather(self.side, index)
        hit = (half >= 0) & (dist > 0) & self.emitters.emits(index, cos_light)
        return np.where(hit, dist, np.inf), cos_light

    def cone(self, index: Index, p: Floats) -> Cone:
        """The cones under which points p (3, n) see their spheres."""
        d = gather(self.center, index) - p
        r = gather(self.radius, index)
        dist = np.sqrt(dot(d, d))
        outside = dist > r
        power = (dist - r) * (dist + r)
        with np.errstate(divide="ignore", invalid="ignore"):
            sine = np.where(outside, r / dist, 0.0)
            cosine = np.where(outside, np.sqrt(np.maximum(power, 0.0)) / dist, -1.0)
            opening = np.where(outside, sine * sine / (1.0 + cosine), 2.0)
            axis = np.where(dist > 0, d / dist, np.array([[0.0], [0.0], [1.0]]))
        return Cone(axis, dist, power, outside, np.where(outside, 1.0, -1.0), sine, cosine, opening)


@dataclass(frozen=True, eq=False)
class Cone:
    """The cone under which a sphere is seen; from inside, the whole sphere of directions, with cosine -1.

    axis: (3, n) unit, towards the centre. All others are (n,): dist, distance of the centre; power, dist^2 -
    radius^2; outside, bool, and sign, 1 outside and -1 inside; sine and cosine of the half-angle; opening, 1
    - cosine.
    """

    axis: Floats
    dist: Floats
    power: Floats
    outside: Mask
    sign: Floats
    sine: Floats
    cosine: Floats
    opening: Floats


@dataclass(frozen=True, eq=False)
class SphereSolidAngle:
    """Uniform in the cone of the sphere [shirley1996]; from inside, uniform over all directions."""

    lights: SphereLights

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        li = self.lights
        cone = li.cone(index, ref_p)
        below = u[0] * cone.opening  # 1 - cos(theta)
        sin2 = below * (2.0 - below)
        sine, cosine = np.sqrt(sin2), 1.0 - below
        phi = (2 * np.pi) * u[1]
        right, up = np.cos(phi), np.sin(phi)
        frame = frame_about(cone.axis)
        # Half the chord: dist^2 (cos^2(theta) - cosine^2), or from inside dist^2 cos^2(theta) - power; no
        # difference cancels.
        rest = (1.0 - u[0]) * cone.opening * (cosine + cone.cosine)
        along = cone.dist * cosine
        outer: Floats = cone.dist * cone.dist * rest
        chord2 = np.where(cone.outside, outer, along * along - cone.power)
        root = np.sqrt(np.maximum(chord2, 0.0))
        with np.errstate(invalid="ignore", divide="ignore"):
            dist = np.where(cone.outside, cone.power / (along + root), _inner(along, root, cone.power))
        r = gather(li.radius, index)
        across = dist * sine / r
        normal = combine(
            frame, across * right, across * up, -(cone.dist * sin2 + cone.sign * root * cosine) / r
        )
        wi = combine(frame, sine * right, sine * up, cosine)
        emits = li.emitters.emits(index, cone.sign * gather(li.side, index))
        pdf = 1.0 / (2 * np.pi * cone.opening)
        return LightSample(wi, dist, normal, gather(li.emitters.radiance, index), pdf, emits & (dist > 0))

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        hit = self.lights.intersect(index, ref_p, wi)[0] < np.inf
        return np.where(hit, 1.0 / (2 * np.pi * self.lights.cone(index, ref_p).opening), 0.0)


def _inner(along: Floats, root: Floats, power: Floats) -> Floats:
    """Distance (n,) to the wall from inside, along + root, written without cancellation where along < 0."""
    return np.where(along < 0, -power / (root - along), along + root)


def _examples() -> list[LightExample]:
    center, rgb = np.array([0.0, 2.0, 0.0]), np.array([3.0, 2.0, 1.0])
    black = Diffuse(np.zeros(3))
    outer = ShapeDescription(Sphere(center, 0.5), black, Emission(rgb))
    inner = ShapeDescription(Sphere(center, 5.0, reverse=True), black, Emission(rgb))
    p, n = receivers(center, 0.5)
    off = p - center[:, None]
    outside = dot(off, off) > 0.5**2
    return [
        LightExample("a sphere", outer, p[:, outside], n[:, outside]),
        LightExample("a sphere from inside", inner, center[:, None] + 0.2 * off[:, :1], n[:, :1]),
    ]


ABSENT = {"projected-solid-angle": "only polygons are sampled so, and a sphere is none"}
LIGHTS.add(
    "sphere", LightKind(Sphere, SphereLights.make, "spheres", ("area", "solid-angle"), _examples, ABSENT)
)
