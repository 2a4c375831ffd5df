"""Goniometric lights: point lights whose intensity is looked up in an image of the sphere [pharr2023, sec.
12.2.3].

As pbrt's, the look-up takes the nearest texel of the equal-area map.
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
    light_axes,
    light_values,
    towards,
)
from renderer.math.vectors import Floats, dot, gather
from renderer.spherical.grid import SphereGrid
from scenes.description.lights import GoniometricLight
from scenes.errors import SceneError


@dataclass(frozen=True, eq=False)
class GoniometricLights:
    """position, intensity: (3, k), W/sr. frame: (3, 3, k), column j is the map's j-th axis in the world.
    grid: the maps. share: (m,) the factor of intensity of every texel.
    """

    position: Floats
    frame: Floats
    intensity: Floats
    grid: SphereGrid
    share: Floats

    @classmethod
    def of(cls, own: Sequence[GoniometricLight]) -> GoniometricLights:
        """Lights from their descriptions. Raises SceneError, with its place, for a value out of range."""
        for s in own:
            if s.image.ndim != 2 or s.image.shape[0] != s.image.shape[1] or not s.image.size:
                raise SceneError(
                    f"a goniometric light's image must be square, (h, h), not {s.image.shape}", s.where
                )
            light_values(s.image.ravel()[np.argsort(s.image, axis=None)[[0, -1]]], "its image", s.where)
        size = np.array([len(s.image) for s in own], dtype=np.int64)
        what = "a goniometric light's"
        return cls(
            np.stack([finite_vector(s.position, f"{what} position", s.where) for s in own], axis=1),
            np.stack([light_axes(s.frame, what, s.where) for s in own], axis=2),
            np.stack([light_values(s.intensity, f"{what} intensity", s.where) for s in own], axis=1),
            SphereGrid(size, size, np.zeros(len(own), dtype=np.bool_), np.cumsum(size**2) - size**2),
            np.concatenate([s.image.ravel() for s in own]),
        )

    def arrive(self, index: Index, ref_p: Floats) -> tuple[Floats, Floats, Floats]:
        wi, dist = towards(gather(self.position, index), ref_p)
        frame = gather(self.frame, index)
        own = -np.stack([dot(frame[:, i], wi) for i in range(3)])
        share = self.share.take(self.grid.texel_at(index, own))
        return wi, dist, fall_off(gather(self.intensity, index) * share, dist)


def _examples() -> list[LightExample]:
    row, column = np.mgrid[:4, :4]
    light = GoniometricLight(
        np.array([0.0, 2.0, 0.0]), np.eye(3), np.array([3.0, 2.0, 1.0]), 1.0 + row + 4 * column
    )
    return [LightExample("a goniometric light", light, *receivers(light.position, 1.0))]


LIGHTS.add("goniometric", delta_kind(GoniometricLight, GoniometricLights.of, _examples))
