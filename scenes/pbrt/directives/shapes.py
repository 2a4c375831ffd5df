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
from functools import singledispatch

import numpy as np

from scenes.description.shapes import Array, Disk, Geometry, Mesh, Sphere, TriangleMesh, basis, vertex_normals
from scenes.errors import Location, PenumbraError, SceneError, Unsupported
from scenes.pbrt.directives.media import is_interface, leave_out
from scenes.pbrt.directives.meshes import Placement, bilinear_mesh, ply_mesh, triangle_mesh
from scenes.pbrt.directives.subdivision import loop_subdivision
from scenes.pbrt.state import Builder, PlacedShape, check_room
from scenes.pbrt.text.mesh_runs import MeshRun
from scenes.pbrt.text.parameters import Parameters
from scenes.pbrt.transforms import COORDINATE_LIMIT, FLAT, Transform, orthonormal, uniform_scale, unit
from scenes.pbrt.write.text import block, matrix, numbers, rotation

MESHES = ("trianglemesh", "plymesh", "bilinearmesh", "loopsubdiv")  # which may be flattened


def shape(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`Shape`: its geometry in world space, or in its object's, with the material and the light of the
    moment.
    """
    state = builder.state
    parameters.owner = kind
    builder.check_still("a shape", parameters.where)
    if state.media is not None:
        builder.media_used.append((state.media, builder.current_object))
    if is_interface(builder, state.material):
        parameters.ignore()
        leave_out(builder, state.light, parameters.where)
        return
    light = state.light
    if light is not None and builder.current_object is not None:
        builder.report.remark(
            "the area light of a shape in an object is left out, as in pbrt", parameters.where
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


def mesh_run(builder: Builder, run: MeshRun, where: Location) -> None:
    """Many meshes under one state as one shape, which reflects only; SceneError where it is too large."""
    builder.check_still("a shape", where)
    placement = Placement(builder.state.transform, builder.state.reverse, None)
    mesh = TriangleMesh(placement.transform.points(run.vertices), run.faces, placement.turned)
    problem = range_problem(mesh)
    if problem is not None:
        raise SceneError(problem, where)
    target = builder.shapes if builder.current_object is None else builder.objects[builder.current_object]
    check_room(target, "shapes", where)
    target.append(PlacedShape(mesh, builder.state.material, None, where))


def build_shape(kind: str, parameters: Parameters, placement: Placement) -> list[Geometry]:
    """The geometries of one `Shape` directive, one or two of them; SceneError for what cannot be."""
    if kind not in _SHAPES:
        parameters.ignore()
        raise Unsupported(
            f"shape {kind!r} is not supported; supported: {', '.join(_SHAPES)}", parameters.where
        )
    _check_alpha(parameters)
    if placement.transform.flattens and kind not in MESHES:
        raise SceneError(FLAT, parameters.where)
    with np.errstate(all="ignore"):
        geometries = _SHAPES[kind](parameters, placement)
        for geometry in geometries:
            problem = range_problem(geometry)
            if problem is not None:
                raise SceneError(problem, parameters.where)
        return [_emitting(g, parameters) for g in geometries] if placement.light else geometries


def _check_alpha(parameters: Parameters) -> None:
    parameter = parameters.take("alpha", "float", "texture")
    if parameter is not None and (parameter.type == "texture" or parameters.number("alpha", 1.0) != 1):
        parameters.unsupported("alpha", "alpha is not supported: surfaces have no holes")


def range_problem(geometry: Geometry) -> str | None:
    """Why a shape is too large or too small to compute with, or None."""
    if not isinstance(geometry, Mesh) and not geometry.radius >= 1 / COORDINATE_LIMIT:
        return f"the radius is too small to compute with: {geometry.radius:g}"
    if not np.all(np.abs(geometry.corners) <= COORDINATE_LIMIT):
        return f"the shape reaches beyond {COORDINATE_LIMIT:g}, the largest coordinate"
    return None


def _emitting(geometry: Geometry, parameters: Parameters) -> Geometry:
    """A triangle mesh without the faces that have no area, which are lights of no power in pbrt; SceneError
    where all are. Other shapes as they are.
    """
    if not isinstance(geometry, TriangleMesh):
        return geometry
    whole = geometry.areas() > 0
    if not np.any(whole):
        raise SceneError("the mesh emits light but has no area", parameters.where)
    return geometry if np.all(whole) else replace(geometry, faces=geometry.faces[whole])


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
            f"a one-sided light on a {parameters.owner} under a mirroring transformation: "
            "pbrt-v4 contradicts itself about the side it emits on; take the mirroring out and use "
            "ReverseOrientation",
            parameters.where,
        )


def _sphere(parameters: Parameters, placement: Placement) -> list[Geometry]:
    radius = _radius(parameters)
    _only(parameters, "zmin", -radius)
    _only(parameters, "zmax", radius)
    _only(parameters, "phimax", 360.0)
    _check_side(parameters, placement)
    plain = Sphere(np.zeros(3), radius, placement.reverse, np.eye(3))
    return [_placed(plain, placement, "an ellipsoid of the sphere", parameters)]


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
    return [_placed(plain, placement, "an ellipse of the disk", parameters)]


def _placed(geometry: Geometry, placement: Placement, otherwise: str, parameters: Parameters) -> Geometry:
    """otherwise: what the transformation makes of the shape where there is no such kind."""
    placed = place(geometry, placement.transform, placement.light is not None)
    if placed is None:
        raise Unsupported(f"the transformation makes {otherwise}; that is not supported", parameters.where)
    return placed


@singledispatch
def place(geometry: Geometry, transform: Transform, emits: bool = False) -> Geometry | None:
    """A shape under a transformation; None where that makes it a shape of no kind that there is.

    emits: whether it is a light. A disk that is one keeps its side under a mirror.
    """
    raise TypeError(f"no transformation is known for {type(geometry).__name__}")


@place.register
def _(geometry: Mesh, transform: Transform, emits: bool = False) -> Mesh:
    reverse = geometry.reverse != transform.swaps_handedness
    moved = replace(geometry, vertices=transform.points(geometry.vertices), reverse=reverse)
    if isinstance(moved, TriangleMesh) and moved.normals is not None:
        return replace(moved, normals=transform.normals(moved.normals))
    return moved


@place.register
def _(geometry: Sphere, transform: Transform, emits: bool = False) -> Sphere | None:
    linear = transform.matrix[:3, :3]
    factor, frame = uniform_scale(linear), orthonormal(linear)
    if factor is None or frame is None or geometry.frame is None:
        return None
    center = transform.points(geometry.center[None])[0]
    reverse = geometry.reverse != transform.swaps_handedness
    return Sphere(center, geometry.radius * factor, reverse, frame @ geometry.frame)


@place.register
def _(geometry: Disk, transform: Transform, emits: bool = False) -> Disk | None:
    if geometry.frame is None:
        return None
    plane = transform.matrix[:3, :3] @ geometry.frame[:, :2]
    factor = uniform_scale(plane)
    if factor is None:
        return None
    turned = transform.swaps_handedness and not emits
    normal, axis = (_normal(transform, n) for n in (geometry.normal, geometry.frame[:, 2]))
    frame = np.stack([unit(plane[:, 0]), unit(plane[:, 1]), axis], axis=1) + 0.0
    center = transform.points(geometry.center[None])[0]
    return Disk(center, (-normal if turned else normal) + 0.0, geometry.radius * factor, frame)


def _normal(transform: Transform, n: Array) -> Array:
    """The image of a normal, by the inverse transpose: (3,), unit."""
    rows = transform.inverse
    return unit(rows[0, :3] * n[0] + rows[1, :3] * n[1] + rows[2, :3] * n[2])


@singledispatch
def shape_text(geometry: Geometry, emits: bool) -> list[str]:
    """The lines of pbrt text that place a shape in the world and name it; emits: whether it is a light."""
    raise TypeError(f"there is no pbrt text for {type(geometry).__name__}")


@shape_text.register
def _(geometry: Mesh, emits: bool) -> list[str]:
    kind = "trianglemesh" if isinstance(geometry, TriangleMesh) else "bilinearmesh"
    lines = [*_reverse(geometry.reverse), f'Shape "{kind}"']
    lines += block('"point3 P"', geometry.vertices.ravel().tolist())
    if geometry.uv is not None:
        lines += block('"point2 uv"', geometry.uv.ravel().tolist())
    if (normals := vertex_normals(geometry)) is not None:
        if not np.isfinite(normals).all():
            raise PenumbraError("a vertex normal is not finite, and there is no text for it")
        side = -1.0 if geometry.reverse else 1.0  # ReverseOrientation turns them too
        lines += block('"normal N"', (side * normals + 0.0).ravel().tolist())
    return [*lines, *block('"integer indices"', geometry.faces.ravel().tolist())]


@shape_text.register
def _(geometry: Sphere, emits: bool) -> list[str]:
    frame, center = geometry.frame, f"Translate {numbers(geometry.center)}"
    turned = geometry.reverse != (frame is not None and _mirrors(frame))
    axes = [] if frame is None else [rotation(frame, "a sphere's")]
    return [*_reverse(turned), center, *axes, f'Shape "sphere" "float radius" [ {geometry.radius!r} ]']


@shape_text.register
def _(geometry: Disk, emits: bool) -> list[str]:
    """Under its own frame, or a right-handed one whose third axis is the normal to the bit."""
    frame, normal, center = geometry.frame, geometry.normal, f"Translate {numbers(geometry.center)}"
    turned = False
    if frame is None:
        axes = matrix("ConcatTransform", basis(normal))
    else:
        # A light keeps its side under a mirror, in pbrt and here.
        turned = (float(frame[:, 2] @ normal) < 0) != (_mirrors(frame) and not emits)
        axes = rotation(frame, "a disk's")
    return [*_reverse(turned), center, axes, f'Shape "disk" "float radius" [ {geometry.radius!r} ]']


def _reverse(turned: bool) -> list[str]:
    return ["ReverseOrientation"] if turned else []


def _mirrors(frame: Array) -> bool:
    return bool(np.linalg.det(frame) < 0)


_SHAPES: dict[str, Callable[[Parameters, Placement], list[Geometry]]] = {
    "trianglemesh": triangle_mesh,
    "plymesh": ply_mesh,
    "bilinearmesh": bilinear_mesh,
    "loopsubdiv": loop_subdivision,
    "sphere": _sphere,
    "disk": _disk,
}
