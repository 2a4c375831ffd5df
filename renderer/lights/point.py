"""Point lights: intensity over squared distance, from one direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.interfaces.light import LIGHTS, Index, LightExample
from renderer.light_sampling.area import receivers
from renderer.light_sampling.delta import (
    delta_kind,
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

    position: Floats
    intensity: Floats

    @classmethod
    def of(cls, own: Sequence[PointLight]) -> PointLights:
        """Lights from their descriptions. Raises SceneError, with its place, for a value out of range."""
        position = [finite_vector(s.position, "a point light's position", s.where) for s in own]
        intensity = [light_values(s.intensity, "a point light's intensity", s.where) for s in own]
        return cls(np.stack(position, axis=1), np.stack(intensity, axis=1))

    def arrive(self, index: Index, ref_p: Floats) -> tuple[Floats, Floats, Floats]:
        wi, dist = towards(gather(self.position, index), ref_p)
        return wi, dist, fall_off(gather(self.intensity, index), dist)


def _examples() -> list[LightExample]:
    light = PointLight(np.array([0.0, 2.0, 0.0]), np.array([3.0, 2.0, 1.0]))
    return [LightExample("a point light", light, *receivers(light.position, 1.0))]


LIGHTS.add("point", delta_kind(PointLight, PointLights.of, _examples))
