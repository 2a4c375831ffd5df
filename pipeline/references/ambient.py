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
    """`scene` in white under a white sky.

    Only where nothing ends the rays: ValueError for a finite occlusion distance.
    """
    if np.isfinite(scene.occlusion_distance):
        raise ValueError(f"rays that end after {scene.occlusion_distance:g} are no direct light")
    return replace(bare_scene(scene), lights=(Environment(np.ones(3)),))


def bare_scene(scene: SceneDescription) -> SceneDescription:
    """`scene` in white and without lights, on which alone its ambient occlusion depends."""
    white = Diffuse(np.ones(3))
    shapes = tuple(replace(shape, material=white, emission=None) for shape in scene.shapes)
    return replace(scene, shapes=shapes, lights=())
