"""Disk lights: `area`, and `solid-angle` uniform in the spherical ellipse that they subtend [guillen2017].

The mathematics is in `renderer.spherical.disk` and `disk_irradiance`. Their frame has three axes: from the
point towards the disk's axis, across it in the disk's plane, and from the point to that plane.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from renderer.interfaces.light import LIGHTS, DirectionSampler, Index, LightExample, LightKind, Parts, Source
from renderer.light_sampling.area import AreaSampling, Emitters, geometries, receivers
from renderer.math.vectors import Floats, combine, dot, frame_about, gather, normalize
from renderer.math.warp import concentric_disk
from renderer.records import LightSample
from renderer.spherical.disk import DiskView, disk_view, sample, solid_angle
from renderer.spherical.disk_irradiance import disk_irradiance
from scenes.arrays import Mask
from scenes.description.materials import Diffuse
from scenes.description.shapes import Disk, Emission, ShapeDescription


@dataclass(frozen=True, eq=False)
class DiskLights:
    """center, x, y, normal: (3, k), x and y spanning the disk; radius: (k,)."""

    parts: Parts
    emitters: Emitters
    center: Floats
    x: Floats
    y: Floats
    normal: Floats
    radius: Floats

    @property
    def area(self) -> Floats:
        """(k,) areas."""
        return np.pi * self.radius * self.radius

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        return {"area": AreaSampling(self), "solid-angle": DiskSolidAngle(self)}

    @classmethod
    def make(cls, sources: Sequence[Source], index: Sequence[int]) -> DiskLights:
        disks = geometries(sources, Disk)
        normal = np.stack([d.normal for d in disks], axis=1)
        x, y, _ = frame_about(normal)
        center = np.stack([d.center for d in disks], axis=1)
        radius = np.array([d.radius for d in disks], dtype=np.float64)
        return cls(Parts.whole(index), Emitters.of(sources), center, x, y, normal, radius)

    def position(self, index: Index, u: Floats) -> tuple[Floats, Floats]:
        a, b = concentric_disk(u) * gather(self.radius, index)
        p = gather(self.center, index) + gather(self.x, index) * a
        p += gather(self.y, index) * b
        return p, gather(self.normal, index)

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats | None:
        view, frame = self.view(index, ref_p)
        x, y = dot(ref_n, gather(self.x, index)), dot(ref_n, gather(self.y, index))
        along, across = frame.cosine * x + frame.sine * y, frame.cosine * y - frame.sine * x
        e = disk_irradiance(view, along, across, -frame.side * dot(ref_n, gather(self.normal, index)))
        return gather(self.emitters.radiance, index) * np.where(
            self.emitters.emits(index, frame.side), e, 0.0
        )

    def view(self, index: Index, p: Floats) -> tuple[DiskView, _Frame]:
        """The views that points p (3, n) have of their disks, and the frames of these views."""
        d = gather(self.center, index) - p
        x, y = dot(d, gather(self.x, index)), dot(d, gather(self.y, index))
        height = -dot(d, gather(self.normal, index))
        offset = np.sqrt(x * x + y * y)
        # On the axis every direction is as good as another.
        away = offset > 0
        scale = np.where(away, offset, 1.0)
        frame = _Frame(np.where(away, x, 1.0) / scale, y / scale, np.sign(height), np.abs(height))
        return disk_view(frame.height, offset, gather(self.radius, index)), frame

    def emits(self, index: Index, ref_p: Floats, cos_light: Floats) -> Mask:
        return self.emitters.emits(index, cos_light)

    def intersect(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats]:
        normal = gather(self.normal, index)
        d = gather(self.center, index) - origin
        cos_light = -dot(wi, normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            dist = -dot(d, normal) / cos_light
            off = wi * dist - d
            hit = (dist > 0) & (dot(off, off) <= gather(self.radius, index) ** 2)
            hit &= self.emitters.emits(index, cos_light)
        return np.where(hit, dist, np.inf), cos_light


@dataclass(frozen=True, eq=False)
class _Frame:
    """The frame of a view. cosine, sine: (n,) of the direction towards the disk's axis, in its x and y. side:
    (n,) the sign of the height over the emitting side. height: (n,) >= 0.
    """

    cosine: Floats
    sine: Floats
    side: Floats
    height: Floats


@dataclass(frozen=True, eq=False)
class DiskSolidAngle:
    """Directions uniform in the solid angle of the disk: weights stay bounded however close it comes
    [guillen2017].
    """

    lights: DiskLights

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        li = self.lights
        view, frame = li.view(index, ref_p)
        omega = solid_angle(view)
        along, across, down = sample(view, omega, u)
        normal = gather(li.normal, index)
        x, y = frame.cosine * along - frame.sine * across, frame.sine * along + frame.cosine * across
        wi = combine((gather(li.x, index), gather(li.y, index), normal), x, y, -frame.side * down)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            dist = frame.height / down
            pdf = 1.0 / omega
        valid = (omega > 0) & (pdf < np.inf) & (dist > 0) & (dist < np.inf)
        return LightSample(
            wi,
            dist,
            normal,
            gather(li.emitters.radiance, index),
            pdf,
            valid & li.emitters.emits(index, frame.side),
        )

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        omega = solid_angle(self.lights.view(index, ref_p)[0])
        hit = (self.lights.intersect(index, ref_p, wi)[0] < np.inf) & (omega > 0)
        return np.where(hit, 1.0 / np.where(hit, omega, 1.0), 0.0)


def _examples() -> list[LightExample]:
    disk = Disk(np.array([0.0, 2.0, 0.0]), np.array([0.0, -1.0, 0.0]), 0.7)
    shape = ShapeDescription(disk, Diffuse(np.zeros(3)), Emission(np.array([3.0, 2.0, 1.0])))
    # Below the centre, inside and outside the rim, on the axis, and in the plane but for a hundredth
    away = np.array(
        [[0.0, -0.03, 0.0], [0.95, -0.03, 0.1], [1.05, -0.03, 0.0], [0.0, -1.5, 0.0], [0.0, -0.02, 2.5]]
    ).T
    n = normalize(
        np.array([[0.1, 1.0, 0.0], [0.5, 0.8, 0.0], [-1.0, 0.1, 0.0], [1.0, 0.1, 0.2], [0.3, 0.1, -1.0]]).T
    )
    return [
        LightExample("a disk facing down", shape, *receivers(disk.center, 0.7)),
        LightExample("a disk near its surface and its rim", shape, disk.center[:, None] + 0.7 * away, n),
    ]


ABSENT = {"projected-solid-angle": "only polygons are sampled so, and a disk is none"}
LIGHTS.add("disk", LightKind(Disk, DiskLights.make, "disks", ("area", "solid-angle"), _examples, ABSENT))
