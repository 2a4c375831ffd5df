"""Mitsuba's shapes as directives of pbrt.

Meshes, rectangles and cubes are written in world space; quadrics under their transformation, from which a
mirror is taken out: it changes nothing of them and pbrt contradicts itself about the side of mirrored lights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from io import StringIO
from typing import Any, cast

import numpy as np
from trimesh import Trimesh
from trimesh.exchange.obj import load_obj  # pyright: ignore[reportUnknownVariableType]

from pipeline.convert.document import mesh_lines, patch_lines, placed
from pipeline.convert.mitsuba.document import Plugin
from scenes.arrays import Array, Index
from scenes.description.shapes import basis
from scenes.errors import PenumbraError, SceneError
from scenes.files import Files, read_bytes
from scenes.ply.mesh import read_ply

SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
PLAIN = np.eye(3)
UPSIDE_DOWN = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])  # v of a sphere runs down in Mitsuba


@dataclass(frozen=True, eq=False)
class Placed:
    """A shape as pbrt's directives.

    to_uv: (3, 3), from pbrt's texture coordinates to Mitsuba's; None if no affine map does it. rectangle:
    whether it is a rectangle.
    """

    lines: list[str]
    to_uv: Array | None = None
    rectangle: bool = False


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh. vertices, normals: (m, 3). uv: (m, 2). faces: (t, 3)."""

    vertices: Array
    faces: Index
    normals: Array | None
    uv: Array | None


def place_shape(shape: Plugin, outer: Array, files: Files, flat: bool) -> Placed | None:
    """Convert a shape; None for an unknown kind.

    outer: (4, 4), the transformation of the group that it is in. flat: whether vertex normals are left out,
    as those of lights are.
    """
    if shape.type not in SHAPES:
        return None
    return SHAPES[shape.type](shape, outer @ shape.transform(), files, flat)


def _points(matrix: Array, points: Array) -> Array:
    return np.asarray(np.einsum("ij,mj->mi", matrix[:3, :3], points) + matrix[:3, 3], dtype=np.float64)


def _rectangle(shape: Plugin, matrix: Array, files: Files, flat: bool) -> Placed:
    corners = _points(matrix, SQUARE)
    # Its normal is the transformed one; of a mirrored patch that of the corners is opposite.
    mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
    return Placed(patch_lines(corners, shape.flag("flip_normals", False) != mirrored), PLAIN, rectangle=True)


def _cube(shape: Plugin, matrix: Array, files: Files, flat: bool) -> Placed:
    """Six squares, each with texture coordinates from 0 to 1."""
    corners: list[Array] = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            # u and v along the next two axes; the order of corners makes the normal point outwards.
            order = SQUARE if side > 0 else SQUARE[[0, 2, 1, 3]]
            corners.append(np.roll(np.column_stack([order[:, :2], np.full(4, side)]), axis + 1, axis=1))
    vertices = np.concatenate(corners)
    faces = np.concatenate([np.array([[0, 1, 3], [0, 3, 2]]) + 4 * i for i in range(6)])
    uv = np.tile(np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]]), (6, 1))
    mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
    turned = shape.flag("flip_normals", False) != mirrored
    return Placed(mesh_lines(_points(matrix, vertices), faces, uv, None, turned), PLAIN)


def _round(matrix: Array, text: str, flipped: bool, to_uv: Array | None) -> Placed:
    if np.linalg.det(matrix[:3, :3]) < 0:
        matrix = matrix @ np.diag([-1.0, 1.0, 1.0, 1.0])
        to_uv = None
    lines = ["ReverseOrientation"] if flipped else []
    return Placed([*lines, placed("ConcatTransform", matrix), text], to_uv)


def _sphere(shape: Plugin, matrix: Array, files: Files, flat: bool) -> Placed:
    center, radius = shape.vector("center", (0.0, 0.0, 0.0)), shape.number("radius", 1.0)
    own = np.diag([radius, radius, radius, 1.0])
    own[:3, 3] = center
    text = 'Shape "sphere" "float radius" [ 1 ]'
    return _round(matrix @ own, text, shape.flag("flip_normals", False), UPSIDE_DOWN)


def _disk(shape: Plugin, matrix: Array, files: Files, flat: bool) -> Placed:
    text = 'Shape "disk" "float radius" [ 1 ]'
    return _round(matrix, text, shape.flag("flip_normals", False), None)


