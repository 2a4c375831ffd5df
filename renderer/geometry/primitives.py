"""Which shapes are met by formula and which through Embree, and the arrays of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from renderer.geometry.analytic import AnalyticPrimitives, disk, join, rectangle, sphere, triangle
from renderer.geometry.triangles import Triangles, make_triangles
from renderer.lights.rectangle import are_rectangles
from renderer.math.vectors import Floats
from scenes.description.shapes import BilinearMesh, Disk, ShapeDescription, Sphere, TriangleMesh
from scenes.errors import SceneError

# Emitting meshes of up to so many faces are met by formula, in float64: each face costs every ray some 20 ns
# there.
FEW = 64


def by_formula(shape: ShapeDescription) -> bool:
    """Whether rays meet a shape by formula: spheres, disks, and what emits from rectangles or few
    triangles.
    """
    if isinstance(shape.geometry, TriangleMesh):
        return shape.emission is not None and len(shape.geometry.faces) <= FEW
    return shape.emission is not None or not isinstance(shape.geometry, BilinearMesh)


def analytic_primitives(shapes: Sequence[ShapeDescription]) -> AnalyticPrimitives:
    """The primitives of all shapes that are met by formula, in the order of shapes and their faces."""
    return join([one for i, s in enumerate(shapes) if by_formula(s) for one in _own(i, s)])


def _own(i: int, s: ShapeDescription) -> list[AnalyticPrimitives]:
    """The primitives of shape i."""
    g = s.geometry
    if isinstance(g, Sphere):
        return [sphere(i, g.center, g.radius, g.reverse)]
    if isinstance(g, Disk):
        return [disk(i, g.center, g.normal, g.radius)]
    one = rectangle if isinstance(g, BilinearMesh) else triangle
    return [one(i, corners, g.reverse) for corners in g.vertices[g.faces]]


def all_triangles(shapes: Sequence[ShapeDescription]) -> Triangles | None:
    """All other triangles and patches as one mesh, in the order of shapes and their faces; None without
    any.
    """
    vertices: list[Floats] = []
    faces: list[NDArray[np.int64]] = []
    shape: list[NDArray[np.int64]] = []
    reverse: list[NDArray[np.bool_]] = []
    offset = 0
    for i, s in enumerate(shapes):
        g = s.geometry
        if by_formula(s) or isinstance(g, Sphere | Disk):
            continue
        own = split(g.faces) if isinstance(g, BilinearMesh) else g.faces
        vertices.append(g.vertices)
        faces.append(own + offset)
        shape.append(np.full(len(own), i, dtype=np.int64))
        reverse.append(np.full(len(own), g.reverse))
        offset += len(g.vertices)
    if not vertices:
        return None
    return make_triangles(
        np.concatenate(vertices), np.concatenate(faces), np.concatenate(shape), np.concatenate(reverse)
    )


def without_skew(shape: ShapeDescription) -> ShapeDescription:
    """The shape; one that emits from patches which are no rectangles, as the triangles that these are made
    of.
    """
    g = shape.geometry
    if shape.emission is None or (isinstance(g, BilinearMesh) and are_rectangles(g)):
        return shape
    if shape.emission.image is not None:
        raise SceneError("a light with an image must be a rectangle; this one is not", shape.where)
    if not isinstance(g, BilinearMesh):
        return shape
    return replace(shape, geometry=TriangleMesh(g.vertices, split(g.faces), g.reverse))


def split(patches: NDArray[np.int64]) -> NDArray[np.int64]:
    """Patches (q, 4), corners p00 p10 p01 p11, as triangles (2 q, 3): first the half at p10 of each, then the
    half at p01.
    """
    return np.concatenate([patches[:, [0, 1, 3]], patches[:, [0, 3, 2]]])
