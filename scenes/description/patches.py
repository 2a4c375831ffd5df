"""Bilinear patches: flat convex ones as they are; curved ones, and those with vertex normals, as triangles.

A patch of corners p00 p10 p01 p11 leaves the two triangles of one of n x n cells by |p11 - p10 - p01 + p00| /
(4 n^2) at most, at the middle of their common edge. n is chosen by that, for points, normals and texture
coordinates alike. Edges of patches are straight: neighbours of another n leave no gap.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.description.shapes import Array, Faces, TriangleMesh, cross_product, halves

PLANE_TOLERANCE = 1e-6  # of a patch's diameter: text of seven digits, or float32
OFF_MESH = 1e-4  # of a mesh's extent: how far triangles may leave a curved patch
OFF_PATCH = 1e-2  # of a patch's own diameter
OFF_NORMAL = 1e-3  # of a unit normal, and of texture coordinates that span a unit
MOST_CELLS = 64  # along an edge: 4e4 of these hold a warp as large as the patch to a 16,000th
TRIANGLE_LIMIT = 2**24  # a few GB


def curved(vertices: Array, faces: Faces) -> NDArray[np.bool_]:
    """(q,) bool: the patches that are not planar. vertices: (m, 3), faces: (q, 4) as p00 p10 p01 p11."""
    corners = vertices[faces]
    p00, p10, p01, p11 = _each(corners)
    diagonals = cross_product(p11 - p00, p01 - p10)  # twice the area, whatever the shape
    length = _lengths(diagonals)
    normal = diagonals / np.where(length > 0, length, 1.0)[:, None]
    rounding = 4 * np.finfo(np.float32).eps * np.abs(corners).max(axis=(1, 2))
    off = np.abs(np.einsum("qc,qc->q", p10 - p00, normal))  # how far the two diagonals pass each other by
    return np.asarray(off > PLANE_TOLERANCE * _diameter(corners) + rounding)


def patch_problem(vertices: Array, faces: Faces) -> str | None:
    """The reason why planar patches are no convex quadrilaterals with an area, or None. Arguments as of
    `curved`.
    """
    corners = vertices[faces]
    p00, p10, p01, p11 = _each(corners)
    diagonals = cross_product(p11 - p00, p01 - p10)
    length = _lengths(diagonals)
    if not np.all(length > 0):
        return (
            f"patch {int(np.argmin(length))} has no area, or its corners are not in the order p00 p10 p01 p11"
        )
    edges = np.stack([p10 - p00, p11 - p10, p01 - p11, p00 - p01])  # round the patch, each from its corner
    turns = cross_product(edges[[3, 0, 1, 2]].reshape(-1, 3), edges.reshape(-1, 3)).reshape(edges.shape)
    least = np.einsum("kqc,qc->kq", turns, diagonals / length[:, None]).min(axis=0, initial=np.inf)
    bad = least < -PLANE_TOLERANCE * _diameter(corners) ** 2
    if bad.any():
        return (
            f"patch {int(np.argmax(bad))} is not convex: its corners must be given in the order p00 "
            "p10 p01 p11"
        )
    return None


def refined(
    vertices: Array, faces: Faces, uv: Array | None, normals: Array | None, turned: bool, smooth: bool
) -> TriangleMesh:
    """Patches as triangles; ValueError for more than TRIANGLE_LIMIT.

    uv: (m, 2), None for a patch's own parameters. normals: (m, 3) on the outside, None for the patches' own.
    turned: whether the outside is that of -dp/du x dp/dv. smooth: whether to give the triangles normals.
    """
    corners = vertices[faces]
    own = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    corner_uv = np.broadcast_to(own, (len(faces), 4, 2)) if uv is None else uv[faces]
    outward = _own_normals(corners) * (-1.0 if turned else 1.0) if normals is None else normals[faces]
    cells = _cells(corners, corner_uv, outward if smooth else None, vertices)
    if 2 * int((cells.astype(np.int64) ** 2).sum()) > TRIANGLE_LIMIT:
        raise ValueError(f"the patches are so curved that they need more than {TRIANGLE_LIMIT} triangles")
    points: list[Array] = []
    triangles: list[Faces] = []
    coordinates: list[Array] = []
    directions: list[Array] = []
    count = 0
    for n in np.unique(cells):  # powers of two: seven at most
        some = cells == n
        weights, squares = _grid(int(n))
        points.append(np.einsum("wk,qkc->qwc", weights, corners[some]).reshape(-1, 3))
        coordinates.append(np.einsum("wk,qkc->qwc", weights, corner_uv[some]).reshape(-1, 2))
        directions.append(np.einsum("wk,qkc->qwc", weights, outward[some]).reshape(-1, 3))
        first = count + len(weights) * np.arange(int(some.sum()))
        triangles.append((first[:, None, None] + squares).reshape(-1, 4))
        count += len(points[-1])
    return TriangleMesh(
        np.concatenate(points),
        halves(np.concatenate(triangles)),
        turned,
        np.concatenate(coordinates),
        np.concatenate(directions) if smooth else None,
    )


def _each(corners: Array) -> tuple[Array, Array, Array, Array]:
    return corners[:, 0], corners[:, 1], corners[:, 2], corners[:, 3]


def _lengths(v: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("qc,qc->q", v, v)))


def _diameter(corners: Array) -> Array:
    p00, p10, p01, p11 = _each(corners)
    return np.maximum(_lengths(p11 - p00), _lengths(p01 - p10))


def _own_normals(corners: Array) -> Array:
    """(q, 4, 3) dp/du x dp/dv at the corners, which is bilinear in between too."""
    p00, p10, p01, p11 = _each(corners)
    along = np.stack([p10 - p00, p10 - p00, p11 - p01, p11 - p01], axis=1)
    across = np.stack([p01 - p00, p11 - p10, p01 - p00, p11 - p10], axis=1)
    return np.asarray(np.cross(along, across), dtype=np.float64)


def _cells(corners: Array, uv: Array, normals: Array | None, vertices: Array) -> Faces:
    """(q,) cells along an edge of each patch, powers of two."""
    extent = float(np.ptp(vertices, axis=0).max())
    near = np.minimum(OFF_MESH * extent, OFF_PATCH * _diameter(corners))
    need = _warp(corners) / np.maximum(near, np.finfo(np.float64).tiny)
    need = np.maximum(need, _warp(uv) / (OFF_NORMAL * max(float(np.ptp(uv, axis=(0, 1)).max()), 1e-300)))
    if normals is not None:
        length = np.linalg.norm(normals, axis=2, keepdims=True)
        need = np.maximum(need, _warp(normals / np.where(length > 0, length, 1.0)) / OFF_NORMAL)
    power = np.ceil(np.log2(np.maximum(need / 4, 1.0)) / 2).astype(np.int64)
    return np.minimum(1 << power, MOST_CELLS)


def _warp(corners: Array) -> Array:
    return np.linalg.norm(corners[:, 3] - corners[:, 1] - corners[:, 2] + corners[:, 0], axis=1)


def _grid(n: int) -> tuple[Array, Faces]:
    """Bilinear weights ((n + 1)^2, 4) of the points of a grid, row by row, and its cells (n^2, 4)."""
    v, u = (x.ravel() / n for x in np.mgrid[: n + 1, : n + 1])
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=1)
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    return weights, np.stack([i, i + 1, i + n + 1, i + n + 2], axis=1)
