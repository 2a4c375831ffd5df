"""Shapes for Mitsuba: analytic ones, meshes of triangles, and lights with two sides.

Emitting rectangles, and all whole disks and spheres, stay analytic; every other quadrilateral becomes two
flat triangles, and quadrics become many. Mitsuba's area lights have one side. One with two is two lights back
to back, each moved `BACK_TO_BACK` the way it shines: the nearer one is always the one that faces the ray,
which two coincident ones would leave to chance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import singledispatch

import numpy as np

from pipeline.references.mitsuba.surfaces import bitmap, bsdf, is_textured
from pipeline.references.mitsuba.worker import Faces, Plugin
from scenes.description.materials import is_oriented
from scenes.description.shapes import (
    PATCH_UV,
    SEGMENTS,
    Array,
    BilinearMesh,
    Disk,
    Emission,
    Geometry,
    Mesh,
    Quadric,
    ShapeDescription,
    Sphere,
    TriangleMesh,
    basis,
    vertex_normals,
)
from scenes.description.textures import UVMapping
from scenes.errors import SceneError

# An emitting mesh of more quadrilaterals becomes one emitter: Mitsuba has one object an emitter.
MOST_RECTANGLES = 16
# Times 1 + max|p|: 80 float32 roundings, and a ninth of the distance that rays start off a surface.
BACK_TO_BACK = 1e-5
SWAP = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])


@dataclass(frozen=True, eq=False)
class Frame:
    """Normalised coordinates, scale * (p - center).

    center: (3,), world space. scale: a power of two, which rounds nothing.
    """

    center: Array
    scale: float

    def points(self, p: Array) -> Array:
        """World points (..., 3) in normalised coordinates."""
        return (p - self.center) * self.scale


def affine(axes: Array, origin: Array) -> Array:
    """The transformation (4, 4) with these axes, (3, 3) columns, and this origin."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = axes, origin
    return result


def shapes(shape: ShapeDescription, frame: Frame) -> Iterator[Plugin]:
    """The shape as Mitsuba's plug-ins in normalised coordinates; SceneError if Mitsuba cannot have it."""
    if shape.perturbs_normals:
        raise SceneError("normal maps and displacements are not handed to Mitsuba", shape.where)
    if shape.alpha is not None:
        raise SceneError(
            "Mitsuba's shadow rays stop at a surface whatever its opacity, and this has an alpha", shape.where
        )
    if shape.emission is None or not shape.emission.two_sided:
        yield from plugins(shape.geometry, shape, frame, 0.0)
        return
    distance = side_shift(shape.geometry, frame)
    for geometry in (shape.geometry, shape.geometry.flipped()):
        yield from plugins(geometry, shape, frame, distance)


def side_shift(geometry: Geometry, frame: Frame) -> float:
    """How far each side of a two-sided light is moved along its normal, in normalised coordinates."""
    return BACK_TO_BACK * (1.0 + float(np.abs(frame.points(geometry.corners)).max()))


@singledispatch
def plugins(geometry: Geometry, shape: ShapeDescription, frame: Frame, shift: float) -> Iterator[Plugin]:
    """One side of a shape, with its material and emission.

    shift: how far the surface is moved along its normal, in normalised coordinates.
    """
    raise SceneError(f"Mitsuba has no counterpart of {type(geometry).__name__}", shape.where)


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
    image = emission.image * emission.radiance  # looked up as pbrt does
    return bitmap(image, UVMapping(), "clamp", "bilinear", to_uv)


@plugins.register
def _(geometry: Sphere, shape: ShapeDescription, frame: Frame, shift: float) -> Iterator[Plugin]:
    """pbrt's v runs up and Mitsuba's down; under a mirror pbrt's u runs the other way too."""
    axes, to_uv = np.eye(3), np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])
    if geometry.frame is not None:
        axes = geometry.frame
        if np.linalg.det(axes) < 0:
            axes, to_uv = axes * (1.0, -1.0, 1.0), np.array([[-1.0, 0, 1], [0, -1, 1], [0, 0, 1]])
    radius = geometry.radius * frame.scale + (-shift if geometry.reverse else shift)
    to_world = affine(axes * radius, frame.points(geometry.center))
    yield _plugin("sphere", shape, to_uv, {"to_world": to_world, "flip_normals": geometry.reverse})


@plugins.register
def _(geometry: Disk, shape: ShapeDescription, frame: Frame, shift: float) -> Iterator[Plugin]:
    """pbrt's u is the angle and v runs inwards, Mitsuba's u runs outwards and v is the angle."""
    normal = geometry.normal
    axes = basis(normal) if geometry.frame is None else geometry.frame
    to_world = affine(axes * geometry.radius * frame.scale, frame.points(geometry.center) + shift * normal)
    to_uv = np.array([[0.0, 1, 0], [-1, 0, 1], [0, 0, 1]])
    yield _plugin(
        "disk", shape, to_uv, {"to_world": to_world, "flip_normals": float(axes[:, 2] @ normal) < 0}
    )


