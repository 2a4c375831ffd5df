"""Point lights: intensity over the square of the distance, from one direction."""

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
    fall_off,
    finite_vector,
    light_values,
    towards,
)
from renderer.math.vectors import Floats, gather
from scenes.description.lights import PointLight


@dataclass(frozen=True, eq=False)
class PointLights:
    """position: (3, k). intensity: (3, k), W/sr."""

    delta: ClassVar[bool] = True

    source: NDArray[np.int64]
    position: Floats
    intensity: Floats

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
        """Every `PointLight`."""
        return isinstance(source, PointLight)

    @classmethod
    def make(cls, sources: Sequence[Source], index: Sequence[int]) -> PointLights:
        """See `LightKind`."""
        own = [s for s in sources if isinstance(s, PointLight)]
        position = [finite_vector(s.position, "a point light's position", s.where) for s in own]
        intensity = [light_values(s.intensity, "a point light's intensity", s.where) for s in own]
        return cls(np.array(index, dtype=np.int64), np.stack(position, axis=1), np.stack(intensity, axis=1))

    def arrive(self, index: Index, ref_p: Floats) -> tuple[Floats, Floats, Floats]:
        """See `Arrival`."""
        wi, dist = towards(gather(self.position, index), ref_p)
        return wi, dist, fall_off(gather(self.intensity, index), dist)

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats:
        """See `LightKind`: I cos/d^2."""
        return delta_irradiance(self, index, ref_p, ref_n)

    @classmethod
    def examples(cls) -> list[LightExample]:
        """See `LightKind`."""
        light = PointLight(np.array([0.0, 2.0, 0.0]), np.array([3.0, 2.0, 1.0]))
        return [LightExample("a point light", light, *receivers(light.position, 1.0))]


LIGHTS.add("point", PointLights)
