"""`Shape`: pbrt-v4's triangle meshes, bilinear meshes, mesh files, spheres, disks and cylinders, brought into
world space.

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

from scenes.description.shapes import (
    Array,
    Disk,
    Geometry,
    Mesh,
    Quadric,
    Sphere,
    TriangleMesh,
    basis,
    pbrt_samples,
    vertex_normals,
)
from scenes.description.textures import Texture
from scenes.errors import Location, PenumbraError, SceneError, Unsupported
from scenes.pbrt.directives.curves import curve
from scenes.pbrt.directives.media import is_interface, leave_out
from scenes.pbrt.directives.meshes import Placement, bilinear_mesh, ply_mesh, triangle_mesh
from scenes.pbrt.directives.subdivision import loop_subdivision
from scenes.pbrt.directives.textures import named_texture
from scenes.pbrt.state import Alpha, AreaLight, Builder, MediumUse, NamedNumbers, PlacedShape, check_room
from scenes.pbrt.text.mesh_runs import MeshRun
from scenes.pbrt.text.parameters import Parameters
from scenes.pbrt.transforms import (
    COORDINATE_LIMIT,
    FLAT,
    Transform,
    in_range,
    orthonormal,
    uniform_scale,
    unit,
)
from scenes.pbrt.write.text import block, matrix, numbers, rotation

AS_IT_IS = np.eye(4)[:3]  # the matrix of what is not yet placed
MESHES = ("trianglemesh", "plymesh", "bilinearmesh", "loopsubdiv")  # which may be flattened


def shape(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`Shape`: its geometry in the world, or in the space of its object, with the current material
    and light.
    """
    state = builder.state
    parameters.owner = kind
    builder.check_placed("a shape", parameters.where)
    use = None if state.media is None else MediumUse(state.media, builder.current_object)
    if use is not None:
        builder.media_used.append(use)
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
    geometries = build_shape(kind, parameters, placement)
    alpha = _alpha(parameters, light)
    if alpha == 0.0 and light is None:
        return  # no ray ever meets it
    placed = [PlacedShape(one, state.material, light, parameters.where, alpha) for one in geometries]
    if light is not None and not all(pbrt_samples(one.geometry) for one in placed):
        builder.report.remark(
            f"pbrt lights a scene by the whole {kind}, unstretched: here the light is what is seen of it",
            parameters.where,
        )
    target = builder.shapes if builder.current_object is None else builder.objects[builder.current_object]
    check_room(target, "shapes", parameters.where)
    target.extend(placed)
    if use is not None:
        use.parts = placed


def kinds() -> tuple[str, ...]:
    """The kinds of shape that are read."""
    return tuple(_SHAPES)


def mesh_run(builder: Builder, run: MeshRun, where: Location) -> None:
    """Many meshes under one state as one reflecting shape. SceneError if it is too large."""
    builder.check_placed("a shape", where)
    placement = Placement(builder.state.transform, builder.state.reverse, None)
    mesh = TriangleMesh(placement.transform.points(run.vertices), run.faces, placement.turned)
    problem = range_problem(mesh)
    if problem is not None:
        raise SceneError(problem, where)
    target = builder.shapes if builder.current_object is None else builder.objects[builder.current_object]
    check_room(target, "shapes", where)
    target.append(PlacedShape(mesh, builder.state.material, None, where))


def build_shape(kind: str, parameters: Parameters, placement: Placement) -> list[Geometry]:
    """The geometries of a `Shape` directive, one or two. SceneError for parameters out of range."""
    if kind not in _SHAPES:
        parameters.ignore()
        raise Unsupported(
            f"shape {kind!r} is not supported; supported: {', '.join(_SHAPES)}", parameters.where
        )
    if placement.transform.flattens and kind not in MESHES:
        raise SceneError(FLAT, parameters.where)
    with np.errstate(all="ignore"):
        geometries = _SHAPES[kind](parameters, placement)
        for geometry in geometries:
            problem = range_problem(geometry)
            if problem is not None:
                raise SceneError(problem, parameters.where)
        return [_emitting(g, parameters) for g in geometries] if placement.light else geometries


def _alpha(parameters: Parameters, light: AreaLight | None) -> Alpha | None:
    """The probability that rays meet the shape, None if they always do. As in pbrt, a light of alpha 0 is
    sampled and never met.
    """
    parameter = parameters.take("alpha", "float", "texture")
    if parameter is None:
        return None
    alpha: Alpha
    if parameter.type == "texture":
        alpha = NamedNumbers(parameters.text_of(parameter), parameter.where)
    else:
        alpha = max(parameters.number("alpha", 1.0), 0.0)
        if alpha >= 1:
            return None
    if light is not None and alpha != 0.0:
        parameters.substitute("alpha", "alpha of an area light that is not 0", "opaque")
        return None
    return alpha


