"""The lights that have a closed form, each with its irradiance, outline and singularities.

This is the one module here that tells kinds of light apart: patches, disks, spheres and points. A new kind
adds one registration to each function below; nothing else in closed_form/ names it.
"""

from __future__ import annotations

from functools import singledispatch

import numpy as np

from pipeline.references.closed_form.cone import Cone, disk_cone, sphere_cone
from pipeline.references.closed_form.patches import Patch, Plane, needs, outline
from pipeline.references.closed_form.radiometry import disk_irradiance, polygon_irradiance, sphere_irradiance
from scenes.arrays import Array
from scenes.description.lights import Light, PointLight
from scenes.description.scene import Camera
from scenes.description.shapes import Disk, Geometry, Mesh, ShapeDescription, Sphere
from scenes.errors import SceneError

Emitter = Patch | Disk | Sphere | PointLight

PARALLEL = 1e-9  # sine below which planes count as parallel, and an edge as parallel to an axis


def area_emitter(shape: ShapeDescription) -> Patch | Disk | Sphere:
    """The light of an emitting shape; SceneError if it has no closed form."""
    if shape.alpha is not None:
        raise SceneError("there is no closed form of a light with an alpha", shape.where)
    return _area_emitter(shape.geometry, shape)


@singledispatch
def _area_emitter(geometry: Geometry, shape: ShapeDescription) -> Patch | Disk | Sphere:
    raise SceneError(f"a light that is a {type(geometry).__name__} has no closed form", shape.where)


@_area_emitter.register
def _(geometry: Sphere, shape: ShapeDescription) -> Sphere:
    if geometry.reverse or (shape.emission and shape.emission.two_sided):
        raise needs("a sphere light to emit outwards only", shape.where)
    return geometry


@_area_emitter.register
def _(geometry: Disk, shape: ShapeDescription) -> Disk:
    return geometry


@_area_emitter.register
def _(geometry: Mesh, shape: ShapeDescription) -> Patch:
    return outline(geometry, shape, oriented=True)


def point_emitter(light: Light) -> PointLight:
    """The light, if it is a point light; SceneError for any other, which has no closed form."""
    if isinstance(light, PointLight):
        return light
    raise SceneError("the closed form has no spot lights, nor a sky or sun beside another light", light.where)


@singledispatch
def irradiance(light: Emitter, points: Array, plane: Plane, two_sided: bool) -> Array:
    """Irradiance (n,) per unit radiance, or intensity, at points (n, 3) of a plane, on its normal's side."""
    raise TypeError(f"no closed form of a {type(light).__name__} is known")


@irradiance.register
def _(light: Patch, points: Array, plane: Plane, two_sided: bool) -> Array:
    return polygon_irradiance(points, plane.normal, light.outline, two_sided=two_sided)


@irradiance.register
def _(light: Disk, points: Array, plane: Plane, two_sided: bool) -> Array:
    center, normal, radius = light.center, light.normal, light.radius
    return disk_irradiance(points, plane.normal, center, normal, radius, two_sided=two_sided)


@irradiance.register
def _(light: Sphere, points: Array, plane: Plane, two_sided: bool) -> Array:
    return sphere_irradiance(points, plane.normal, light.center, light.radius)


@irradiance.register
def _(light: PointLight, points: Array, plane: Plane, two_sided: bool) -> Array:
    return plane.height(light.position) / np.linalg.norm(points - light.position, axis=-1) ** 3


def most_irradiance(light: Emitter, plane: Plane) -> float:
    """Upper bound of `irradiance` on the plane: pi, or a point light's at its foot."""
    return 1 / float(plane.height(light.position)) ** 2 if isinstance(light, PointLight) else np.pi


def most_flux(light: Emitter) -> float | None:
    """Upper bound of the integral of `irradiance` over the whole plane; None if none is needed."""
    return 2 * np.pi if isinstance(light, PointLight) else None


@singledispatch
def farthest(light: Emitter, direction: Array) -> Array:
    """The point (3,) of the light that lies farthest along the unit vector `direction`."""
    raise TypeError(f"no closed form of a {type(light).__name__} is known")


