"""Closed surfaces that hide the medium behind them from direct light.

In pbrt a ray is in the medium on the side of the surface that it leaves. A camera outside a closed surface
sees its outside, and reflected rays stay outside. Transmitted rays enter the medium and meet the surface
again from inside, where direct light ends unless a light lies within. Opaque or clear, such a surface hides
its medium from the direct component. Surfaces are assumed not to intersect themselves.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array  # pyright: ignore[reportMissingTypeStubs]
from scipy.sparse.csgraph import (  # pyright: ignore[reportMissingTypeStubs]
    connected_components,  # pyright: ignore[reportUnknownVariableType]
)

from scenes.description.lights import Light
from scenes.description.scene import Camera
from scenes.description.shapes import Array, Geometry, Sphere, TriangleMesh

EMPTY = 1e-6  # of a winding number, which is whole away from the surface


@dataclass(frozen=True, eq=False)
class Enclosure:
    """A closed surface. low, high: (3,) of its box. outward: whether its normals point outwards. triangles:
    (t, 3, 3), None for a ball that fills its box.
    """

    low: Array
    high: Array
    outward: bool
    triangles: Array | None

    def holds(self, p: Array) -> bool:
        """Whether a point (3,) may lie inside the surface or on it."""
        if not ((p >= self.low) & (p <= self.high)).all():
            return False
        return True if self.triangles is None else abs(_winding(p, self.triangles)) > EMPTY

    def apart(self, low: Array, high: Array) -> bool:
        """Whether a box lies wholly outside the surface's box."""
        return bool(((high < self.low) | (low > self.high)).any())


@singledispatch
def enclosure(geometry: Geometry) -> Enclosure | None:
    """A geometry as a closed surface; None if it is open, or its faces turn both ways."""
    return None


@enclosure.register
def _(geometry: Sphere) -> Enclosure:
    return Enclosure(*_box(geometry), not geometry.reverse, None)


@enclosure.register
def _(geometry: TriangleMesh) -> Enclosure | None:
    corners = geometry.vertices[geometry.faces]
    side = _side(corners)
    if side is None:
        return None
    outward = (side > 0) != geometry.reverse
    if geometry.normals is not None:
        # pbrt turns the face's normal to the side of its vertex normals.
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        met = face.any(axis=1)  # no ray meets a face without area
        agree = np.einsum("tc,tkc->tk", face[met], geometry.normals[geometry.faces[met]]) * side
        outward = bool((agree > 0).all())
        if not outward and not (agree < 0).all():
            return None
    return Enclosure(*_box(geometry), outward, corners)


def hides(shell: Enclosure, camera: Camera, lights: Iterable[Light], emitters: Iterable[Geometry]) -> bool:
    """Whether the camera and all lights are outside a closed surface."""
    if camera.kind == "orthographic":
        return False  # its rays start all over the film
    eye = camera.camera_to_world[:3, 3]
    if camera.lens is not None:
        reach = camera.lens.radius * np.linalg.norm(camera.camera_to_world[:3, :2], axis=1)
        if not shell.apart(eye - reach, eye + reach):
            return False
    elif shell.holds(eye):
        return False
    places = (light.place for light in lights)
    if any(place is not None and shell.holds(place) for place in places):
        return False
    return all(shell.apart(*_box(one)) for one in emitters)


def _box(geometry: Geometry) -> tuple[Array, Array]:
    return geometry.corners.min(axis=0), geometry.corners.max(axis=0)


def _side(corners: Array) -> float | None:
    """1 if all triangles (t, 3, 3) are closed and turn their normals outwards, -1 if inwards. None if an edge
    lacks two faces that turn the same way, or parts differ.
    """
    points, number = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces: NDArray[np.int64] = number.reshape(-1, 3).astype(np.int64)
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    faces = faces[whole]
    if not len(faces):
        return None
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    forward, back = np.sort(start * len(points) + end), np.sort(end * len(points) + start)
    if (np.diff(forward) == 0).any() or not np.array_equal(forward, back):
        return None
    a, b, c = np.moveaxis(points[faces] - points.mean(axis=0), 1, 0)
    part = _parts(start, end, len(points))[faces[:, 0]]
    volume = np.bincount(part, np.einsum("tc,tc->t", a, np.cross(b, c)))[np.unique(part)]
    return 1.0 if (volume > 0).all() else -1.0 if (volume < 0).all() else None


def _parts(start: NDArray[np.int64], end: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """(count,) the connected part of each point. start, end: of the edges."""
    links = coo_array((np.ones(start.size), (start, end)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def _winding(p: Array, triangles: Array) -> float:
    """The number of times that triangles (t, 3, 3) go round a point (3,): their solid angles over 4 pi
    [vanoosterom1983].
    """
    a, b, c = np.moveaxis(triangles - p, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    triple = np.einsum("tc,tc->t", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return float(np.arctan2(triple, below).sum() / (2 * np.pi))
