"""Spot lights: point lights that fade out towards the edge of a cone, by a cubic smoothstep of the cosine
[pharr2023, sec. 12.2.1].

The cosines' differences are formed without the cosines: 1 - cos t is |a - w|^2 / 2 for unit vectors a and w,
and cos s - cos c = 2 sin((c + s)/2) sin((c - s)/2), so that a cone of a thousandth of a degree fades as
smoothly as a wide one.
"""

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
    unit_vector,
)
from renderer.math.vectors import Floats, dot, gather
from scenes.description.lights import SpotLight
from scenes.errors import SceneError


@dataclass(frozen=True, eq=False)
class SpotLights:
    """position, axis, intensity: (3, k), W/sr along the axis. edge: (k,) 1 - cos of the cone. fade: (k,) from
    there to full, in cosine.
    """

    position: Floats
    axis: Floats
    intensity: Floats
    edge: Floats
    fade: Floats

    @classmethod
    def of(cls, own: Sequence[SpotLight]) -> SpotLights:
        """Lights from their descriptions. Raises SceneError, with its place, for a value out of range."""
        for s in own:
            if not 0 <= s.falloff_start <= s.cone <= 180:
                what = (
                    f"a spot light's cone is {s.cone:g} degrees and its falloff starts at {s.falloff_start:g}"
                )
                raise SceneError(f"{what}; allowed is 0 <= start <= cone <= 180", s.where)
        cone, start = np.radians([[s.cone for s in own], [s.falloff_start for s in own]])
        return cls(
            np.stack([finite_vector(s.position, "a spot light's position", s.where) for s in own], axis=1),
            np.stack([unit_vector(s.axis, "a spot light's axis", s.where) for s in own], axis=1),
            np.stack([light_values(s.intensity, "a spot light's intensity", s.where) for s in own], axis=1),
            2.0 * np.sin(0.5 * cone) ** 2,
            2.0 * np.sin(0.5 * (cone + start)) * np.sin(0.5 * (cone - start)),
        )

    def arrive(self, index: Index, ref_p: Floats) -> tuple[Floats, Floats, Floats]:
        wi, dist = towards(gather(self.position, index), ref_p)
        off = gather(self.axis, index) + wi
        inside = gather(self.edge, index) - 0.5 * dot(off, off)
        fade = gather(self.fade, index)
        # Without a fade, the edge itself is lit.
        hard = np.where(inside >= 0, 1.0, 0.0)
        t = np.where(fade > 0, np.clip(inside / np.where(fade > 0, fade, 1.0), 0.0, 1.0), hard)
        return wi, dist, fall_off(gather(self.intensity, index) * (t * t * (3.0 - 2.0 * t)), dist)


def _examples() -> list[LightExample]:
    down, rgb = np.array([0.0, -1.0, 0.0]), np.array([3.0, 2.0, 1.0])
    light = SpotLight(np.array([0.0, 2.0, 0.0]), down, rgb, 45.0, 20.0)
    return [LightExample("a spot light shining down", light, *receivers(light.position, 1.0))]


LIGHTS.add("spot", delta_kind(SpotLight, SpotLights.of, _examples))
