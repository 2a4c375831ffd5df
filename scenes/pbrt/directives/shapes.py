"""`Shape`: pbrt-v4's triangle meshes, bilinear meshes, mesh files, spheres and disks, brought into world
space.

Orientation follows pbrt-v4's source. Triangles and patches turn their normal where `ReverseOrientation` xor a
mirroring transformation says so. Spheres and disks that emit are different there: the normal of a light
sample ignores the mirroring and that of a ray's hit does not, so a mirrored one-sided light has no defined
side and is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.shapes import BilinearMesh, Disk, Geometry, Sphere, TriangleMesh
from scenes.errors import SceneError, Unsupported
from scenes.pbrt.directives.meshes import Placement, bilinear_mesh, ply_mesh, triangle_mesh
from scenes.pbrt.state import Builder, PlacedShape, check_room
from scenes.pbrt.text.parameters import Parameters
from scenes.pbrt.transforms import COORDINATE_LIMIT, Transform, orthonormal, uniform_scale, unit

Array = NDArray[np.float64]


def shape(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`Shape`: its geometry in world space, or in its object's, with the material and the light of the
    moment.
    """
    state = builder.state
    parameters.owner = kind
    light = state.light
    if light is not None and builder.current_object is not None:
        builder.report.add(
            "an area light inside an object is not supported (pbrt leaves its light out)", parameters.where
        )
        light = None
    placement = Placement(state.transform, state.reverse, light)
    placed = [
        PlacedShape(geometry, state.material, light, parameters.where)
        for geometry in build_shape(kind, parameters, placement)
    ]
    target = builder.shapes if builder.current_object is None else builder.objects[builder.current_object]
    check_room(target, "shapes", parameters.where)
    target.extend(placed)


def build_shape(kind: str, parameters: Parameters, placement: Placement) -> list[Geometry]:
    """The geometries of one `Shape` directive, one or two of them; SceneError for what cannot be."""
    if kind not in _SHAPES:
        parameters.ignore()
        raise Unsupported(
            f"shape {kind!r} is not supported; supported: {', '.join(_SHAPES)}", parameters.where
        )
    _check_alpha(parameters)
    with np.errstate(all="ignore"):
        geometries = _SHAPES[kind](parameters, placement)
        for geometry in geometries:
            check_range(geometry, parameters)
        if placement.light is not None:
            return [
                _emitting(one, parameters) if isinstance(one, TriangleMesh) else one for one in geometries
            ]
    return geometries


def _check_alpha(parameters: Parameters) -> None:
    parameter = parameters.take("alpha", "float", "texture")
    if parameter is not None and (parameter.type == "texture" or parameters.number("alpha", 1.0) != 1):
        parameters.unsupported("alpha", "alpha is not supported: surfaces have no holes")


def check_range(geometry: Geometry, parameters: Parameters) -> None:
    """SceneError where a shape is too large or too small to compute with."""
    problem = range_problem(geometry)
    if problem is not None:
        raise SceneError(problem, parameters.where)


def range_problem(geometry: Geometry) -> str | None:
    """Why a shape is too large or too small to compute with, or None."""
    if isinstance(geometry, TriangleMesh | BilinearMesh):
        numbers = geometry.vertices
    else:
        numbers = np.append(geometry.center, geometry.radius)
        if not geometry.radius >= 1 / COORDINATE_LIMIT:
            return f"the radius is too small to compute with: {geometry.radius:g}"
    if not np.all(np.abs(numbers) <= COORDINATE_LIMIT):
        return f"the shape reaches beyond {COORDINATE_LIMIT:g}, the largest coordinate"
    return None