@plugins.register
def _(geometry: Quadric, shape: ShapeDescription, frame: Frame, shift: float) -> Iterator[Plugin]:
    """Triangles, at most 1.9e-5 of the radius below the surface, with the surface's normals.

    An emitter's have their own normals, and its area is 2.5e-5 too small.
    """
    if is_oriented(shape.material):
        raise SceneError(
            f"anisotropic roughness on a part of a {geometry.form} is not handed to Mitsuba", shape.where
        )
    yield _mesh(shape, geometry.as_mesh(SEGMENTS, smooth=shape.emission is None), frame, shift)


@plugins.register
def _(geometry: BilinearMesh, shape: ShapeDescription, frame: Frame, shift: float) -> Iterator[Plugin]:
    few = len(geometry.faces) <= MOST_RECTANGLES
    if shape.emission and few and geometry.are_rectangles() and geometry.are_parallelograms():
        for face in geometry.faces:
            to_world, to_uv = _rectangle(geometry, face, frame, shift)
            yield _plugin("rectangle", shape, to_uv, {"to_world": to_world})
        return
    _check_convex(geometry, shape)
    varies = is_textured(shape.material, shape.where) or is_oriented(shape.material)
    if varies and not geometry.are_parallelograms():
        raise SceneError(
            "a texture on a bilinear patch that is no parallelogram cannot be given to Mitsuba", shape.where
        )
    yield _mesh(shape, geometry, frame, shift)


@plugins.register
def _(geometry: TriangleMesh, shape: ShapeDescription, frame: Frame, shift: float) -> Iterator[Plugin]:
    yield _mesh(shape, geometry, frame, shift)


def _rectangle(mesh: BilinearMesh, face: Faces, frame: Frame, shift: float) -> tuple[Array, Array]:
    """The transformation (4, 4) of Mitsuba's square [-1, 1]^2 to a patch, and (3, 3) of its uv to pbrt's."""
    points, uv = frame.points(mesh.vertices[face]), PATCH_UV if mesh.uv is None else mesh.uv[face]
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


def triangles(geometry: Geometry, segments: int) -> tuple[Array, Faces]:
    """Vertices (m, 3) in world space, and faces (t, 3), ordered so as to give the description's normals."""
    made = geometry.triangulated(segments)
    return made.vertices, made.faces[:, ::-1] if made.reverse else made.faces


def _mesh(shape: ShapeDescription, mesh: Mesh, frame: Frame, shift: float) -> Plugin:
    vertices, faces = triangles(mesh, 0)
    vertices, uv, normals = frame.points(vertices), None, vertex_normals(mesh)
    if normals is not None and shape.emission is not None:
        raise SceneError("Mitsuba's emitters with vertex normals disagree with themselves", shape.where)
    if normals is not None:
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        if not ((length > 0) & (length < np.inf)).all():
            raise SceneError("Mitsuba needs vertex normals of a length, and one has none", shape.where)
    if is_textured(shape.material, shape.where) or is_oriented(shape.material):
        corners = mesh.triangle_uv()
        uv = (corners[:, ::-1] if mesh.reverse else corners).reshape(-1, 2)
    if uv is not None or shift:  # every face on its own
        vertices = vertices[faces]
        if shift:
            across = np.cross(vertices[:, 1] - vertices[:, 0], vertices[:, 2] - vertices[:, 0])
            lengths = np.linalg.norm(across, axis=1, keepdims=True)
            vertices = vertices + (shift * across / np.where(lengths > 0, lengths, 1.0))[:, None]
        normals = None if normals is None else normals[faces].reshape(-1, 3)
        vertices, faces = vertices.reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    values: dict[str, object] = {"vertices": vertices, "faces": faces, "uv": uv, "normals": normals}
    return _plugin("mesh", shape, np.eye(3), values)


def _check_convex(mesh: BilinearMesh, shape: ShapeDescription) -> None:
    """Two triangles cover a planar patch only where it is convex, whichever diagonal is taken."""
    rings = np.moveaxis(mesh.vertices[mesh.faces[:, [0, 1, 3, 2]]], 1, 0)
    edges = np.roll(rings, -1, axis=0) - rings
    turns = np.cross(edges, np.roll(edges, -1, axis=0))
    if np.any(np.einsum("kqi,qi->kq", turns, turns.sum(axis=0)) < 0):
        raise SceneError("a bilinear patch that is not convex cannot be given to Mitsuba", shape.where)
