"""The protocol of materials: scattering at surfaces in lobes, which may be delta lobes or transmit light.

A smooth or transmissive material touches no estimator: `renderer.shading.bsdf` asks the kinds, and
`renderer.shading.delta_lobes` adds the light of delta lobes to all estimators alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntFlag
from typing import Protocol, runtime_checkable

from renderer.math.vectors import Floats
from renderer.records import BSDFSample, SurfaceHit
from scenes.description.materials import MixedMaterial
from scenes.description.shapes import ShapeDescription
from scenes.errors import SceneError
from scenes.registry import Registry


class Lobes(IntFlag):
    """The lobes of a BSDF, as pbrt's BxDFFlags [pharr2023, sec. 9.1.2]; NONE for a black one."""

    NONE = 0
    REFLECTION = 1  # wi on the side of wo
    TRANSMISSION = 2  # wi on the other side
    DIFFUSE = 4  # Lambertian: f is constant over a side
    GLOSSY = 8
    SPECULAR = 16  # a delta function: one direction wi for each wo, which light samples never find


LAMBERTIAN = Lobes.REFLECTION | Lobes.DIFFUSE


@dataclass(frozen=True, eq=False)
class MaterialExample:
    """A shape that wears a material, for the contract tests. estimated: whether `evaluate` gives an unbiased
    random estimate of f, with noise that differs between points and pairs of directions.
    """

    name: str
    shape: ShapeDescription
    estimated: bool = False


@runtime_checkable
class MaterialKind(Protocol):
    """Scattering at surfaces. wo and wi both leave the surface, and the normal of a hit lies on the side of
    wo. All methods hold for every wi on the sphere.
    """

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        """Whether a shape's material is of this kind."""
        ...

    @classmethod
    def lobes(cls, shape: ShapeDescription) -> Lobes:
        """The lobes of a shape of this kind."""
        ...

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription]) -> MaterialKind:
        """The materials of all shapes of a scene, numbered as the shapes; rows of other kinds are black."""
        ...

    def evaluate(self, hit: SurfaceHit, wi: Floats) -> Floats:
        """f(wo, wi) (3, n) in 1/sr, without the cosine and without delta lobes. It is 0 on a side without a
        lobe, and at points of other kinds.
        """
        ...

    def sample(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        """Directions drawn in proportion to the BSDF, or near it. u: (2, n) in [0, 1)."""
        ...

    def pdf(self, hit: SurfaceHit, wi: Floats) -> Floats:
        """Density (n,) in 1/sr of the samples outside delta lobes; 0 where `sample` never goes."""
        ...

    @classmethod
    def examples(cls) -> list[MaterialExample]:
        """Materials of this kind for the contract tests, hard ones among them."""
        ...


@runtime_checkable
class DeltaLobeSampler(Protocol):
    """A kind of material that can leave out of its samples all that a delta lobe does not need."""

    def sample_delta_lobes(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        """The samples of `sample` for the same u that follow delta lobes; pdf 0 in all other rows."""
        ...


MATERIALS: Registry[type[MaterialKind]] = Registry("material", "renderer.materials")


def material_kind(shape: ShapeDescription) -> type[MaterialKind]:
    """The kind of a shape's material; SceneError where no kind accepts it."""
    for _, kind in MATERIALS.items():
        if kind.accepts(shape):
            return kind
    raise SceneError(f"material {type(shape.material).__name__} is not supported", shape.where)


def lobes_of(shape: ShapeDescription) -> Lobes:
    """The lobes of a shape's material; for a mix, those of all its materials together."""
    if isinstance(shape.material, MixedMaterial):
        first, second = (lobes_of(replace(shape, material=part)) for part in shape.material.parts)
        return first | second
    return material_kind(shape).lobes(shape)