def _cylinder(shape: Plugin, matrix: Array, files: Files, flat: bool) -> Placed:
    start, end = shape.vector("p0", (0.0, 0.0, 0.0)), shape.vector("p1", (0.0, 0.0, 1.0))
    length, radius = float(np.linalg.norm(end - start)), shape.number("radius", 1.0)
    if not (length > 0 and radius > 0):
        raise SceneError("a cylinder needs a length and a radius above 0", shape.where)
    own = np.eye(4)
    own[:3, :3] = basis((end - start) / length)
    own[:3, 3] = start
    text = f'Shape "cylinder" "float radius" [ {radius!r} ] "float zmin" [ 0 ] "float zmax" [ {length!r} ]'
    return _round(matrix @ own, text, shape.flag("flip_normals", False), None)


def _mesh(shape: Plugin, matrix: Array, mesh: Mesh, flat: bool) -> Placed:
    flipped = shape.flag("flip_normals", False)
    vertices, normals = _points(matrix, mesh.vertices), None
    if not flat and not shape.flag("face_normals", False):
        if mesh.normals is None:
            normals = vertex_normals(vertices, mesh.faces)
        else:
            normals = np.einsum("ji,mj->mi", np.linalg.inv(matrix[:3, :3]), mesh.normals)
        normals = -normals if flipped else normals
    return Placed(mesh_lines(vertices, mesh.faces, mesh.uv, normals, flipped), PLAIN)


def vertex_normals(vertices: Array, faces: Index) -> Array:
    """Unit normals (m, 3): the mean over the faces about a vertex, weighted by their angles [thurmer1998].

    Mitsuba makes them so too. A vertex whose faces have no area gets (0, 0, 1).
    """
    mesh: Any = Trimesh(vertices, faces, process=False)
    normals = np.asarray(mesh.vertex_normals, dtype=np.float64)
    return np.where(normals.any(axis=1, keepdims=True), normals, np.array([0.0, 0.0, 1.0]))


def _ply(shape: Plugin, matrix: Array, files: Files, flat: bool) -> Placed:
    path = files.find(shape.text("filename", ""), None, shape.where)
    try:
        found = read_ply(path)
    except PenumbraError as error:
        raise SceneError(str(error), shape.where) from None
    faces = np.concatenate([found.triangles, found.quads[:, :3], found.quads[:, [0, 2, 3]]])
    uv = found.uv
    if uv is not None and shape.flag("flip_tex_coords", False):
        uv = uv * (1.0, -1.0) + (0.0, 1.0)
    return _mesh(shape, matrix, Mesh(found.vertices, faces, found.normals, uv), flat)


def _obj(shape: Plugin, matrix: Array, files: Files, flat: bool) -> Placed:
    path = files.find(shape.text("filename", ""), None, shape.where)
    try:
        mesh = _joined(_obj_parts(read_bytes(path).decode("utf-8", errors="replace")))
    except PenumbraError as error:
        raise SceneError(str(error), shape.where) from None
    except (ValueError, IndexError, KeyError, TypeError) as error:
        raise SceneError(f"{str(path)!r} is no OBJ file that can be read: {error}", shape.where) from None
    if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise SceneError(f"{str(path)!r} has no faces, or a vertex that is not finite", shape.where)
    if mesh.uv is not None and shape.flag("flip_tex_coords", True):
        mesh = replace(mesh, uv=mesh.uv * (1.0, -1.0) + (0.0, 1.0))
    return _mesh(shape, matrix, mesh, flat)


def _obj_parts(text: str) -> list[Mesh]:
    """The meshes of an OBJ file, by trimesh."""
    options: Any = {"skip_materials": True, "group_material": False, "maintain_order": True}
    found = cast("Any", load_obj(StringIO(text), **options))
    parts: list[Mesh] = []
    for one in found.get("geometry", {"": found}).values():
        normals, uv = one.get("vertex_normals"), getattr(one.get("visual"), "uv", None)
        parts.append(
            Mesh(
                np.asarray(one["vertices"], dtype=np.float64),
                np.asarray(one["faces"], dtype=np.int64).reshape(-1, 3),
                None if normals is None else np.asarray(normals, dtype=np.float64),
                None if uv is None else np.asarray(uv, dtype=np.float64),
            )
        )
    return parts


def _joined(parts: list[Mesh]) -> Mesh:
    """Meshes as one, with normals and texture coordinates where all have them."""
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, first, strict=False)]
    normals, uv = [part.normals for part in parts], [part.uv for part in parts]
    return Mesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate(faces),
        np.concatenate([n for n in normals if n is not None])
        if all(n is not None for n in normals)
        else None,
        np.concatenate([t for t in uv if t is not None]) if all(t is not None for t in uv) else None,
    )


SHAPES: dict[str, Callable[[Plugin, Array, Files, bool], Placed]] = {
    "rectangle": _rectangle,
    "cube": _cube,
    "sphere": _sphere,
    "disk": _disk,
    "cylinder": _cylinder,
    "ply": _ply,
    "obj": _obj,
}
