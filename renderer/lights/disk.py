"""Disk lights: `area`. Sampling a disk's solid angle is a matter of its own [guillen2017] and still to come."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.arrays import Floats, dot, frame_about, gather
from renderer.lights.protocol import LIGHTS, AreaSampling, DirectionSampler, Emitters, Index, LightExample, receivers
from renderer.warp import concentric_disk
from scenes.description import Diffuse, Disk, Emission, ShapeDescription


@dataclass(frozen=True, eq=False)
class DiskLights:
    """center, x, y, normal: (3, k), x and y spanning the disk; radius: (k,)."""

    emitters: Emitters
    center: Floats
    x: Floats
    y: Floats
    normal: Floats
    radius: Floats

    @property
    def shape(self) -> NDArray[np.int64]:
        """(k,) indices of the scene's shapes."""
        return self.emitters.shape

    @property
    def area(self) -> Floats:
        """(k,) areas."""
        return np.pi * self.radius * self.radius

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        """`area` only, so far."""
        return {"area": AreaSampling(self)}

    @staticmethod
    def missing(technique: str) -> str | None:
        """See `LightKind`."""
        if technique == "solid-angle":
            return "the solid-angle method of disks is still to come; `area` samples them"
        return None if technique == "area" else f"disks have no {technique} sampling"

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        """Every emitting disk."""
        return shape.emission is not None and isinstance(shape.geometry, Disk)

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription], index: Sequence[int]) -> DiskLights:
        """See `LightKind`."""
        disks = [s.geometry for s in shapes if isinstance(s.geometry, Disk)]
        normal = np.stack([d.normal for d in disks], axis=1)
        x, y, _ = frame_about(normal)
        center = np.stack([d.center for d in disks], axis=1)
        radius = np.array([d.radius for d in disks], dtype=np.float64)
        return cls(Emitters.of(shapes, index), center, x, y, normal, radius)

    def position(self, index: Index, u: Floats) -> tuple[Floats, Floats]:
        """See `Surface`."""
        a, b = concentric_disk(u) * gather(self.radius, index)
        p = gather(self.center, index) + gather(self.x, index) * a
        p += gather(self.y, index) * b
        return p, gather(self.normal, index)

    def emits(self, index: Index, ref_p: Floats, cos_light: Floats) -> NDArray[np.bool_]:
        """See `Surface`."""
        return self.emitters.emits(index, cos_light)

    def meet(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """See `Surface`."""
        normal = gather(self.normal, index)
        d = gather(self.center, index) - origin
        cos_light = -dot(wi, normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            dist = -dot(d, normal) / cos_light
            off = wi * dist - d
            hit = (dist > 0) & (dot(off, off) <= gather(self.radius, index) ** 2)
            hit &= self.emitters.emits(index, cos_light)
        return np.where(hit, dist, np.inf), cos_light

    @classmethod
    def examples(cls) -> list[LightExample]:
        """See `LightKind`."""
        disk = Disk(np.array([0.0, 2.0, 0.0]), np.array([0.0, -1.0, 0.0]), 0.7)
        shape = ShapeDescription(disk, Diffuse(np.zeros(3)), Emission(np.array([3.0, 2.0, 1.0])))
        return [LightExample("a disk facing down", shape, *receivers(disk.center, 0.7))]


LIGHTS.add("disk", DiskLights)
