"""Lights without size in place of those that have one.

    flat            its middle, I = L A along the normal, falling off with the cosine: what a far receiver
    sees
    sphere          its middle, I = L pi r^2 all around: exact outside it, shadows aside
    other meshes    their middle, I = L A / 4 all around: the mean over directions, if the mesh is convex
    environments    their mean radiance from everywhere; those of one half, the mean over that half

So close to an area light the image is wrong, and where it is partly hidden too: that is the price of this end
of the chart.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.baseline.surfaces import View, mean_emission, tessellate
from pipeline.baseline.task import Array, Lamp
from pipeline.references.mitsuba.environment import radiance
from scenes.description.lights import DistantLight, Environment, Light, PointLight, SpotLight
from scenes.description.shapes import ShapeDescription, Sphere

FLAT = 1e-6  # of an area: what may be missing of it in the sum of its triangles' area vectors
DIRECTIONS = 2**14  # to take the mean of an environment over


def of_shape(shape: ShapeDescription, view: View) -> Iterator[Lamp]:
    """What stands for an emitting shape; a sphere that shines inwards is none of these, see `ambient`."""
    if shape.emission is None or encloses(shape):
        return
    emission = mean_emission(shape.emission) * view.scale**2
    corners, normals = tessellate(shape.geometry)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    total, vector = areas.sum(), (areas[:, None] * normals.mean(axis=1)).sum(axis=0)
    middle = view.points((areas[:, None] * corners.mean(axis=1)).sum(axis=0) / total)
    axis = view.vectors(vector)
    if isinstance(shape.geometry, Sphere):
        yield Lamp(
            "point", emission * np.pi * shape.geometry.radius**2, view.points(shape.geometry.center), _Z
        )
    elif np.linalg.norm(vector) > (1 - FLAT) * total:
        axis /= np.linalg.norm(axis)
        for side in (1.0, -1.0) if shape.emission.two_sided else (1.0,):
            yield Lamp("flat", emission * total, middle, side * axis)
    else:
        yield Lamp("point", emission * total / 4, middle, _Z)


_Z = np.array([0.0, 0.0, 1.0])


def encloses(shape: ShapeDescription) -> bool:
    """Whether a shape is a sphere that shines inwards."""
    return shape.emission is not None and isinstance(shape.geometry, Sphere) and shape.geometry.reverse


def of_light(light: Light, view: View) -> Iterator[Lamp]:
    """A light that is no shape, if it comes from one place or direction."""
    match light:
        case PointLight():
            yield Lamp("point", light.intensity * view.scale**2, view.points(light.position), _Z)
        case SpotLight():
            cone, falloff = np.radians(min(light.cone, 90.0)), np.radians(min(light.falloff_start, 90.0))
            where = view.points(light.position), view.vectors(light.axis)
            yield Lamp("spot", light.intensity * view.scale**2, *where, float(falloff), float(cone))
        case DistantLight():
            yield Lamp("distant", light.irradiance, np.zeros(3), -view.vectors(light.wi))
        case Environment():
            pass


def ambient(environment: Environment) -> Array:
    """(3,) the mean radiance over the directions that it comes from."""
    z = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    z = z if environment.hemisphere else 2 * z - 1
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(DIRECTIONS)  # Fibonacci's points: even over the sphere
    across = np.sqrt(1 - z * z)
    own = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    return radiance(environment, own).mean(axis=0)
