"""Thin sheets that reflect and transmit by Lambert's law, as pbrt's `diffusetransmission`.

f is reflectance / pi on the side of wo and transmittance / pi on the other [pharr2023, sec. 9.3]. pbrt clamps
both after their scale. Samples choose a side by the larger channel of each, then follow the cosine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.interfaces.material import MATERIALS, Lobes, MaterialExample
from renderer.math.vectors import Floats, combine, dot, frame_about, gather
from renderer.math.warp import cosine_hemisphere
from renderer.records import BSDFSample, SurfaceHit
from renderer.textures import Places, brightest, evaluate
from scenes.description.materials import DiffuseTransmission
from scenes.description.shapes import ShapeDescription, Sphere
from scenes.description.textures import Texture

TINY = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True, eq=False)
class _Side:
    """The share of the light that sheets send to one side. value: (3, s), 0 for textures. textured: the
    textures and their scales, by shape.
    """

    value: Floats
    textured: tuple[tuple[int, Texture, float], ...]

    @classmethod
    def of(cls, parts: Sequence[tuple[Texture, float] | None]) -> _Side:
        """The shares from `parts`, the texture and the scale of each shape; None for shapes of
        other kinds.
        """
        value = np.zeros((3, len(parts)))
        textured: list[tuple[int, Texture, float]] = []
        for i, part in enumerate(parts):
            if part is None:
                continue
            if isinstance(part[0], np.ndarray):
                value[:, i] = np.clip(part[0] * part[1], 0.0, 1.0)
            else:
                textured.append((i, *part))
        return cls(value, tuple(textured))

    def at(self, hit: SurfaceHit) -> Floats:
        """(3, n): the share of the light that goes to this side, in [0, 1]."""
        value = gather(self.value, hit.shape)
        if self.textured:
            value = np.broadcast_to(value, (3, hit.shape.size)).copy()
        for shape, texture, scale in self.textured:
            rows = np.flatnonzero(hit.shape == shape)
            if rows.size:
                value[:, rows] = np.clip(evaluate(texture, Places.of(hit, rows)) * scale, 0.0, 1.0)
        return value


@dataclass(frozen=True, eq=False)
class DiffuseTransmissionMaterials:
    """Sheets by shape: the shares that go to the side of wo, and through."""

    near: _Side
    far: _Side

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        return type(shape.material) is DiffuseTransmission

    @classmethod
    def lobes(cls, shape: ShapeDescription) -> Lobes:
        assert isinstance(shape.material, DiffuseTransmission)
        sheet, out = shape.material, Lobes.NONE
        if sheet.scale and brightest(sheet.reflectance).any():
            out |= Lobes.REFLECTION | Lobes.DIFFUSE
        if sheet.scale and brightest(sheet.transmittance).any():
            out |= Lobes.TRANSMISSION | Lobes.DIFFUSE
        return out

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription]) -> DiffuseTransmissionMaterials:
        own = [s.material if isinstance(s.material, DiffuseTransmission) else None for s in shapes]
        return cls(
            _Side.of([None if m is None else (m.reflectance, m.scale) for m in own]),
            _Side.of([None if m is None else (m.transmittance, m.scale) for m in own]),
        )

    def evaluate(self, hit: SurfaceHit, wi: Floats) -> Floats:
        return _value(self.near.at(hit), self.far.at(hit), dot(wi, hit.ns))

    def sample(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        """A side by u[0], whose rest is stretched to [0, 1) again, then a cosine-weighted direction."""
        near, far = self.near.at(hit), self.far.at(hit)
        first, second = _chances(near, far)
        stays = u[0] < first
        low, size = np.where(stays, 0.0, first), np.where(stays, first, second)
        left = np.clip((u[0] - low) / np.maximum(size, TINY), 0.0, 1.0 - 2.0**-53)
        x, y, z = cosine_hemisphere(np.stack([left, u[1]]))
        wi = combine(frame_about(hit.ns), x, y, z * np.where(stays, 1.0, -1.0))
        cosine = dot(wi, hit.ns)
        return BSDFSample(wi, _value(near, far, cosine), _density(first, second, cosine))

    def pdf(self, hit: SurfaceHit, wi: Floats) -> Floats:
        return _density(*_chances(self.near.at(hit), self.far.at(hit)), dot(wi, hit.ns))

    @classmethod
    def examples(cls) -> list[MaterialExample]:
        ball = Sphere(np.zeros(3), 1.0)
        kinds = [
            ("a leaf", DiffuseTransmission(np.array([0.1, 0.4, 0.05]), np.array([0.2, 0.5, 0.02]))),
            ("a bright sheet", DiffuseTransmission(np.full(3, 0.4), np.full(3, 0.1), 2.0)),
        ]
        return [MaterialExample(name, ShapeDescription(ball, sheet)) for name, sheet in kinds]


def _value(near: Floats, far: Floats, cosine: Floats) -> Floats:
    """f (3, n) in 1/sr for directions of these cosines (n,)."""
    return np.where(cosine > 0, near, np.where(cosine < 0, far, 0.0)) / np.pi


def _chances(near: Floats, far: Floats) -> tuple[Floats, Floats]:
    """(n,) the probability of each side; both are 0 where the surface is black."""
    first, second = near.max(axis=0), far.max(axis=0)
    both = np.maximum(first + second, TINY)
    return first / both, second / both


def _density(first: Floats, second: Floats, cosine: Floats) -> NDArray[np.float64]:
    """(n,) in 1/sr."""
    return np.where(cosine > 0, first, second) * np.abs(cosine) / np.pi


MATERIALS.add("diffuse-transmission", DiffuseTransmissionMaterials)
