"""Lights without size in place of those that have one.

    flat            its middle, I = L A along the normal times the cosine, as for a far receiver
    sphere          its middle, I = L pi r^2 all around: exact outside it, shadows aside
    other meshes    their middle, I = L A / 4 all around: the mean over directions, if the mesh is convex
    environments    their mean radiance from everywhere; those of one half, the mean over that half
    portals         a flat light in their place, of the sky's mean radiance; not seen themselves
    image lights    a goniometric light as a point, a projector as a spot, of their mean intensity

The image is wrong close to an area light, and wherever one is partly hidden.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import singledispatch

import numpy as np

from pipeline.baseline.surfaces import View, mean_emission, tessellate
from pipeline.baseline.task import Array, SizelessLight
from pipeline.references.mitsuba.environment import radiance
from scenes.description.lights import (
    DistantLight,
    Environment,
    GoniometricLight,
    Light,
    PointLight,
    PortalLight,
    ProjectionLight,
    SpotLight,
)
from scenes.description.shapes import ShapeDescription, Sphere

FLAT = 1e-6  # of an area: what may be missing of it in the sum of its triangles' area vectors
DIRECTIONS = 2**14  # to take the mean of an environment over


def of_shape(shape: ShapeDescription, view: View) -> Iterator[SizelessLight]:
    """The lights that stand for an emitting shape; none for a sphere that shines inwards (see `encloses`)."""
    if shape.emission is None or encloses(shape):
        return
    emission = mean_emission(shape.emission) * view.scale**2
    corners, normals = tessellate(shape.geometry)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    total, vector = areas.sum(), (areas[:, None] * normals.mean(axis=1)).sum(axis=0)
    middle = view.points((areas[:, None] * corners.mean(axis=1)).sum(axis=0) / total)
    axis = view.vectors(vector)
    if isinstance(shape.geometry, Sphere):
        yield SizelessLight(emission * np.pi * shape.geometry.radius**2, view.points(shape.geometry.center))
    elif np.linalg.norm(vector) > (1 - FLAT) * total:
        axis /= np.linalg.norm(axis)
        for side in (1.0, -1.0) if shape.emission.two_sided else (1.0,):
            yield SizelessLight(emission * total, middle, side * axis, linear=True)
    else:
        yield SizelessLight(emission * total / 4, middle)


def encloses(shape: ShapeDescription) -> bool:
    """Whether a shape is a sphere that shines inwards."""
    return shape.emission is not None and isinstance(shape.geometry, Sphere) and shape.geometry.reverse


@singledispatch
def of_light(light: Light, view: View) -> SizelessLight:
    """The light without size in place of a light that is no shape."""
    raise TypeError(f"a {type(light).__name__} cannot be rasterised")


@of_light.register
def _(light: PointLight, view: View) -> SizelessLight:
    return SizelessLight(light.intensity * view.scale**2, view.points(light.position))


@of_light.register
def _(light: SpotLight, view: View) -> SizelessLight:
    inner, outer = (float(np.radians(min(angle, 90.0))) for angle in (light.falloff_start, light.cone))
    position, axis = view.points(light.position), view.vectors(light.axis)
    return SizelessLight(light.intensity * view.scale**2, position, axis, inner, outer)


@of_light.register
def _(light: DistantLight, view: View) -> SizelessLight:
    return SizelessLight(light.irradiance, None, -view.vectors(light.wi))


@of_light.register
def _(light: GoniometricLight, view: View) -> SizelessLight:
    return SizelessLight(light.intensity * light.image.mean() * view.scale**2, view.points(light.position))


@of_light.register
def _(light: ProjectionLight, view: View) -> SizelessLight:
    intensity = light.intensity * light.image.mean(axis=(0, 1)) * view.scale**2
    right, up = light.half
    cone = float(np.arctan(np.sqrt(4 * right * up / np.pi)))  # a disk of the image's area
    return SizelessLight(intensity, view.points(light.position), view.vectors(light.frame[:, 2]), cone, cone)


@of_light.register
def _(light: PortalLight, view: View) -> SizelessLight:
    first, second, _, last = light.corners
    normal = np.cross(second - first, last - first)
    area = np.linalg.norm(normal)
    middle, axis = view.points(light.corners.mean(axis=0)), view.vectors(normal / area)
    return SizelessLight(ambient(light.sky) * area * view.scale**2, middle, axis, linear=True)


def ambient(environment: Environment) -> Array:
    """Mean radiance (3,) of an environment over its sphere, or over the half that it has."""
    z = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    z = z if environment.hemisphere else 2 * z - 1
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(DIRECTIONS)  # Fibonacci's points: even over the sphere
    across = np.sqrt(1 - z * z)
    own = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    return radiance(environment, own).mean(axis=0)
