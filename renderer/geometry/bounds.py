"""How far a shape reaches in a direction, and the plane it lies in, if any: what the plan's proofs are made
of.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.math.vectors import Floats
from scenes.description.shapes import Disk, ShapeDescription, Sphere

# Vertices given as decimal text lie in a common plane to some 1e-16 of their coordinates.
FLAT = 1e-12
# In units of the largest coordinate of a scene: far above the 1e-16 by which a vertex is rounded, far below
# any gap meant.
TOLERANCE = 1e-11


@dataclass(frozen=True, eq=False)
class ShapeBounds:
    """points: (m, 3), whose hull with the balls or disk of `radius` about them holds the shape. normal: (3,)
    if planar. one_way: whether all faces turn the same way.
    """

    points: Floats
    radius: float = 0.0
    disk: Floats | None = None
    normal: Floats | None = None
    one_way: bool = True

    def extent(self, directions: Floats) -> tuple[Floats, Floats]:
        """Least and greatest of n . x over the shape, for unit directions (q, 3).

        Two (q,) arrays, exact but for rounding.
        """
        along = np.einsum("qc,mc->qm", directions, self.points)
        pad = np.full(len(directions), self.radius)
        if self.disk is not None:
            cosine = np.einsum("qc,c->q", directions, self.disk)
            pad *= np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
        return along.min(axis=1) - pad, along.max(axis=1) + pad


def shape_bounds(shape: ShapeDescription) -> ShapeBounds:
    """Bounds of any shape; meshes count by the vertices that their faces use."""
    g = shape.geometry
    if isinstance(g, Sphere):
        return ShapeBounds(g.center[None], g.radius)
    if isinstance(g, Disk):
        return ShapeBounds(g.center[None], g.radius, disk=g.normal, normal=g.normal)
    used = g.vertices[np.unique(g.faces)]
    corners = g.vertices[g.faces[:, :3]]
    normal = _plane(corners, used, -1.0 if g.reverse else 1.0)
    return ShapeBounds(used, normal=normal, one_way=normal is None or _one_way(corners, normal))


def _one_way(corners: Floats, normal: Floats) -> bool:
    """Whether all faces of a planar mesh are on the same side of its plane, or of none. corners: (t, 3, 3).
    normal: (3,).
    """
    along = np.einsum(
        "tc,c->t", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), normal
    )
    return bool((along >= 0).all() or (along <= 0).all())


def _plane(corners: Floats, points: Floats, turn: float) -> Floats | None:
    """The unit normal of points that share a plane, on the side of the largest face's normal, or None.
    corners: (t, 3, 3).
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normals, axis=1)
    largest = int(area.argmax())
    if area[largest] == 0:
        return None
    n = normals[largest] / area[largest]
    along = np.einsum("mc,c->m", points - points[0], n)
    size = np.abs(points).max()
    return n * turn if np.abs(along).max() <= FLAT * size else None
