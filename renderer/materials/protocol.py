"""What a kind of material offers. One object holds all materials of its kind, indexed by the scene's shapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from renderer.arrays import Floats
from scenes.description import ShapeDescription
from scenes.registry import Registry


@runtime_checkable
class MaterialKind(Protocol):
    """Scattering at surfaces; wo and wi both leave the surface."""

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        """Whether a shape's material is of this kind."""
        ...

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription]) -> MaterialKind:
        """From all shapes of a scene, so that a shape's index is its material's; rows of other kinds are black."""
        ...

    def evaluate(self, shape: NDArray[np.integer], n: Floats, wo: Floats, wi: Floats) -> Floats:
        """BRDF values (3, n) in 1/sr, without the cosine; n on the side of wo, wi on the side of n."""
        ...

    def sample(self, shape: NDArray[np.integer], n: Floats, wo: Floats, u: Floats) -> tuple[Floats, Floats]:
        """Directions wi (3, n) as the BRDF would have them, u (2, n) in [0, 1), and their pdf (n,) in 1/sr."""
        ...

    def pdf(self, shape: NDArray[np.integer], n: Floats, wo: Floats, wi: Floats) -> Floats:
        """Density (n,) in 1/sr of `sample`, 0 below the horizon."""
        ...

    def black(self) -> NDArray[np.bool_]:
        """(s,): shapes whose material of this kind scatters nothing at all."""
        ...


MATERIALS: Registry[type[MaterialKind]] = Registry("material", "renderer.materials")
