"""What a kind of material offers.

One object holds all materials of its kind, indexed by the scene's shapes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats
from renderer.records import SurfaceHit
from scenes.description.shapes import ShapeDescription
from scenes.registry import Registry


@dataclass(frozen=True, eq=False)
class MaterialExample:
    """A shape that wears a material, for the contract tests."""

    name: str
    shape: ShapeDescription


@runtime_checkable
class MaterialKind(Protocol):
    """Scattering at surfaces; wo and wi both leave the surface."""

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        """Whether a shape's material is of this kind."""
        ...

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription]) -> MaterialKind:
        """From all shapes of a scene, so that a shape's index is its material's; rows of other kinds are
        black.
        """
        ...

    def evaluate(self, hit: SurfaceHit, wi: Floats) -> Floats:
        """BRDF values (3, n) or (3, 1) in 1/sr, without the cosine, wi on the side of the normals; 0 for
        other materials' points.
        """
        ...

    def sample(self, hit: SurfaceHit, u: Floats) -> tuple[Floats, Floats]:
        """Directions wi (3, n) as the BRDF would have them, u (2, n) in [0, 1), and their pdf (n,) in
        1/sr.
        """
        ...

    def pdf(self, hit: SurfaceHit, wi: Floats) -> Floats:
        """Density (n,) in 1/sr of `sample`, 0 below the horizon."""
        ...

    def black(self) -> NDArray[np.bool_]:
        """(s,): shapes whose material of this kind scatters nothing at all; shapes of other kinds are among
        them.
        """
        ...

    @classmethod
    def examples(cls) -> list[MaterialExample]:
        """Materials of this kind, the hard ones among them."""
        ...


MATERIALS: Registry[type[MaterialKind]] = Registry("material", "renderer.materials")
