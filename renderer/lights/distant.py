"""Distant lights: the same direction and the same irradiance everywhere, as of a sun without a disk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from renderer.interfaces.light import LIGHTS, DirectionSampler, Index, LightExample, Source, receivers
from renderer.light_sampling.delta import (
    delta_irradiance,
    delta_missing,
    every_technique,
    light_values,
    unit_vector,
)
from renderer.math.vectors import Floats, gather
from scenes.description.lights import DistantLight


@dataclass(frozen=True, eq=False)
class DistantLights:
    """wi: (3, k) unit, towards the light. facing: (3, k), irradiance in W/m^2 of a surface that faces it."""

    delta: ClassVar[bool] = True

    source: NDArray[np.int64]
    wi: Floats
    facing: Floats

    @property
    def share(self) -> Floats:
        """(k,) ones: one light a source."""
        return np.ones(self.source.size)

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        """All names, one sampler."""
        return every_technique(self)

    @staticmethod
    def missing(technique: str) -> str | None:
        """See `LightKind`."""
        return delta_missing(technique)

    @classmethod
    def accepts(cls, source: Source) -> bool:
        """Every `DistantLight`."""
        return isinstance(source, DistantLight)

    @classmethod
    def make(cls, sources: Sequence[Source], index: Sequence[int]) -> DistantLights:
        """See `LightKind`."""
        own = [s for s in sources if isinstance(s, DistantLight)]
        wi = [unit_vector(s.wi, "a distant light's direction", s.where) for s in own]
        facing = [light_values(s.irradiance, "a distant light's irradiance", s.where) for s in own]
        return cls(np.array(index, dtype=np.int64), np.stack(wi, axis=1), np.stack(facing, axis=1))

    def arrive(self, index: Index, ref_p: Floats) -> tuple[Floats, Floats, Floats]:
        """See `Arrival`."""
        wi = np.ascontiguousarray(np.broadcast_to(gather(self.wi, index), ref_p.shape))
        return wi, np.full(index.size, np.inf), gather(self.facing, index)

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats:
        """See `LightKind`: E cos."""
        return delta_irradiance(self, index, ref_p, ref_n)

    @classmethod
    def examples(cls) -> list[LightExample]:
        """See `LightKind`."""
        light = DistantLight(np.array([0.6, 0.8, 0.0]), np.array([3.0, 2.0, 1.0]))
        return [LightExample("a distant light", light, *receivers(np.zeros(3), 1.0))]


LIGHTS.add("distant", DistantLights)
