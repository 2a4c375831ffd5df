"""Shapes for Mitsuba: what stays analytic, what becomes triangles, and how a light gets its second side.

Emitting rectangles, and all disks and spheres, stay analytic; every other quadrilateral becomes two flat
triangles. Mitsuba's area lights have one side. One with two is two lights back to back, each moved
`BACK_TO_BACK` the way it shines: the nearer one is always the one that faces the ray, which two coincident
ones would leave to chance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pipeline.references.mitsuba.surfaces import bitmap, bsdf, is_textured
from pipeline.references.mitsuba.worker import Faces, Plugin
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
from scenes.description.textures import UVMapping
from scenes.errors import SceneError

MOST_RECTANGLES = (
    16  # an emitting mesh of more quadrilaterals becomes one emitter: Mitsuba has one object an emitter
)
BACK_TO_BACK = (
    1e-5  # times 1 + max|p|: 80 float32 roundings, and a ninth of the distance that rays start off a surface
)
SWAP = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])
CORNERS = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])


@dataclass(frozen=True, eq=False)
class Frame:
    """Normalised coordinates: scale * (p - center). center: (3,) world; scale: a power of two, so that it
    rounds nothing.
    """

    center: Array
    scale: float

    def points(self, p: Array) -> Array:
        """World points (..., 3) in normalised coordinates."""
        return (p - self.center) * self.scale


def corners(geometry: Geometry) -> Array:
    """Points (m, 3), world space, whose bounding box holds the shape."""
    if isinstance(geometry, TriangleMesh | BilinearMesh):
        return geometry.vertices
    reach = geometry.radius * np.array([[-1.0], [1.0]])
    return geometry.center + reach * np.ones(3)


def triangles(mesh: TriangleMesh | BilinearMesh) -> Faces:
    """Faces (t, 3) whose normals (p1-p0) x (p2-p0) are the description's, `reverse` included."""
    faces = mesh.faces
    if isinstance(mesh, BilinearMesh):
        faces = np.concatenate([faces[:, (0, 1, 3)], faces[:, (0, 3, 2)]])
    return faces[:, ::-1] if mesh.reverse else faces


def basis(normal: Array) -> Array:
    """A right-handed orthonormal basis (3, 3), columns x y z, whose z is `normal`."""
    x = np.asarray(np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))]), dtype=np.float64)
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    return np.stack([x, y, normal], axis=1)


