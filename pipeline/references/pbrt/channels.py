"""The colour channels of a scene as gray scenes, which a spectral renderer reproduces exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.scene import SceneDescription

CHANNELS = 3


def gray_scenes(scene: SceneDescription) -> list[SceneDescription]:
    """Three gray scenes, one for each channel of the image; a single one if the scene is gray."""
    scenes = [_channel(scene, c) for c in range(CHANNELS)]
    return scenes[:1] if len({one.content_hash() for one in scenes}) == 1 else scenes


def _channel(scene: SceneDescription, c: int) -> SceneDescription:
    """The scene with channel c of each colour in all three channels."""

    def gray(colors: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.repeat(colors[..., c : c + 1], CHANNELS, axis=-1)

    shapes = tuple(shape.map_colors(gray) for shape in scene.shapes)
    return replace(scene, shapes=shapes, lights=tuple(light.map_colors(gray) for light in scene.lights))
