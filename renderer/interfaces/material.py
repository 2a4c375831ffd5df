"""The protocol of materials: how surfaces scatter light, in lobes that may be smooth or let light through.

Adding a smooth or a transmissive material touches no estimator: `renderer.shading.bsdf` asks the kinds, and
`renderer.shading.directions` adds the light of delta lobes to every estimator alike.
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
    """The lobes that a BSDF is made of, as pbrt's BxDFFlags [pharr2023, sec. 9.1.2]; NONE of a black one."""

    NONE = 0
    REFLECTION = 1  # wi on the side of wo
    TRANSMISSION = 2  # wi on the other side
    DIFFUSE = 4  # Lambertian: f is constant over a side
    GLOSSY = 8
    SPECULAR = 16  # a delta function: one direction wi for each wo, which light samples never find


LAMBERTIAN = Lobes.REFLECTION | Lobes.DIFFUSE


@dataclass(frozen=True, eq=False)
class MaterialExample:
    """A shape that wears a material, for the contract tests.

    estimated: whether f is an unbiased estimate, whose noise is another at each point and pair of directions.
    """

    name: str
    shape: ShapeDescription
    estimated: bool = False


@runtime_checkable
class MaterialKind(Protocol):
    """Scattering at surfaces; wo and wi both leave the surface.

    The normal of a hit lies on the side of wo. All methods hold for every wi on the sphere.
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
        """The materials of all shapes of a scene: a shape's index is its material's, and other kinds' rows
        are black.
        """
        ...

    def evaluate(self, hit: SurfaceHit, wi: Floats) -> Floats:
        """f(wo, wi) (3, n) in 1/sr, without the cosine and without delta lobes.

        0 where nothing is scattered: on a side without a lobe, and at points of other kinds.
        """
        ...

    def sample(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        """Directions as the BSDF would have them. u: (2, n) in [0, 1)."""
        ...

    def pdf(self, hit: SurfaceHit, wi: Floats) -> Floats:
        """Density (n,) in 1/sr of the samples that are not specular; 0 where `sample` never goes."""
        ...

    @classmethod
    def examples(cls) -> list[MaterialExample]:
        """Materials of this kind, the hard ones among them."""
        ...


MATERIALS: Registry[type[MaterialKind]] = Registry("material", "renderer.materials")


def material_kind(shape: ShapeDescription) -> type[MaterialKind]:
    """The kind of a shape's material; SceneError where no kind accepts it."""
    for _, kind in MATERIALS.items():
        if kind.accepts(shape):
            return kind
    raise SceneError(f"material {type(shape.material).__name__} is not supported", shape.where)


def lobes_of(shape: ShapeDescription) -> Lobes:
    """The lobes of a shape's material; of a mix those of all that its points may be of."""
    if isinstance(shape.material, MixedMaterial):
        first, second = (lobes_of(replace(shape, material=part)) for part in shape.material.parts)
        return first | second
    return material_kind(shape).lobes(shape)