def affine(axes: Array, origin: Array) -> Array:
    """The transformation (4, 4) with these axes, (3, 3) columns, and this origin."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = axes, origin
    return result


def shapes(shape: ShapeDescription, frame: Frame) -> Iterator[Plugin]:
    """The shape in normalised coordinates; SceneError where it has no counterpart."""
    if shape.emission is None or not shape.emission.two_sided:
        yield from _one_sided(shape, frame, 0.0)
        return
    distance = side_shift(shape.geometry, frame)
    back = _turned(shape.geometry)
    yield from _one_sided(shape, frame, distance)
    yield from _one_sided(replace(shape, geometry=back), frame, distance)


def side_shift(geometry: Geometry, frame: Frame) -> float:
    """How far, in normalised coordinates, each side of a two-sided light is moved the way it shines."""
    return BACK_TO_BACK * (1.0 + float(np.abs(frame.points(corners(geometry))).max()))


def _turned(geometry: Geometry) -> Geometry:
    if isinstance(geometry, Disk):
        return replace(geometry, normal=-geometry.normal)
    return replace(geometry, reverse=not geometry.reverse)


def _one_sided(shape: ShapeDescription, frame: Frame, shift: float) -> Iterator[Plugin]:
    """shift: how far the surface is moved along its normal, in normalised coordinates."""
    geometry = shape.geometry
    if isinstance(geometry, Sphere):
        yield _sphere(shape, geometry, frame, shift)
    elif isinstance(geometry, Disk):
        yield _disk(shape, geometry, frame, shift)
    elif shape.emission and isinstance(geometry, BilinearMesh) and _are_few_rectangles(geometry):
        for face in geometry.faces:
            to_world, to_uv = _rectangle(geometry, face, frame, shift)
            yield _plugin("rectangle", shape, to_uv, {"to_world": to_world})
    else:
        yield _mesh(shape, geometry, frame, shift)


def _plugin(kind: str, shape: ShapeDescription, to_uv: Array, values: dict[str, object]) -> Plugin:
    values = values | {"bsdf": bsdf(shape.material, to_uv, shape.where)}
    if shape.emission is not None:
        if shape.emission.image is not None and kind != "rectangle":
            raise SceneError(
                f"an image on a light can be given to Mitsuba on at most {MOST_RECTANGLES} rectangles",
                shape.where,
            )
        values["emitter"] = Plugin("emitter", "area", {"radiance": _radiance(shape.emission, to_uv)})
    return Plugin("shape", kind, values)


def _radiance(emission: Emission, to_uv: Array) -> Array | Plugin:
    if emission.image is None:
        return emission.radiance
    return bitmap(
        emission.image * emission.radiance, UVMapping(), "clamp", "bilinear", to_uv
    )  # as pbrt looks it up


def _sphere(shape: ShapeDescription, sphere: Sphere, frame: Frame, shift: float) -> Plugin:
    """pbrt's v runs up and Mitsuba's down; under a mirror pbrt's u runs the other way too."""
    axes, to_uv = np.eye(3), np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])
    if sphere.frame is not None:
        axes = sphere.frame
        if np.linalg.det(axes) < 0:
            axes, to_uv = axes * (1.0, -1.0, 1.0), np.array([[-1.0, 0, 1], [0, -1, 1], [0, 0, 1]])
    radius = sphere.radius * frame.scale + (-shift if sphere.reverse else shift)
    to_world = affine(axes * radius, frame.points(sphere.center))
    return _plugin("sphere", shape, to_uv, {"to_world": to_world, "flip_normals": sphere.reverse})


def _disk(shape: ShapeDescription, disk: Disk, frame: Frame, shift: float) -> Plugin:
    """pbrt's u is the angle and v runs inwards, Mitsuba's u runs outwards and v is the angle."""
    axes = basis(disk.normal) if disk.frame is None else disk.frame
    to_world = affine(axes * disk.radius * frame.scale, frame.points(disk.center) + shift * disk.normal)
    flip = float(axes[:, 2] @ disk.normal) < 0
    to_uv = np.array([[0.0, 1, 0], [-1, 0, 1], [0, 0, 1]])
    return _plugin("disk", shape, to_uv, {"to_world": to_world, "flip_normals": flip})


def _rectangle(mesh: BilinearMesh, face: Faces, frame: Frame, shift: float) -> tuple[Array, Array]:
    """The transformation of [-1, 1]^2, normal +z, to a patch with corners p00 p10 p01 p11, and from its uv
    there to pbrt's.
    """
    points, uv = frame.points(mesh.vertices[face]), CORNERS if mesh.uv is None else mesh.uv[face]
    u, v = (points[1] - points[0]) / 2, (points[2] - points[0]) / 2
    to_uv = affine_uv(uv[1] - uv[0], uv[2] - uv[0], uv[0])
    if mesh.reverse:
        u, v, to_uv = v, u, to_uv @ SWAP
    normal = np.cross(u, v)
    length = float(np.linalg.norm(normal))
    axes = np.stack([u, v, normal / np.sqrt(length)], axis=1)
    return affine(axes, points.mean(axis=0) + shift / length * normal), to_uv


def affine_uv(u: Array, v: Array, origin: Array) -> Array:
    """The map (3, 3) of the plane that takes (1, 0) to origin + u and (0, 1) to origin + v; each (2,)."""
    result = np.eye(3)
    result[:2, 0], result[:2, 1], result[:2, 2] = u, v, origin
    return result


