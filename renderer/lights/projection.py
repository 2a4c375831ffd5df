"""Projection lights: slide projectors, whose intensity is an image on a plane before them [pharr2023, sec.
12.2.2].

As pbrt's, the look-up takes the nearest texel, and nothing leaves the projector so far off its axis that the
cosine is below 1e-3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
from scenes.description.lights import ProjectionLight
from scenes.errors import SceneError

HITHER = 1e-3  # pbrt's near plane, which it holds the cosine against


@dataclass(frozen=True, eq=False)
class ProjectionLights:
    """position, intensity: (3, k), W/sr. frame: (3, 3, k), columns right, up and ahead. half: (2, k), of the
    image's width and height at distance 1. size: (2, k), columns and rows. first: (k,) an image's first
    texel. texels: (m, 3) of all images.
    """

    position: Floats
    frame: Floats
    intensity: Floats
    half: Floats
    size: NDArray[np.int64]
    first: NDArray[np.int64]
    texels: Floats

    @classmethod
    def of(cls, own: Sequence[ProjectionLight]) -> ProjectionLights:
        """Lights from their descriptions. Raises SceneError, with its place, for a value out of range."""
        what = "a projection light's"
        for s in own:
            if s.image.ndim != 3 or s.image.shape[2] != 3 or not s.image.size:
                raise SceneError(f"{what} image must be (h, w, 3), not {s.image.shape}", s.where)
            if not 0 < s.fov < 180:
                raise SceneError(f"{what} fov is between 0 and 180 degrees, not {s.fov:g}", s.where)
            light_values(np.array([s.image.min(), s.image.max()]), f"{what} image", s.where)
        size = np.array([s.image.shape[1::-1] for s in own], dtype=np.int64).T
        return cls(
            np.stack([finite_vector(s.position, f"{what} position", s.where) for s in own], axis=1),
            np.stack([light_axes(s.frame, what, s.where) for s in own], axis=2),
            np.stack([light_values(s.intensity, f"{what} intensity", s.where) for s in own], axis=1),
            np.array([s.half for s in own]).T,
            size,
            np.cumsum(size[0] * size[1]) - size[0] * size[1],
            np.concatenate([s.image.reshape(-1, 3) for s in own]),
        )

    def arrive(self, index: Index, ref_p: Floats) -> tuple[Floats, Floats, Floats]:
        wi, dist = towards(gather(self.position, index), ref_p)
        frame, half = gather(self.frame, index), gather(self.half, index)
        ahead = -dot(frame[:, 2], wi)
        with np.errstate(invalid="ignore"):
            seen = ahead >= HITHER
            depth = np.where(seen, ahead, 1.0) * half
            across = -np.stack([dot(frame[:, 0], wi), -dot(frame[:, 1], wi)]) / depth
            seen &= (np.abs(across) <= 1).all(axis=0)
        size = self.size.take(index, axis=1)
        place = np.where(seen, 0.5 + 0.5 * across, 0.0) * size
        column, row = np.minimum(place.astype(np.int64), size - 1)
        number: NDArray[np.int64] = self.first.take(index) + row * size[0] + column
        texel = self.texels.take(number, axis=0).T
        return wi, dist, fall_off(gather(self.intensity, index) * np.where(seen, texel, 0.0), dist)


def _examples() -> list[LightExample]:
    image = np.arange(1.0, 19.0).reshape(2, 3, 3)
    down = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    light = ProjectionLight(np.array([0.0, 2.0, 0.0]), down, np.array([3.0, 2.0, 1.0]), image, 100.0)
    return [LightExample("a projection light", light, *receivers(light.position, 1.0))]


LIGHTS.add("projection", delta_kind(ProjectionLight, ProjectionLights.of, _examples))
