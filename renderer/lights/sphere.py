"""Spherical lights: `area`, and `solid-angle` by the cone that they subtend, or all directions from inside.

1 - cos(theta) is carried instead of cos(theta): the cone of a light of 1e-6 rad then keeps all its digits, with no
branch [pharr2023, sec. 6.2.4 switches to a Taylor series instead].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.arrays import Floats, combine, dot, frame_about, gather
from renderer.lights.protocol import LIGHTS, AreaSampling, DirectionSampler, Emitters, Index, LightExample, receivers
from renderer.records import LightSample
from renderer.warp import uniform_sphere
from scenes.description import Diffuse, Emission, ShapeDescription, Sphere


@dataclass(frozen=True, eq=False)
class SphereLights:
    """center: (3, k). radius: (k,). side: (k,), 1 where the outside emits, -1 where the inside does."""

    emitters: Emitters
    center: Floats
    radius: Floats
    side: Floats

    @property
    def shape(self) -> NDArray[np.int64]:
        """(k,) indices of the scene's shapes."""
        return self.emitters.shape

    @property
    def area(self) -> Floats:
        """(k,) areas."""
        return 4 * np.pi * self.radius * self.radius

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        """`area` and `solid-angle`."""
        return {"area": AreaSampling(self), "solid-angle": SphereSolidAngle(self)}

    @staticmethod
    def missing(technique: str) -> str | None:
        """See `LightKind`."""
        return None if technique in ("area", "solid-angle") else f"spheres have no {technique} sampling"

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        """Every emitting sphere."""
        return shape.emission is not None and isinstance(shape.geometry, Sphere)

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription], index: Sequence[int]) -> SphereLights:
        """See `LightKind`."""
        spheres = [s.geometry for s in shapes if isinstance(s.geometry, Sphere)]
        center = np.stack([s.center for s in spheres], axis=1)
        radius = np.array([s.radius for s in spheres], dtype=np.float64)
        side = np.array([-1.0 if s.reverse else 1.0 for s in spheres])
        return cls(Emitters.of(shapes, index), center, radius, side)

    def position(self, index: Index, u: Floats) -> tuple[Floats, Floats]:
        """See `Surface`."""
        n = uniform_sphere(u)
        return gather(self.center, index) + n * gather(self.radius, index), n * gather(self.side, index)

    def emits(self, index: Index, ref_p: Floats, cos_light: Floats) -> NDArray[np.bool_]:
        """See `Surface`. From outside, the near half hides the far half: only the outer side is ever seen."""
        d = gather(self.center, index) - ref_p
        outside = dot(d, d) > gather(self.radius, index) ** 2
        return self.emitters.emits(index, cos_light) & (outside == (cos_light * gather(self.side, index) > 0))

    def meet(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """See `Surface`. The first point met; from inside, the wall."""
        d = gather(self.center, index) - origin
        r = gather(self.radius, index)
        along = dot(d, wi)
        off = d - wi * along
        half = r * r - dot(off, off)
        with np.errstate(invalid="ignore"):
            root = np.sqrt(half)
        outside = dot(d, d) > r * r
        dist = np.where(outside, along - root, along + root)
        cos_light = np.where(outside, root, -root) / r * gather(self.side, index)
        hit = (half >= 0) & (dist > 0) & self.emitters.emits(index, cos_light)
        return np.where(hit, dist, np.inf), cos_light

    def cone(self, index: Index, p: Floats) -> tuple[Floats, Floats, NDArray[np.bool_], Floats]:
        """Direction (3, n) and distance (n,) of the centre, `outside` (n,) bool, and 1 - cos of the cone's angle (n,).

        From inside, the cone is the whole sphere: 1 - cos = 2.
        """
        d = gather(self.center, index) - p
        r = gather(self.radius, index)
        dist = np.sqrt(dot(d, d))
        outside = dist > r
        with np.errstate(divide="ignore", invalid="ignore"):
            sine = r / dist
            # (dist - r)(dist + r), not dist^2 - r^2: exact near contact
            cosine = np.sqrt(np.maximum((dist - r) * (dist + r), 0.0)) / dist
            opening = np.where(outside, sine * sine / (1.0 + cosine), 2.0)
            axis = np.where(dist > 0, d / dist, np.array([[0.0], [0.0], [1.0]]))
        return axis, dist, outside, opening

    @classmethod
    def examples(cls) -> list[LightExample]:
        """See `LightKind`."""
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


@dataclass(frozen=True, eq=False)
class SphereSolidAngle:
    """Uniform in the cone of the sphere [shirley1996]; from inside, uniform over all directions."""

    lights: SphereLights

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        """See `DirectionSampler`."""
        li = self.lights
        axis, center_dist, outside, opening = li.cone(index, ref_p)
        below = u[0] * opening  # 1 - cos(theta)
        sin2 = below * (2.0 - below)
        sine = np.sqrt(sin2)
        phi = (2 * np.pi) * u[1]
        wi = combine(frame_about(axis), sine * np.cos(phi), sine * np.sin(phi), 1.0 - below)
        r = gather(li.radius, index)
        root = np.sqrt(np.maximum(r * r - center_dist * center_dist * sin2, 0.0))
        along = center_dist * (1.0 - below)
        dist = along - _sign(outside) * root
        emits = li.emitters.emits(index, _sign(outside) * gather(li.side, index))
        pdf = 1.0 / (2 * np.pi * opening)
        normal = (wi * dist - axis * center_dist) / r
        return LightSample(wi, dist, normal, gather(li.emitters.radiance, index), pdf, emits & (dist > 0))

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        """See `DirectionSampler`."""
        _, _, _, opening = self.lights.cone(index, ref_p)
        hit = self.lights.meet(index, ref_p, wi)[0] < np.inf
        return np.where(hit, 1.0 / (2 * np.pi * opening), 0.0)


def _sign(outside: NDArray[np.bool_]) -> Floats:
    """1 outside, -1 inside."""
    return np.where(outside, 1.0, -1.0)


LIGHTS.add("sphere", SphereLights)
