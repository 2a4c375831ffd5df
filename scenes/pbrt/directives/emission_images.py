"""Rectangles that an image is laid on, however a file gives them: as patches, or as pairs of triangles, with
coordinates of their own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.shapes import BilinearMesh, Geometry, TriangleMesh

Array = NDArray[np.float64]

RIGHT_ANGLE = (
    1e-5  # cosine up to which a patch counts as a rectangle, and relative error of its fourth corner
)
SAME_POINT = 1e-6  # of a rectangle's diagonal: where two triangles share a corner
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])  # of the image, in a patch's order


def pictured(geometry: Geometry) -> BilinearMesh | None:
    """The same surface as rectangles whose own parameters are the image's coordinates; None where it is none.

    Each must show the whole image once: its corners have the coordinates 0 and 1, in whatever order. Of a
    triangle mesh, faces 0 and 1 are a rectangle, 2 and 3 the next. The side that emits stays.
    """
    if isinstance(geometry, BilinearMesh):
        uv = (
            np.tile(CORNERS, (len(geometry.faces), 1, 1))
            if geometry.uv is None
            else geometry.uv[geometry.faces]
        )
        points = geometry.vertices[geometry.faces]
        normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    elif isinstance(geometry, TriangleMesh) and geometry.uv is not None and len(geometry.faces) % 2 == 0:
        pairs = geometry.faces.reshape(-1, 6)
        uv, points = geometry.uv[pairs], geometry.vertices[pairs]
        normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        other = np.cross(points[:, 4] - points[:, 3], points[:, 5] - points[:, 3])
        if not (_halves(uv) and np.all(np.sum(normal * other, axis=1) > 0)):
            return None
    else:
        return None
    corners = _corners(points, uv)
    if corners is None or not _rectangles(corners):
        return None
    if isinstance(geometry, BilinearMesh) and np.array_equal(corners, points):
        return geometry if geometry.uv is None else replace(geometry, uv=None)
    turned = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    against = np.sum(turned * normal, axis=1) < 0
    if np.any(against != against[0]):
        return None
    faces = np.arange(4 * len(corners), dtype=np.int64).reshape(-1, 4)
    return BilinearMesh(corners.reshape(-1, 3), faces, geometry.reverse != bool(against[0]))


def _halves(uv: Array) -> bool:
    """Whether the two triangles of each pair, uv (q, 6, 2), are the halves of the image to both sides of a
    diagonal.
    """
    here = _at_corners(uv)
    first, second = here[:, :3].any(axis=1), here[:, 3:].any(axis=1)  # (q, 4): which corners each has
    three = (first.sum(axis=1) == 3) & (second.sum(axis=1) == 3)
    # Each lacks one corner; those two lie across from each other, which in a patch's order are 0 and 3, 1 and
    # 2.
    return bool(np.all(three) and np.all(np.argmin(first, axis=1) + np.argmin(second, axis=1) == 3))


def _at_corners(uv: Array) -> NDArray[np.bool_]:
    """(q, k, 4): at which of the image's corners each of the coordinates (q, k, 2) is."""
    return np.all(uv[:, :, None, :] == CORNERS, axis=-1)


def _corners(points: Array, uv: Array) -> Array | None:
    """The points (q, 4, 3) at the image's corners, of points (q, k, 3) at uv (q, k, 2); None where one has
    none or several.
    """
    here = _at_corners(uv)
    if not (np.all(here.any(axis=2)) and np.all(here.any(axis=1))):
        return None
    found = np.take_along_axis(points, np.argmax(here, axis=1)[:, :, None], axis=1)
    again = np.take_along_axis(
        found, np.argmax(here, axis=2)[:, :, None], axis=1
    )  # where each point should be
    size = np.linalg.norm(found[:, 3] - found[:, 0], axis=1)
    return found if np.all(np.linalg.norm(again - points, axis=2) <= SAME_POINT * size[:, None]) else None


def _rectangles(corners: Array) -> bool:
    p00, p10, p01, p11 = np.moveaxis(corners, 1, 0)
    u, v = p10 - p00, p01 - p00
    lengths = np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)
    square = np.abs(np.sum(u * v, axis=1)) <= RIGHT_ANGLE * lengths[0] * lengths[1]
    closed = np.linalg.norm(p00 + u + v - p11, axis=1) <= RIGHT_ANGLE * (lengths[0] + lengths[1])
    return bool(np.all(square & closed) and np.all(lengths[0] * lengths[1] > 0))
