"""Lights that are no shapes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from scenes.errors import Location

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PointLight:
    """position: (3,). intensity: (3,), W/sr."""

    position: Array
    intensity: Array
    where: Location | None = field(default=None, metadata={"content": False})

    def scaled(self, factor: float) -> PointLight:
        """The light with its radiometric amount multiplied."""
        return replace(self, intensity=self.intensity * factor)


@dataclass(frozen=True, eq=False)
class SpotLight:
    """A point light that falls off from full at `falloff_start` to nothing at `cone` off its axis, both in
    degrees, by pbrt's smoothstep of the cosine.

    position: (3,). axis: (3,), unit, the way it shines. intensity: (3,), W/sr, along the axis.
    """

    position: Array
    axis: Array
    intensity: Array
    cone: float
    falloff_start: float
    where: Location | None = field(default=None, metadata={"content": False})

    def scaled(self, factor: float) -> SpotLight:
        """The light with its radiometric amount multiplied."""
        return replace(self, intensity=self.intensity * factor)


@dataclass(frozen=True, eq=False)
class DistantLight:
    """Light from one direction. wi: (3,), unit, towards the light. irradiance: (3,), W/m^2, on a surface
    facing it (pbrt calls it `L`).
    """

    wi: Array
    irradiance: Array
    where: Location | None = field(default=None, metadata={"content": False})

    def scaled(self, factor: float) -> DistantLight:
        """The light with its radiometric amount multiplied."""
        return replace(self, irradiance=self.irradiance * factor)


@dataclass(frozen=True, eq=False)
class Environment:
    """Light from all around, or from the half about `up` only.

    radiance: (3,), W/(m^2 sr), what the image is multiplied by. image: (h, w, 3) float64 or None; mapping:
    how directions fall on it, "equal-area" (pbrt's square octahedral map) or "latitude-longitude" (ours:
    first row about +z of its own space, columns by the angle from +x towards +y). frame: (3, 3) float64,
    columns the light's own axes in world space, orthonormal (left-handed under a mirror). hemisphere: whether
    it ends where the light's own z is 0.
    """

    radiance: Array
    image: Array | None = None
    mapping: str = "equal-area"
    frame: Array = field(default_factory=lambda: np.eye(3))
    hemisphere: bool = False
    where: Location | None = field(default=None, metadata={"content": False})

    def scaled(self, factor: float) -> Environment:
        """The light with its radiometric amount multiplied."""
        return replace(self, radiance=self.radiance * factor)


Light = PointLight | SpotLight | DistantLight | Environment
