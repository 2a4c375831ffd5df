"""The division of shapes between formulas and Embree, and the arrays of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from renderer.geometry.analytic import AnalyticPrimitives, join, primitives_of
from renderer.geometry.triangles import Triangles, make_triangles
from renderer.math.vectors import Floats
from scenes.arrays import Index
from scenes.description.patches import refined
from scenes.description.shapes import BilinearMesh, Mesh, ShapeDescription, TriangleMesh
from scenes.errors import SceneError

# Emitting meshes of at most so many faces are analytic: each face costs every ray some 20 ns there.
FEW = 64
# In units of the largest coordinate of a scene: far above the 1e-16 by which a vertex is rounded, far below
# any gap meant.
TOLERANCE = 1e-11


def is_analytic(shape: ShapeDescription) -> bool:
    """Whether rays meet a shape by formula. Dark meshes and meshes of many triangles go to Embree."""
    g = shape.geometry
    if not isinstance(g, Mesh):
        return True
    return shape.emission is not None and (isinstance(g, BilinearMesh) or len(g.faces) <= FEW)


def analytic_primitives(shapes: Sequence[ShapeDescription]) -> AnalyticPrimitives:
    """The primitives of all analytic shapes, in the order of shapes and their faces."""
    return join([one for i, s in enumerate(shapes) if is_analytic(s) for one in primitives_of(s.geometry, i)])


def all_triangles(shapes: Sequence[ShapeDescription]) -> Triangles | None:
    """All triangles and patches that Embree holds as one mesh, in the order of shapes and faces; None without
    any.
    """
    held = [(i, s.geometry) for i, s in enumerate(shapes) if not is_analytic(s)]
    meshes = [(i, g, g.triangulated().faces) for i, g in held if isinstance(g, Mesh)]
    if not meshes:
        return None
    starts = np.cumsum([0, *(len(g.vertices) for _, g, _ in meshes)])[:-1]
    counts = [len(faces) for _, _, faces in meshes]
    return make_triangles(
        np.concatenate([g.vertices for _, g, _ in meshes]),
        np.concatenate([faces for _, _, faces in meshes]) + np.repeat(starts, counts)[:, None],
        np.repeat(np.array([i for i, _, _ in meshes], dtype=np.int64), counts),
        np.repeat(np.array([g.reverse for _, g, _ in meshes], dtype=np.bool_), counts),
    )


def on_surfaces(
    triangles: Triangles | None,
    analytic: AnalyticPrimitives,
    p: Floats,
    triangle: Index,
    primitive: Index,
) -> tuple[Floats, Floats]:
    """Points p (3, n), changed in place, on their surfaces, and the geometric normals (3, n) there.

    triangle, primitive: (n,) the triangle or the analytic primitive of each point, -1 for none.
    """
    n = np.zeros_like(p) if triangles is None else triangles.normal.take(np.maximum(triangle, 0), axis=1)
    rows = np.flatnonzero(primitive >= 0)
    if rows.size:
        p[:, rows], n[:, rows] = analytic.surface(primitive[rows], p.take(rows, axis=1))
    return p, n


def without_skew(shape: ShapeDescription) -> ShapeDescription:
    """The shape, where patches are replaced by triangles if they emit and are no rectangles, or if texture
    coordinates matter and are no affine function of the point: those follow a patch to 1e-3 of their range.
    """
    g = shape.geometry
    if isinstance(g, BilinearMesh) and shape.needs_uv and not g.are_parallelograms():
        if shape.emission is not None and shape.emission.image is not None:
            raise SceneError("a light with an image must be a rectangle; this one is not", shape.where)
        return replace(shape, geometry=_refined(g, shape))
    if shape.emission is None or (isinstance(g, BilinearMesh) and g.are_rectangles()):
        return shape
    if shape.emission.image is not None:
        raise SceneError("a light with an image must be a rectangle; this one is not", shape.where)
    return replace(shape, geometry=g.triangulated()) if isinstance(g, BilinearMesh) else shape


def _refined(mesh: BilinearMesh, shape: ShapeDescription) -> TriangleMesh:
    try:
        return refined(mesh.vertices, mesh.faces, mesh.uv, None, mesh.reverse, smooth=False)
    except ValueError as error:
        raise SceneError(str(error), shape.where) from None
