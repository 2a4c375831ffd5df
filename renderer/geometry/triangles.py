"""Triangles by Embree's BVH; the only import of embreex.

Embree works in float32, so the triangles are first moved to the origin and scaled to [-1, 1]. Hits are
recomputed in float64 from the triangle that Embree names. Shadow rays start off the surface by a bound on the
error of float32. Rounding grows with the coordinates and with the size of the triangle, and so does the
bound.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportUnknownParameterType=false
from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from renderer.math.vectors import Floats, cross, dot, gather, normalize
from scenes.arrays import Index, Mask

ULP = 2.0**-24  # half a unit in the last place of a float32 in [1, 2), relative
# A corner moves by one ULP of its coordinates, the plane's distance is the sum of three products of such
# differences,
# and the origin itself is rounded: twelve roundings in all, of up to sqrt(3) each for the diagonal.
ROUNDINGS = 24.0
SLENDER = 100.0  # length over height of the slimmest triangle that the bound is good for
BLOCK = 2**14  # triangles that are worked out at a time
FAR = 4.0  # in Embree's units, where the scene spans [-1, 1]: rays from farther away are started nearer


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles in float64, and their float32 copies in Embree.

    v0, normal: (3, t), world space. shape: (t,). bound: (t,) the size that float32 rounding grows with;
    largest: the largest bound, slivers apart. center: (3, 1) and scale: the map from world space to Embree's.
    mesh: vertices and faces in Embree's units. member: the triangles that Embree was given.
    """

    v0: Floats
    normal: Floats
    shape: Index
    bound: Floats
    largest: float
    center: Floats
    scale: float
    mesh: tuple[NDArray[np.float32], NDArray[np.int32]]  # all of them, in Embree's units
    member: Index  # those that Embree was given
    bvh: EmbreeScene

    def only(self, keep: Mask) -> Triangles:
        """The same triangles, where rays meet only those of the mask (t,)."""
        vertices, faces = self.mesh
        return replace(
            self, member=np.flatnonzero(keep), bvh=_bvh(vertices, np.ascontiguousarray(faces[keep]))
        )

    def closest(self, o: Floats, d: Floats) -> tuple[Floats, Index]:
        """First triangle on each ray: its distance (n,) in float64, inf for none, and its number (n,), -1 for
        none.

        o: (3, n), or (3, 1) for all rays. d: (3, n), unit.
        """
        start = (o - self.center) * self.scale
        if (
            dot(start, start).max(initial=0.0) > FAR * FAR
        ):  # float32 has no digits left out there: go to where the scene is near
            ahead = np.maximum(-dot(start, d) - FAR, 0.0)
            start = start + d * ahead
        else:
            start = np.broadcast_to(start, d.shape)
        return self._first(o, start, d)

    def closest_from(self, p: Floats, n: Floats, triangle: Index, wi: Floats) -> tuple[Floats, Index]:
        """First triangle on each ray wi (3, n) that leaves a surface, as `closest` gives it.

        p, n: (3, n) points and normals. triangle: (n,) the triangle that a point lies on, -1 for none.
        """
        return self._first(p, self._offset(p, n, self._own(triangle)), wi)

    def _first(self, o: Floats, start: Floats, d: Floats) -> tuple[Floats, Index]:
        """The hits of rays that start at `start` (3, n) in Embree's units, their distances from o (3, n) or
        (3, 1).
        """
        hit: NDArray[np.int32] = self.bvh.run(start.astype(np.float32).T, d.astype(np.float32).T)
        row = self.member.take(np.maximum(hit, 0))
        index = np.where(hit >= 0, row, -1)
        normal = self.normal.take(row, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = dot(self.v0.take(row, axis=1) - o, normal) / dot(d, normal)
        found = (index >= 0) & (t > 0)
        return np.where(found, t, np.inf), np.where(found, index, -1)

    def _own(self, triangle: Index) -> Floats:
        """(n,) the bounds of the triangles (n,) that points lie on, 0 for none."""
        return np.where(triangle >= 0, gather(self.bound, np.maximum(triangle, 0)), 0.0)

    def occluded(self, p: Floats, n: Floats, triangle: Index, y: Floats, ny: Floats) -> Mask:
        """(n,): whether a triangle lies between points p and points y on lights.

        n: (3, n) the normals at p. ny: (3, n) or (3, 1) the lights' normals at y, on the side of p. triangle:
        (n,) the triangle that p lies on, -1 for none. Both ends are lifted off their surfaces, so that
        neither p's own triangle nor one behind the light blocks. A triangle nearer than that to either end is
        not seen.
        """
        start = self._offset(p, n, self._own(triangle))
        way = self._offset(y, ny, self.largest) - start
        reach = np.ones(p.shape[1], dtype=np.float32)
        out: NDArray[np.int32] = self.bvh.run(
            start.astype(np.float32).T, way.astype(np.float32).T, dists=reach, query="OCCLUDED"
        )
        return out == 0

    @property
    def ray_offset(self) -> float:
        """The largest distance, in world units, that a ray starts off its surface; slivers do not count."""
        return self.largest * ROUNDINGS * ULP

    def _offset(self, p: Floats, n: Floats, bound: Floats | float) -> Floats:
        """Points p (3, n) lifted off their surfaces, in Embree's units. pbrt and [waechter2019] lift by units
        of ulp.
        """
        q = np.abs(p - self.center)
        size = np.maximum(np.maximum(q[0], q[1]), q[2]) + bound
        return (p + n * (size * (ROUNDINGS * ULP)) - self.center) * self.scale


def make_triangles(vertices: Floats, faces: Index, shape: Index, reverse: Mask) -> Triangles:
    """Triangles in float64 with their BVH. vertices: (m, 3). faces: (t, 3). shape, reverse: (t,).

    A triangle without area keeps a zero normal and is never hit.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    center = (low + high) / 2
    half = float(np.max(high - low)) / 2
    scale = 1.0 / half if half > 0 else 1.0
    count = len(faces)
    first, normal, bound = np.zeros((3, count)), np.zeros((3, count)), np.zeros(count)
    largest = 0.0
    for start in range(0, count, BLOCK):  # what lies in between stays in the cache, and small
        rows = slice(start, start + BLOCK)
        corners = vertices[faces[rows]]  # (b, 3, 3)
        edges = corners[:, [1, 2, 0]] - corners
        unit = normalize(cross(*((corners[:, i] - corners[:, 0]).T for i in (1, 2))))
        normal[:, rows] = np.where(np.isfinite(unit), unit, 0.0) * np.where(reverse[rows], -1.0, 1.0)
        first[:, rows] = corners[:, 0].T
        bound[rows] = _bounds(corners, edges, center)
        largest = max(largest, float(np.ptp(corners, axis=1).max()))
    largest += float(np.abs(vertices - center).max())
    mesh = (((vertices - center) * scale).astype(np.float32), faces.astype(np.int32))
    return Triangles(
        first, normal, shape, bound, largest, center[:, None], scale, mesh, np.arange(count), _bvh(*mesh)
    )


def _bounds(corners: Floats, edges: Floats, center: Floats) -> Floats:
    """(t,) the size that rounding grows with: a triangle's distance from the centre, and its length times its
    slenderness.

    Embree's normal is off by an angle of ULP times length over height, and its plane by that angle times the
    length. Beyond a slenderness of SLENDER a triangle may shade itself: lifting rays further would leak
    light.
    """
    square = (edges * edges).sum(axis=2).max(axis=1)
    double = np.linalg.norm(cross(edges[:, 0].T, edges[:, 1].T).T, axis=1)
    slender = np.minimum(
        np.divide(square, double, out=np.full_like(double, SLENDER), where=double > 0), SLENDER
    )
    return np.sqrt(square) * slender + np.abs(corners - center).max(axis=(1, 2))


def _bvh(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> EmbreeScene:
    bvh = EmbreeScene()
    TriangleMesh(bvh, vertices, faces)
    return bvh
