"""One light of each kind over a floor: scenes that have a closed form."""

from __future__ import annotations

import numpy as np

from scenes.description.materials import Diffuse
from scenes.description.scene import Film, PerspectiveCamera, SceneDescription
from scenes.description.shapes import Array, Disk, Emission, Geometry, ShapeDescription, Sphere, TriangleMesh
from tests.kit.mitsuba_scenes import floor, look_at, rectangle, vector

EYE, TARGET = vector(1.25, 2.2, -4.0), vector(0, 0.4, -0.3)


def unit(*xyz: float) -> Array:
    return vector(*xyz) / np.linalg.norm(xyz)


LIGHTS: dict[str, Geometry] = {
    "upright rectangle": rectangle(vector(0, 0.61, 0), vector(-1.2, 0, 0), vector(0, 0.6, 0)),
    "tilted triangle": TriangleMesh(
        vector(-0.5, 1e-5, 0.1, 0.5, 0.6, -0.3, -0.5, 0.7, 0.2).reshape(3, 3), np.array([[0, 2, 1]])
    ),
    "rectangle facing down": rectangle(vector(0, 0.05, -0.3), vector(0.5, 0, 0), vector(0, 0, 0.5)),
    "sphere": Sphere(vector(0, 0.7, -0.3), 0.4),
    "sphere touching": Sphere(vector(0, 0.4 + 1e-5, -0.3), 0.4),
    "upright disk": Disk(vector(0, 0.5 + 1e-4, 0), vector(0, 0, -1), 0.5),
    "tilted disk": Disk(vector(0, 0.7, 0), unit(0.4, -0.5, -1), 0.5),
    "disk facing down": Disk(vector(0, 0.1, -0.3), vector(0, -1, 0), 0.5),
    "disk inside a pixel": Disk(vector(0.013, 0.5, -0.3), unit(0, -1, -0.5), 0.005),
    "disk from behind": Disk(vector(0.013, 0.5, -0.3), unit(0, -0.2, 1), 0.3),
    "disk seen edge-on": Disk(
        vector(0, 0.5, -0.3), unit(*np.cross(EYE - vector(0, 0.5, -0.3), (0, 1, 0))), 0.3
    ),
}


def lit_by(light: Geometry, width: int = 48, height: int = 36, two_sided: bool = False) -> SceneDescription:
    emitter = ShapeDescription(light, Diffuse(np.zeros(3)), Emission(vector(3, 2.6, 2), two_sided))
    camera = PerspectiveCamera(look_at(EYE, TARGET, vector(0, 1, 0)), 35.0)
    return SceneDescription("by hand", camera, Film(width, height), (floor(2.0), emitter))