def _mesh(shape: ShapeDescription, mesh: TriangleMesh | BilinearMesh, frame: Frame, shift: float) -> Plugin:
    _check_convex(shape)
    faces, uv = triangles(mesh), None
    vertices = frame.points(mesh.vertices)
    if is_textured(shape.material, shape.where):
        if isinstance(mesh, BilinearMesh):
            _check_parallelograms(shape, mesh)
        uv = _uv(mesh)
    if uv is not None or shift:  # every face on its own
        vertices = vertices[faces]
        if shift:
            normals = np.cross(vertices[:, 1] - vertices[:, 0], vertices[:, 2] - vertices[:, 0])
            lengths = np.linalg.norm(normals, axis=1, keepdims=True)
            vertices = vertices + (shift * normals / np.where(lengths > 0, lengths, 1.0))[:, None]
        vertices, faces = vertices.reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    return _plugin("mesh", shape, np.eye(3), {"vertices": vertices, "faces": faces, "uv": uv})


def _uv(mesh: TriangleMesh | BilinearMesh) -> Array:
    """Of each corner of each triangle, (3 t, 2)."""
    if mesh.uv is not None:
        return mesh.uv[triangles(mesh)].reshape(-1, 2)
    if isinstance(mesh, TriangleMesh):
        own = np.array([[0.0, 0], [1, 0], [1, 1]])
        return np.tile(own[::-1] if mesh.reverse else own, (len(mesh.faces), 1))
    # Vertices that patches share have a uv in each of them.
    apart = replace(mesh, faces=np.arange(mesh.faces.size).reshape(-1, 4))
    return np.tile(CORNERS, (len(mesh.faces), 1))[triangles(apart)].reshape(-1, 2)


def _corner_values(values: Array, faces: Faces) -> Array:
    return np.moveaxis(values[faces], 1, 0)


def _are_few_rectangles(mesh: BilinearMesh) -> bool:
    """Right angles and a fourth corner in place to 1e-6, which is beyond what Mitsuba's float32 resolves; a
    uv that is as straight.
    """
    p00, p10, p01, p11 = _corner_values(mesh.vertices, mesh.faces)
    u, v, gap = p10 - p00, p01 - p00, p11 - p10 - p01 + p00
    sizes = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1)
    right = np.abs(np.sum(u * v, axis=1)) <= 1e-6 * sizes
    closed = np.sum(gap * gap, axis=1) <= 1e-12 * sizes
    return (
        len(mesh.faces) <= MOST_RECTANGLES
        and bool(np.all(right & closed & (sizes > 0)))
        and _uv_is_straight(mesh)
    )


def _uv_is_straight(mesh: BilinearMesh) -> bool:
    if mesh.uv is None:
        return True
    p00, p10, p01, p11 = _corner_values(mesh.uv, mesh.faces)
    return bool(np.abs(p11 - p10 - p01 + p00).max() <= 1e-6 * np.abs(mesh.uv).max())


def _check_parallelograms(shape: ShapeDescription, mesh: BilinearMesh) -> None:
    """Elsewhere uv bends across a patch, and stays straight across two triangles."""
    p00, p10, p01, p11 = _corner_values(mesh.vertices, mesh.faces)
    size = np.linalg.norm(p10 - p00, axis=1) + np.linalg.norm(p01 - p00, axis=1)
    if np.any(np.linalg.norm(p11 - p10 - p01 + p00, axis=1) > 1e-6 * size) or not _uv_is_straight(mesh):
        raise SceneError(
            "a texture on a bilinear patch that is no parallelogram cannot be given to Mitsuba", shape.where
        )


def _check_convex(shape: ShapeDescription) -> None:
    """Two triangles cover a planar patch only where it is convex, whichever diagonal is taken."""
    if isinstance(shape.geometry, BilinearMesh):
        p00, p10, p01, p11 = _corner_values(shape.geometry.vertices, shape.geometry.faces)
        rings = np.stack([p00, p10, p11, p01])
        edges = np.roll(rings, -1, axis=0) - rings
        turns = np.cross(edges, np.roll(edges, -1, axis=0))
        if np.any(np.einsum("kqi,qi->kq", turns, turns.sum(axis=0)) < 0):
            raise SceneError("a bilinear patch that is not convex cannot be given to Mitsuba", shape.where)
