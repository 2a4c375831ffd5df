"""Small descriptions made by hand, and the tests that images of one scene agree."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenes.description.materials import Diffuse
from scenes.description.scene import Film, PerspectiveCamera, SceneDescription
from scenes.description.shapes import (
    Array,
    BilinearMesh,
    Disk,
    Emission,
    Geometry,
    ShapeDescription,
    Sphere,
    TriangleMesh,
)


def vector(*xyz: float) -> Array:
    return np.array(xyz, dtype=np.float64)


def look_at(eye: Array, target: Array, up: Array) -> Array:
    """pbrt's LookAt as camera_to_world, left-handed: x to the right of the image, y up, z into the scene."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(up, z)
    x = x / np.linalg.norm(x)
    result = np.eye(4)
    result[:3, 0], result[:3, 1], result[:3, 2], result[:3, 3] = x, np.cross(z, x), z, eye
    return result


def shape(
    geometry: Geometry, albedo: float = 0.5, radiance: Sequence[float] | None = None
) -> ShapeDescription:
    emission = None if radiance is None else Emission(vector(*radiance))
    return ShapeDescription(geometry, Diffuse(np.full(3, albedo)), emission)


def rectangle(center: Array, u: Array, v: Array, reverse: bool = False) -> BilinearMesh:
    """Half sides u and v; its normal is u x v."""
    corners = np.stack([center - u - v, center + u - v, center - u + v, center + u + v])
    return BilinearMesh(corners, np.array([[0, 1, 2, 3]]), reverse)


def floor(half: float = 8.0, reverse: bool = False) -> ShapeDescription:
    """Albedo 0.5, in y = 0, normal +y."""
    return shape(rectangle(vector(0, 0, 0), vector(0, 0, half), vector(half, 0, 0), reverse))


def scene(
    shapes: Sequence[ShapeDescription], camera: Array, fov: float, width: int = 4, height: int = 4
) -> SceneDescription:
    return SceneDescription("by hand", PerspectiveCamera(camera, fov), Film(width, height), tuple(shapes))


def above(point: Array, side: float, distance: float = 1.0) -> tuple[Array, float]:
    """Camera and fov that see a patch of the floor of that side around `point`, from straight above."""
    camera = look_at(point + vector(0, distance, 0), point, vector(0, 0, 1))
    return camera, float(np.degrees(2 * np.arctan(side / 2 / distance)))


def moved(given: SceneDescription, scale: float, offset: Array) -> SceneDescription:
    """The same scene elsewhere and of another size; its image is the same."""

    def move(geometry: Geometry) -> Geometry:
        match geometry:
            case TriangleMesh():
                return TriangleMesh(geometry.vertices * scale + offset, geometry.faces, geometry.reverse)
            case BilinearMesh():
                return BilinearMesh(geometry.vertices * scale + offset, geometry.faces, geometry.reverse)
            case Sphere():
                return Sphere(geometry.center * scale + offset, geometry.radius * scale, geometry.reverse)
            case Disk():
                return Disk(geometry.center * scale + offset, geometry.normal, geometry.radius * scale)

    camera = given.camera.camera_to_world.copy()
    camera[:3, 3] = camera[:3, 3] * scale + offset
    shapes = tuple(ShapeDescription(move(one.geometry), one.material, one.emission) for one in given.shapes)
    return SceneDescription("moved", PerspectiveCamera(camera, given.camera.fov), given.film, shapes)


def project(given: SceneDescription, point: Array) -> Array:
    """Where pbrt's camera sees a world point: (x, y) in pixels, y downwards.

    `fov` spans the shorter side of the film.
    """
    local = np.linalg.inv(given.camera.camera_to_world) @ np.append(point, 1.0)
    width, height = given.film.width, given.film.height
    pixels = min(width, height) / 2 / np.tan(np.radians(given.camera.fov) / 2)
    return np.array([width / 2 + pixels * local[0] / local[2], height / 2 - pixels * local[1] / local[2]])


def regions(image: Array, count: int = 4) -> Array:
    """Means over count x count regions, (count, count, 3)."""
    h, w = image.shape[:2]
    return image.reshape(count, h // count, count, w // count, 3).mean(axis=(1, 3))
