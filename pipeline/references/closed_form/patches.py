"""Planes, planar convex patches, and the proof that a mesh tiles one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.arrays import Array
from scenes.description.shapes import BilinearMesh, ShapeDescription, TriangleMesh
from scenes.errors import Location, SceneError

FLAT = 1e-9  # out-of-plane error allowed, of a shape's extent: far above rounding, invisible in any picture


def needs(what: str, where: Location | None = None) -> SceneError:
    """The refusal of a scene without `what`, for the caller to raise."""
    return SceneError(f"the closed form needs {what}", where)


@dataclass(frozen=True, eq=False)
class Patch:
    """A planar convex polygon. outline: (m, 3), counter-clockwise about the unit normal (3,)."""

    outline: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane: a point of it and its unit normal, (3,) each."""

    point: Array
    normal: Array

    def height(self, points: Array) -> Array:
        """Signed distances (...) of points (..., 3)."""
        return np.asarray((points - self.point) @ self.normal)


def area(p: Array) -> float:
    """Area of a planar polygon (m, 3)."""
    return float(np.linalg.norm(np.cross(p[1:-1] - p[0], p[2:] - p[0]).sum(axis=0))) / 2


def outline(mesh: TriangleMesh | BilinearMesh, shape: ShapeDescription, *, oriented: bool) -> Patch:
    """The outline of a mesh that tiles a planar convex polygon; SceneError if it does not.

    Proof of tiling: all faces are convex and turn the same way, shared edges cancel, and the other edges form
    one convex loop of winding number 1, so that every point inside is covered exactly once. oriented: whether
    faces must already turn the same way, as a light's do; else they are turned.
    """
    if shape.alpha is not None or shape.perturbs_normals:
        raise needs("shapes without an alpha, a normal map or bumps", shape.where)
    faces = _corners(mesh)
    vertices, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    p = vertices[faces]
    areas = np.cross(p[:, 1:-1] - p[:, :1], p[:, 2:] - p[:, :1]).sum(axis=1)
    size = float(np.ptp(p.reshape(-1, 3), axis=0).max())
    normal = areas[np.argmax((areas**2).sum(axis=1))]
    if not float(np.linalg.norm(normal)) > (FLAT * size) ** 2:
        raise needs("faces with an area", shape.where)
    normal = normal / np.linalg.norm(normal)
    if not oriented:
        normal = normal * np.copysign(1.0, normal[np.argmax(np.abs(normal))])
        faces = np.where((areas @ normal < 0)[:, None], faces[:, ::-1], faces)
    _require_flat(vertices[faces], normal, size, shape)
    return Patch(_convex_loop(vertices, _boundary(faces, shape), normal, shape), normal)


def _corners(mesh: TriangleMesh | BilinearMesh) -> NDArray[np.int64]:
    """Faces as loops, turned round where `reverse` is set; a bilinear patch is stored p00 p10 p01 p11."""
    loops = mesh.faces if isinstance(mesh, TriangleMesh) else mesh.faces[:, [0, 1, 3, 2]]
    return loops[:, ::-1] if mesh.reverse else loops


def _require_flat(p: Array, normal: Array, size: float, shape: ShapeDescription) -> None:
    """Raise SceneError unless the faces p (f, c, 3) are in one plane, convex, and turn about `normal`."""
    if float(np.ptp(p @ normal)) > FLAT * size:
        raise needs("every shape to be flat, and this one is not", shape.where)
    edges = np.roll(p, -1, axis=1) - p
    turns = np.cross(edges, np.roll(edges, -1, axis=1)) @ normal
    if np.any(turns <= 0):
        raise needs("convex faces that all turn the same way", shape.where)


def _boundary(faces: NDArray[np.int64], shape: ShapeDescription) -> list[int]:
    """Vertex indices of the one loop of edges that no two faces share."""
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    count = int(faces.max()) + 1
    code, reverse = start * count + end, end * count + start
    outer = ~np.isin(code, reverse)
    following = dict(zip(start[outer].tolist(), end[outer].tolist(), strict=True))
    loop = [next(iter(following))] if following else []
    while loop and following[loop[-1]] != loop[0] and len(loop) <= len(following):
        loop.append(following[loop[-1]])
    if np.unique(code).size != code.size or len(loop) != int(outer.sum()):
        raise needs("faces that form one patch without holes or overlaps", shape.where)
    return loop


def _convex_loop(vertices: Array, loop: list[int], normal: Array, shape: ShapeDescription) -> Array:
    """The loop's corners (m, 3) without collinear ones; it must turn left everywhere, and once in all."""
    p = vertices[loop]
    edges = np.roll(p, -1, axis=0) - p
    following = np.roll(edges, -1, axis=0)
    turn = np.arctan2(np.cross(edges, following) @ normal, (edges * following).sum(axis=1))
    if np.any(turn < -FLAT) or abs(turn.sum() - 2 * np.pi) > 1e-6:
        raise needs("a convex outline", shape.where)
    return np.roll(p, -1, axis=0)[turn > FLAT]