@farthest.register
def _(light: Patch, direction: Array) -> Array:
    return light.outline[np.argmax(light.outline @ direction)]


@farthest.register
def _(light: Disk, direction: Array) -> Array:
    side = direction - (direction @ light.normal) * light.normal
    length = float(np.linalg.norm(side))
    return light.center + (light.radius / length * side if length > 1e-12 else np.zeros(3))


@farthest.register
def _(light: Sphere, direction: Array) -> Array:
    return light.center + light.radius * direction


@farthest.register
def _(light: PointLight, direction: Array) -> Array:
    return light.position


def own_plane(light: Emitter) -> Plane | None:
    """The plane of a flat light, its normal on the emitting side; None for a sphere or a point."""
    if isinstance(light, Patch):
        return Plane(light.outline[0], light.normal)
    return Plane(light.center, light.normal) if isinstance(light, Disk) else None


def straight_edge(light: Emitter) -> Array | None:
    """A straight edge (3,) of the light's outline; None for a round light."""
    return light.outline[1] - light.outline[0] if isinstance(light, Patch) else None


@singledispatch
def boundary(light: Emitter, points: Array, x_axis: Array, s_axis: Array) -> tuple[Array, Array]:
    """Distances (...) of points (..., 3) to the parts of the light's boundary that are singular along x and
    s.

    An edge parallel to an axis is not singular along that axis.
    """
    raise TypeError(f"no closed form of a {type(light).__name__} is known")


@boundary.register
def _(light: Patch, points: Array, x_axis: Array, s_axis: Array) -> tuple[Array, Array]:
    edges = np.roll(light.outline, -1, axis=0) - light.outline
    d = _edge_distance(points, light.outline, edges)
    length = np.linalg.norm(edges, axis=1)
    across = [np.linalg.norm(np.cross(edges, axis), axis=1) > PARALLEL * length for axis in (x_axis, s_axis)]
    return d[..., across[0]].min(axis=-1), d[..., across[1]].min(axis=-1)


@boundary.register
def _(light: Disk, points: Array, x_axis: Array, s_axis: Array) -> tuple[Array, Array]:
    v = points - light.center
    height = v @ light.normal
    radial = np.linalg.norm(v - height[..., None] * light.normal, axis=-1)
    d = np.hypot(radial - light.radius, height)
    return d, d


@boundary.register
def _(light: Sphere, points: Array, x_axis: Array, s_axis: Array) -> tuple[Array, Array]:
    d = np.linalg.norm(points - light.center, axis=-1)
    return d, d


@boundary.register
def _(light: PointLight, points: Array, x_axis: Array, s_axis: Array) -> tuple[Array, Array]:
    d = np.linalg.norm(points - light.position, axis=-1)
    return d, d


def cone_of(light: Emitter, eye: Array, forward: Array) -> Cone | None:
    """The cone from the eye (3,) over a disk or sphere ahead of it; None for other lights, or behind it."""
    if isinstance(light, Patch | PointLight) or forward @ (light.center - eye) <= 0:
        return None
    apex, center = eye[:, None], light.center[:, None]
    if isinstance(light, Sphere):
        return sphere_cone(apex, center, light.radius)
    return disk_cone(apex, center, light.normal[:, None], light.radius)


def outline_is_seen(light: Emitter, camera: Camera) -> bool:
    """False for a disk or sphere that straddles the camera's plane: its outline would be a hyperbola."""
    if isinstance(light, Patch):
        return True
    eye, forward = camera.camera_to_world[:3, 3], np.linalg.inv(camera.camera_to_world[:3, :3])[2]
    forward = forward / np.linalg.norm(forward)
    nearest, last = (forward @ (farthest(light, sign * forward) - eye) for sign in (-1.0, 1.0))
    return not nearest <= 0 <= last


def _edge_distance(points: Array, start: Array, edge: Array) -> Array:
    """Distances (..., e) of points (..., 3) to segments (e, 3)."""
    v = points[..., None, :] - start
    t = np.clip((v * edge).sum(axis=-1) / (edge * edge).sum(axis=-1), 0.0, 1.0)
    return np.linalg.norm(v - t[..., None] * edge, axis=-1)
