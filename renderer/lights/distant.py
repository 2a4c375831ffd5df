"""Distant lights: one direction and one irradiance everywhere, as of a sun without extent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.interfaces.light import LIGHTS, Index, LightExample
from renderer.light_sampling.area import receivers
from renderer.light_sampling.delta import (
    delta_kind,
    light_values,
    unit_vector,
)
from renderer.math.vectors import Floats, gather
from scenes.description.lights import DistantLight


@dataclass(frozen=True, eq=False)
class DistantLights:
    """wi: (3, k) unit, towards the light. facing: (3, k) irradiance in W/m^2 of a surface that faces it."""

    wi: Floats
    facing: Floats

    @classmethod
    def of(cls, own: Sequence[DistantLight]) -> DistantLights:
        """Lights from their descriptions. Raises SceneError, with its place, for a value out of range."""
        wi = [unit_vector(s.wi, "a distant light's direction", s.where) for s in own]
        facing = [light_values(s.irradiance, "a distant light's irradiance", s.where) for s in own]
        return cls(np.stack(wi, axis=1), np.stack(facing, axis=1))

    def arrive(self, index: Index, ref_p: Floats) -> tuple[Floats, Floats, Floats]:
        wi = np.ascontiguousarray(np.broadcast_to(gather(self.wi, index), ref_p.shape))
        return wi, np.full(index.size, np.inf), gather(self.facing, index)


def _examples() -> list[LightExample]:
    light = DistantLight(np.array([0.6, 0.8, 0.0]), np.array([3.0, 2.0, 1.0]))
    return [LightExample("a distant light", light, *receivers(np.zeros(3), 1.0))]


LIGHTS.add("distant", delta_kind(DistantLight, DistantLights.of, _examples))
