"""Lambertian reflection, the same from both sides, as pbrt's `diffuse`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.arrays import Floats, combine, dot, frame_about, gather
from renderer.materials.protocol import MATERIALS
from renderer.warp import cosine_hemisphere
from scenes.description import Diffuse, ShapeDescription


@dataclass(frozen=True, eq=False)
class DiffuseMaterials:
    """value: (3, s), reflectance / pi."""

    value: Floats

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        """Whether a shape is diffuse."""
        return type(shape.material) is Diffuse

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription]) -> DiffuseMaterials:
        """See `MaterialKind`."""
        black = np.zeros(3)
        rows = [s.material.reflectance if cls.accepts(s) else black for s in shapes]
        return cls(np.stack(rows, axis=1) / np.pi)

    def evaluate(self, shape: NDArray[np.integer], n: Floats, wo: Floats, wi: Floats) -> Floats:
        """See `MaterialKind`."""
        return gather(self.value, shape)

    def sample(self, shape: NDArray[np.integer], n: Floats, wo: Floats, u: Floats) -> tuple[Floats, Floats]:
        """Cosine-weighted, which is the whole of a Lambertian BRDF. See `MaterialKind`."""
        x, y, z = cosine_hemisphere(u)
        return combine(frame_about(n), x, y, z), z / np.pi

    def pdf(self, shape: NDArray[np.integer], n: Floats, wo: Floats, wi: Floats) -> Floats:
        """See `MaterialKind`."""
        return np.maximum(dot(wi, n), 0.0) / np.pi

    def black(self) -> NDArray[np.bool_]:
        """See `MaterialKind`."""
        return ~np.any(self.value > 0, axis=0)


MATERIALS.add("diffuse", DiffuseMaterials)