def _emitting(geometry: TriangleMesh, parameters: Parameters) -> TriangleMesh:
    """The mesh without the faces that have no area, which are lights of no power in pbrt; SceneError if there
    is none with.
    """
    corners = geometry.vertices[geometry.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if not np.any(area > 0):
        raise SceneError("the mesh emits light but has no area", parameters.where)
    return geometry if np.all(area > 0) else replace(geometry, faces=geometry.faces[area > 0])


def _radius(parameters: Parameters) -> float:
    radius = parameters.number("radius", 1.0)
    if radius <= 0:
        raise parameters.fail("radius", f"the radius must be positive, not {radius:g}")
    return radius


def _only(parameters: Parameters, name: str, value: float) -> None:
    """Report a bound that cuts something off; pbrt brings those beyond the shape back to it."""
    beyond = parameters.number(name, value) - value
    if (beyond if value < 0 else -beyond) > 0 or (value == 0 and beyond != 0):
        parameters.unsupported(
            name, f"{name} must be {value:g}: only the full {parameters.owner} is supported"
        )


def _check_side(parameters: Parameters, placement: Placement) -> None:
    light = placement.light
    if light and not light.emission.two_sided and placement.transform.swaps_handedness:
        raise Unsupported(
            f"a one-sided light on a {parameters.owner} under a mirroring transformation: pbrt-v4 contradicts itself "  # noqa: E501
            "about the side it emits on; take the mirroring out and use ReverseOrientation",
            parameters.where,
        )


def _sphere(parameters: Parameters, placement: Placement) -> list[Geometry]:
    radius = _radius(parameters)
    _only(parameters, "zmin", -radius)
    _only(parameters, "zmax", radius)
    _only(parameters, "phimax", 360.0)
    _check_side(parameters, placement)
    plain = Sphere(np.zeros(3), radius, placement.reverse, np.eye(3))
    return [_checked(moved_sphere(plain, placement.transform), "an ellipsoid of the sphere", parameters)]


def _disk(parameters: Parameters, placement: Placement) -> list[Geometry]:
    radius, height = _radius(parameters), parameters.number("height", 0.0)
    _only(parameters, "innerradius", 0.0)
    _only(parameters, "phimax", 360.0)
    _check_side(parameters, placement)
    plain = Disk(
        np.array([0.0, 0.0, height]),
        np.array([0.0, 0.0, -1.0 if placement.reverse else 1.0]),
        radius,
        np.eye(3),
    )
    return [
        _checked(
            moved_disk(plain, placement.transform, placement.light is not None),
            "an ellipse of the disk",
            parameters,
        )
    ]


def _checked(geometry: Geometry | None, made: str, parameters: Parameters) -> Geometry:
    if geometry is None:
        raise Unsupported(f"the transformation makes {made}; that is not supported", parameters.where)
    return geometry


def moved_sphere(sphere: Sphere, transform: Transform) -> Sphere | None:
    """A sphere under a transformation; None where that stretches it."""
    linear = transform.matrix[:3, :3]
    factor, frame = uniform_scale(linear), orthonormal(linear)
    if factor is None or frame is None or sphere.frame is None:
        return None
    center = transform.points(sphere.center[None])[0]
    return Sphere(
        center, sphere.radius * factor, sphere.reverse != transform.swaps_handedness, frame @ sphere.frame
    )


def moved_disk(disk: Disk, transform: Transform, emits: bool = False) -> Disk | None:
    """A disk under a transformation; None where that stretches it.

    What emits keeps its side under a mirror (it is two-sided).
    """
    if disk.frame is None:
        return None
    plane = transform.matrix[:3, :3] @ disk.frame[:, :2]
    factor = uniform_scale(plane)
    if factor is None:
        return None
    turned = transform.swaps_handedness and not emits
    normal, axis = (_normal(transform, n) for n in (disk.normal, disk.frame[:, 2]))
    frame = np.stack([unit(plane[:, 0]), unit(plane[:, 1]), axis], axis=1) + 0.0
    center = transform.points(disk.center[None])[0]
    return Disk(center, (-normal if turned else normal) + 0.0, disk.radius * factor, frame)


def _normal(transform: Transform, n: Array) -> Array:
    """The image of a normal, by the inverse transpose: (3,), unit."""
    rows = transform.inverse
    return unit(rows[0, :3] * n[0] + rows[1, :3] * n[1] + rows[2, :3] * n[2])


_SHAPES: dict[str, Callable[[Parameters, Placement], list[Geometry]]] = {
    "trianglemesh": triangle_mesh,
    "plymesh": ply_mesh,
    "bilinearmesh": bilinear_mesh,
    "sphere": _sphere,
    "disk": _disk,
}