def resolve_alpha(alpha: Alpha | None, builder: Builder) -> Texture | None:
    """The alpha of a shape, with its texture looked up by name. SceneError if there is no such texture."""
    if isinstance(alpha, NamedNumbers):
        found = named_texture(builder, "float", alpha.texture, alpha.where).value
        return None if isinstance(found, np.ndarray) and found.min() >= 1 else found
    return None if alpha is None else np.full(3, alpha)


def range_problem(geometry: Geometry) -> str | None:
    """The reason why a shape is too large or too small to compute with, or None."""
    if not isinstance(geometry, Mesh) and not geometry.radius >= 1 / COORDINATE_LIMIT:
        return f"the radius is too small to compute with: {geometry.radius:g}"
    if not in_range(geometry.corners):
        return f"the shape reaches beyond {COORDINATE_LIMIT:g}, the largest coordinate"
    return None


def _emitting(geometry: Geometry, parameters: Parameters) -> Geometry:
    """A triangle mesh without faces of no area, which are lights of no power in pbrt; other shapes as they
    are. SceneError if no face has an area.
    """
    whole = geometry.areas() > 0
    if not np.any(whole):
        raise SceneError(f"the {parameters.owner} emits light but has no area", parameters.where)
    return (
        geometry
        if np.all(whole) or not isinstance(geometry, TriangleMesh)
        else replace(geometry, faces=geometry.faces[whole])
    )


def _radius(parameters: Parameters) -> float:
    radius = parameters.number("radius", 1.0)
    if radius <= 0:
        raise parameters.fail("radius", f"the radius must be positive, not {radius:g}")
    return radius


def _check_side(parameters: Parameters, placement: Placement) -> None:
    light = placement.light
    if light and not light.emission.two_sided and placement.transform.swaps_handedness:
        raise Unsupported(
            f"a one-sided light on a {parameters.owner} under a mirroring transformation: "
            "pbrt-v4 contradicts itself about the side it emits on; take the mirroring out and use "
            "ReverseOrientation",
            parameters.where,
        )


def _bounds(parameters: Parameters, radius: float, limit: float, most: float) -> tuple[float, float]:
    """zmin and zmax in order, within +-limit. pbrt's defaults are `most` and `-most` times the radius."""
    given = [parameters.number(name, value) for name, value in (("zmin", -most), ("zmax", most))]
    low, high = (min(max(value, -limit), limit) for value in (min(given), max(given)))
    return low, high


def _turn(parameters: Parameters) -> float:
    return min(max(parameters.number("phimax", 360.0), 0.0), 360.0)


def _sphere(parameters: Parameters, placement: Placement) -> list[Geometry]:
    radius = _radius(parameters)
    low, high = _bounds(parameters, radius, radius, radius)
    phimax = _turn(parameters)
    _check_side(parameters, placement)
    if (low, high, phimax) == (-radius, radius, 360.0):
        return [_placed(Sphere(np.zeros(3), radius, placement.reverse, np.eye(3)), placement)]
    return [
        _placed(Quadric("sphere", AS_IT_IS, radius, low, high, 0.0, phimax, placement.reverse), placement)
    ]


def _disk(parameters: Parameters, placement: Placement) -> list[Geometry]:
    radius, height = _radius(parameters), parameters.number("height", 0.0)
    inner, phimax = parameters.number("innerradius", 0.0), _turn(parameters)
    _check_side(parameters, placement)
    if inner == 0.0 and phimax == 360.0:
        center, normal = (
            np.array([0.0, 0.0, height]),
            np.array([0.0, 0.0, -1.0 if placement.reverse else 1.0]),
        )
        return [_placed(Disk(center, normal, radius, np.eye(3)), placement)]
    part = Quadric("disk", AS_IT_IS, radius, height, height, abs(inner), phimax, placement.reverse)
    return [_placed(part, placement)]


def _cylinder(parameters: Parameters, placement: Placement) -> list[Geometry]:
    radius = _radius(parameters)
    low, high = _bounds(parameters, radius, np.inf, 1.0)
    _check_side(parameters, placement)
    phimax = _turn(parameters)
    return [
        _placed(Quadric("cylinder", AS_IT_IS, radius, low, high, 0.0, phimax, placement.reverse), placement)
    ]


def _placed(geometry: Geometry, placement: Placement) -> Geometry:
    return place(geometry, placement.transform, placement.light is not None)


