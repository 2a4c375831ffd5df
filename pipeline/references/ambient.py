"""Ambient occlusion as direct light: the scene whose radiance is the ambient occlusion of another.

Ambient occlusion is the integral of V(w) cos(w) / pi over the hemisphere, V being 1 where nothing is met;
it equals the light that a surface of reflectance 1 reflects of a sky of radiance 1 all around. Emitters
become surfaces, as they are to pbrt's `ambientocclusion`. The renderer hides the sky itself, so that pixels
that meet nothing read 0.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenes.description.lights import Environment
from scenes.description.materials import Diffuse
from scenes.description.scene import SceneDescription


def ambient_scene(scene: SceneDescription) -> SceneDescription:
    """White surfaces under a white sky: their radiance is the ambient occlusion of `scene`.

    ValueError for a scene with a finite occlusion distance.
    """
    if np.isfinite(scene.occlusion_distance):
        raise ValueError(f"rays that end after {scene.occlusion_distance:g} are no direct light")
    return replace(bare_scene(scene), lights=(Environment(np.ones(3)),))


def bare_scene(scene: SceneDescription) -> SceneDescription:
    """The shapes of `scene` in white, without lights: all that its ambient occlusion depends on."""
    white = Diffuse(np.ones(3))
    shapes = tuple(replace(shape, material=white, emission=None) for shape in scene.shapes)
    return replace(scene, shapes=shapes, lights=())
