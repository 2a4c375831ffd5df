"""Lambertian reflection, the same from both sides, as pbrt's `diffuse`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.interfaces.material import LAMBERTIAN, MATERIALS, Lobes, MaterialExample
from renderer.math.vectors import Floats, combine, dot, frame_about, gather
from renderer.math.warp import cosine_hemisphere
from renderer.records import BSDFSample, SurfaceHit
from renderer.textures import Places, brightest, evaluate
from scenes.description.materials import Diffuse
from scenes.description.shapes import ShapeDescription, Sphere
from scenes.description.textures import Texture


@dataclass(frozen=True, eq=False)
class DiffuseMaterials:
    """value: (3, s), reflectance / pi of shapes whose reflectance is constant. textured: the textures of the
    others, by shape.
    """

    value: Floats
    textured: tuple[tuple[int, Texture], ...] = ()

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        return type(shape.material) is Diffuse

    @classmethod
    def lobes(cls, shape: ShapeDescription) -> Lobes:
        reflectance = shape.material.reflectance if isinstance(shape.material, Diffuse) else np.zeros(3)
        return LAMBERTIAN if brightest(reflectance).any() else Lobes.NONE

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription]) -> DiffuseMaterials:
        value = np.zeros((3, len(shapes)))
        textured: list[tuple[int, Texture]] = []
        for i, shape in enumerate(shapes):
            if type(shape.material) is not Diffuse:
                continue
            if isinstance(shape.material.reflectance, np.ndarray):
                value[:, i] = shape.material.reflectance / np.pi
            else:
                textured.append((i, shape.material.reflectance))
        return cls(value, tuple(textured))

    def evaluate(self, hit: SurfaceHit, wi: Floats) -> Floats:
        value = gather(self.value, hit.shape)
        if self.textured:
            value = np.broadcast_to(value, (3, hit.shape.size)).copy()
        for shape, texture in self.textured:
            rows = np.flatnonzero(hit.shape == shape)
            if rows.size:
                # What is scaled may exceed 1; pbrt clamps it too.
                value[:, rows] = np.clip(evaluate(texture, Places.of(hit, rows)), 0.0, 1.0) / np.pi
        return value * (dot(wi, hit.ns) > 0)

    def sample(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        """Cosine-weighted directions: exact for a Lambertian BRDF."""
        x, y, z = cosine_hemisphere(u)
        wi = combine(frame_about(hit.ns), x, y, z)
        return BSDFSample(wi, self.evaluate(hit, wi), z / np.pi)

    def pdf(self, hit: SurfaceHit, wi: Floats) -> Floats:
        return np.maximum(dot(wi, hit.ns), 0.0) / np.pi

    @classmethod
    def examples(cls) -> list[MaterialExample]:
        ball = Sphere(np.zeros(3), 1.0)
        return [
            MaterialExample("a coloured wall", ShapeDescription(ball, Diffuse(np.array([0.8, 0.5, 0.1]))))
        ]


MATERIALS.add("diffuse", DiffuseMaterials)
