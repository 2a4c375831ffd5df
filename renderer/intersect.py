"""Triangles by Embree's BVH; the only import of embreex.

Embree works in float32, so the triangles are moved to the origin and scaled to [-1, 1] first, hits are worked out anew
in float64 from the triangle that Embree names, and shadow rays start off the surface by a bound on what float32 may
have lost: rounding grows with the coordinates and with the size of the triangle, and so does the bound.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportUnknownParameterType=false
from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from renderer.arrays import Floats, dot, gather, normalize

ULP = 2.0**-24  # half a unit in the last place of a float32 in [1, 2), relative
# A corner moves by one ULP of its coordinates, the plane's distance is the sum of three products of such differences,
# and the origin itself is rounded: twelve roundings in all, of up to sqrt(3) each for the diagonal.
ROUNDINGS = 24.0
FAR = 4.0  # in Embree's units, where the scene spans [-1, 1]: rays from farther away are started nearer


@dataclass(frozen=True, eq=False)
class Triangles:
    """v0, normal: (3, t) float64, world space; shape: (t,); bound: (t,) size that float32 rounding scales with.

    center: (3, 1) and scale map world space to Embree's.
    """

    v0: Floats
    normal: Floats
    shape: NDArray[np.int64]
    bound: Floats
    center: Floats
    scale: float
    mesh: tuple[NDArray[np.float32], NDArray[np.int32]]  # what Embree was given
    bvh: EmbreeScene

    def only(self, keep: NDArray[np.bool_]) -> Triangles:
        """The same triangles with a BVH of those to keep (t,): for shadow rays, which ask for no index."""
        vertices, faces = self.mesh
        return replace(self, bvh=_bvh(vertices, np.ascontiguousarray(faces[keep])))

    def closest(self, o: Floats, d: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """First triangle on each ray: distance (n,) in float64, inf for none, and its index (n,), -1 for none.

        o: (3, 1), one camera for all rays. d: (3, n), unit.
        """
        start = (o - self.center) * self.scale
        if dot(start, start)[0] > FAR * FAR:  # float32 has no digits left out there: go to where the scene is near
            ahead = np.maximum(-dot(start, d) - FAR, 0.0)
            start = start + d * ahead
        else:
            start = np.broadcast_to(start, d.shape)
        hit: NDArray[np.int32] = self.bvh.run(start.astype(np.float32).T, d.astype(np.float32).T)
        index = hit.astype(np.int64)
        row = np.maximum(index, 0)
        normal = self.normal.take(row, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = dot(self.v0.take(row, axis=1) - o, normal) / dot(d, normal)
        found = (index >= 0) & (t > 0)
        return np.where(found, t, np.inf), np.where(found, index, -1)

    def occluded(
        self, p: Floats, n: Floats, triangle: NDArray[np.int64], wi: Floats, dist: Floats
    ) -> NDArray[np.bool_]:
        """(n,): whether a triangle lies between p and p + dist wi. triangle: (n,) the one that p lies on, -1 for none."""
        offset = self.offset(p, triangle)
        start = (p + n * offset - self.center) * self.scale
        # Shortened by what rounding may add, so that what the light itself touches does not hide it.
        reach = dist * (self.scale * (1.0 - 8 * ULP))
        out: NDArray[np.int32] = self.bvh.run(
            start.astype(np.float32).T, wi.astype(np.float32).T, dists=reach.astype(np.float32), query="OCCLUDED"
        )
        return out == 0

    def offset(self, p: Floats, triangle: NDArray[np.int64]) -> Floats:
        """(n,) how far along its normal a shadow ray starts, world units [waechter2019 does the same in units of ulp]."""
        q = np.abs(p - self.center)
        size = np.maximum(np.maximum(q[0], q[1]), q[2])
        size += np.where(triangle >= 0, gather(self.bound, np.maximum(triangle, 0)), 0.0)
        return size * (ROUNDINGS * ULP)


def make_triangles(
    vertices: Floats, faces: NDArray[np.int64], shape: NDArray[np.int64], reverse: NDArray[np.bool_]
) -> Triangles:
    """vertices: (m, 3). faces: (t, 3). shape, reverse: (t,). A triangle without area keeps a zero normal and is never hit."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    center = (low + high) / 2
    half = float(np.max(high - low)) / 2
    scale = 1.0 / half if half > 0 else 1.0
    corners = vertices[faces]  # (t, 3, 3)
    normal = normalize(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).T)
    normal = np.where(np.isfinite(normal), normal, 0.0) * np.where(reverse, -1.0, 1.0)
    bound = (corners.max(axis=1) - corners.min(axis=1)).max(axis=1) + np.abs(corners - center).max(axis=(1, 2))
    mesh = (((vertices - center) * scale).astype(np.float32), faces.astype(np.int32))
    first = np.ascontiguousarray(corners[:, 0].T)
    return Triangles(first, normal, shape, bound, center[:, None], scale, mesh, _bvh(*mesh))


def _bvh(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> EmbreeScene:
    bvh = EmbreeScene()
    TriangleMesh(bvh, vertices, faces)
    return bvh