@singledispatch
def place(geometry: Geometry, transform: Transform, emits: bool = False) -> Geometry:
    """A shape under a transformation; a `Quadric` if that stretches or shears. emits: whether it is a light.
    A disk that is one keeps its side under a mirror.
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
def _(geometry: Sphere, transform: Transform, emits: bool = False) -> Sphere | Quadric:
    linear = transform.matrix[:3, :3]
    own = AS_IT_IS[:, :3] if geometry.frame is None else geometry.frame
    if transform.only_moves:
        center = transform.points(geometry.center[None])[0]
        return Sphere(center, geometry.radius, geometry.reverse, own + 0.0)
    factor, frame = uniform_scale(linear), orthonormal(linear)
    if factor is None or frame is None:
        matrix, r = np.column_stack([own, geometry.center]), geometry.radius
        return _moved(Quadric("sphere", matrix, r, -r, r, reverse=geometry.reverse), transform)
    center = transform.points(geometry.center[None])[0]
    reverse = geometry.reverse != transform.swaps_handedness
    return Sphere(center, geometry.radius * factor, reverse, frame @ own)


@place.register
def _(geometry: Disk, transform: Transform, emits: bool = False) -> Disk | Quadric:
    own = basis(geometry.normal) if geometry.frame is None else geometry.frame
    if transform.only_moves:
        center = transform.points(geometry.center[None])[0]
        return Disk(center, geometry.normal + 0.0, geometry.radius, own + 0.0)
    plane = transform.matrix[:3, :3] @ own[:, :2]
    factor = uniform_scale(plane)
    if factor is None:
        reverse = float(own[:, 2] @ geometry.normal) < 0
        matrix = np.column_stack([own, geometry.center])
        return _moved(Quadric("disk", matrix, geometry.radius, 0.0, 0.0, reverse=reverse), transform)
    turned = transform.swaps_handedness and not emits
    normal, axis = (_normal(transform, n) for n in (geometry.normal, own[:, 2]))
    frame = np.stack([unit(plane[:, 0]), unit(plane[:, 1]), axis], axis=1) + 0.0
    center = transform.points(geometry.center[None])[0]
    return Disk(center, (-normal if turned else normal) + 0.0, geometry.radius * factor, frame)


@place.register
def _(geometry: Quadric, transform: Transform, emits: bool = False) -> Quadric:
    return _moved(geometry, transform)


def _moved(geometry: Quadric, transform: Transform) -> Quadric:
    """The quadric under a transformation. At hits pbrt turns the normal round under a mirror."""
    full = Transform(np.vstack([geometry.matrix, [0.0, 0.0, 0.0, 1.0]]), np.eye(4))
    matrix, g = (transform @ full).matrix[:3] + 0.0, geometry
    factor, axes = uniform_scale(matrix[:, :3]), orthonormal(matrix[:, :3])
    if factor is None or axes is None:
        factor, axes = 1.0, matrix[:, :3]  # else the scale goes to the lengths, where pbrt's sampling sees it
    return Quadric(
        g.form,
        np.column_stack([axes, matrix[:, 3]]),
        g.radius * factor,
        g.zmin * factor,
        g.zmax * factor,
        g.inner * factor,
        g.phimax,
        g.reverse != transform.swaps_handedness,
    )


def _normal(transform: Transform, n: Array) -> Array:
    """The image of a normal by the inverse transpose: (3,), unit."""
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
    """A disk stands under its own frame, or a right-handed one whose third axis is the normal to the bit."""
    frame, normal, center = geometry.frame, geometry.normal, f"Translate {numbers(geometry.center)}"
    turned = False
    if frame is None:
        axes = matrix("ConcatTransform", basis(normal))
    else:
        # A light keeps its side under a mirror, in pbrt and here.
        turned = (float(frame[:, 2] @ normal) < 0) != (_mirrors(frame) and not emits)
        axes = rotation(frame, "a disk's")
    return [*_reverse(turned), center, axes, f'Shape "disk" "float radius" [ {geometry.radius!r} ]']


@shape_text.register
def _(geometry: Quadric, emits: bool) -> list[str]:
    g, mirrored = geometry, bool(np.linalg.det(geometry.matrix[:, :3]) < 0)
    values = {"radius": g.radius, "phimax": g.phimax}
    values |= (
        {"height": g.zmin, "innerradius": g.inner} if g.form == "disk" else {"zmin": g.zmin, "zmax": g.zmax}
    )
    if mirrored and emits:
        raise PenumbraError("pbrt contradicts itself about the side that a mirrored quadric emits on")
    text = " ".join(f'"float {name}" [ {value!r} ]' for name, value in values.items())
    return [
        *_reverse(g.reverse != mirrored),
        matrix("ConcatTransform", g.matrix),
        f'Shape "{g.form}" {text}',
    ]


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
    "cylinder": _cylinder,
    "curve": curve,
}
