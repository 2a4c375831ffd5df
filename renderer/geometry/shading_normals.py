"""Shading normals of points on triangles with vertex normals, as pbrt-v4 interpolates them.

The interpolated normal is an affine function of the point on its face, made unit [pharr2023, sec. 6.5.2].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.geometry.primitives import is_analytic
from renderer.geometry.uv import affine
from renderer.math.vectors import Floats, dot
from scenes.arrays import Index, Mask
from scenes.description.shapes import Mesh, ShapeDescription, TriangleMesh, vertex_normals


@dataclass(frozen=True, eq=False)
class ShadingNormals:
    """Shading normals of the t triangles and the k analytic primitives of a scene, in their order.

    origin: (3, m) and along: (3, 3, m); on face j the normal at p is origin + along . p, made unit.
    of_triangle: (t,) and of_primitive: (k,) the face of each, -1 for those shaded by their geometric normal.
    """

    origin: Floats
    along: Floats
    of_triangle: Index
    of_primitive: Index

    def at(self, p: Floats, n: Floats, triangle: Index, primitive: Index) -> tuple[Floats, Mask]:
        """Unit shading normals (3, n) at points p (3, n), and whether they come from vertex normals (n,).

        n: (3, n) the geometric normals, which stand in where the interpolated normal is zero or not finite.
        """
        face = self._face(triangle, primitive)
        out, own = n.copy(), np.zeros(face.size, dtype=np.bool_)
        rows = np.flatnonzero(face >= 0)
        mine, face = p.take(rows, axis=1), face[rows]
        value = self.origin.take(face, axis=1)
        value += np.stack([dot(axis.take(face, axis=1), mine) for axis in self.along])
        square = dot(value, value)
        own[rows] = some = (square > 0) & (square < np.inf)
        out[:, rows[some]] = value[:, some] / np.sqrt(square[some])
        return out, own

    def differentials(
        self, dpdu: Floats, dpdv: Floats, triangle: Index, primitive: Index
    ) -> tuple[Mask, Floats, Floats]:
        """Whether points have vertex normals (n,), and dn/du and dn/dv (3, n) there. As in pbrt these are
        derivatives of the normal before it is made unit.
        """
        face = self._face(triangle, primitive)
        rows = np.flatnonzero(face >= 0)
        dndu, dndv = np.zeros_like(dpdu), np.zeros_like(dpdu)
        for change, step in ((dndu, dpdu), (dndv, dpdv)):
            mine = step.take(rows, axis=1)
            change[:, rows] = np.stack([dot(axis.take(face[rows], axis=1), mine) for axis in self.along])
        return face >= 0, dndu, dndv

    def _face(self, triangle: Index, primitive: Index) -> Index:
        face = np.full(triangle.size, -1, dtype=np.int64)
        for table, row in ((self.of_triangle, triangle), (self.of_primitive, primitive)):
            if table.size:
                face = np.where(row >= 0, table[row], face)
        return face


def shading_normals(shapes: Sequence[ShapeDescription]) -> ShadingNormals | None:
    """The shading normals of a scene in which some shape has vertex normals, else None."""
    if all(vertex_normals(s.geometry) is None for s in shapes):
        return None
    corners: list[Floats] = []
    values: list[Floats] = []
    tables: tuple[list[Index], list[Index]] = ([], [])
    first = 0
    for s in shapes:
        g, normals, analytic = s.geometry, vertex_normals(s.geometry), is_analytic(s)
        count = 1 if not isinstance(g, Mesh) else len(g.faces if analytic else g.triangulated().faces)
        own = np.full(count, -1, dtype=np.int64)
        if isinstance(g, TriangleMesh) and normals is not None:
            corners.append(g.vertices[g.faces])
            values.append(normals[g.faces])
            own = np.arange(first, first + count)
            first += count
        tables[analytic].append(own)
    origin, along = affine(np.concatenate(corners), np.concatenate(values))
    none = np.zeros(0, dtype=np.int64)
    return ShadingNormals(origin, along, *(np.concatenate([none, *table]) for table in tables))
