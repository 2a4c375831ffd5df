"""Emitting faces that share a place: a face given twice, two back to back, or a mesh with both windings.

A ray meets one of them, light sampling all of them. Every program that traces rays has to account for that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.description.shapes import Array, ShapeDescription

QUANTUM = 2.0**-33  # of the largest coordinate: far above rounding, far below any gap meant
PRIMES = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)


@dataclass(frozen=True, eq=False)
class Coinciding:
    """The f faces of emitting shapes, in their order. shape: (f,) the shape of each face. group: (f,) the
    first face in the same place. same_side: (f,) whether all faces of that place shine the same way.
    """

    shape: NDArray[np.int64]
    group: NDArray[np.int64]
    same_side: NDArray[np.bool_]

    @property
    def shapes(self) -> NDArray[np.int64]:
        """The shapes with a face that shares its place with another."""
        shared = np.bincount(self.group, minlength=self.group.size)[self.group] > 1
        return np.unique(self.shape[shared])


def coinciding(shapes: Sequence[ShapeDescription]) -> Coinciding | None:
    """The faces of emitting shapes without an alpha, if any two share a place; else None."""
    emitting = [i for i, s in enumerate(shapes) if s.emission is not None]
    if not emitting:
        return None
    parts = [shapes[i].geometry.identity() for i in emitting]
    count = np.array([len(points) for points, _ in parts], dtype=np.int64)
    if count.sum() < 2:
        return None
    unit = QUANTUM * max(max(float(np.abs(points).max(initial=0.0)) for points, _ in parts), 1e-300)
    keys = np.concatenate([_keys(points / unit) for points, _ in parts])
    shape = np.repeat(np.array(emitting, dtype=np.int64), count)
    holes = np.array([shapes[i].alpha is not None for i in emitting], dtype=np.bool_).repeat(count)
    keys[holes] = np.arange(keys.size, dtype=np.uint64)[holes]  # met by some rays only
    _, first, group = np.unique(keys, return_index=True, return_inverse=True)
    if first.size == keys.size:
        return None
    side = np.concatenate([_side(normals) for _, normals in parts])
    return Coinciding(shape, first[group], side == side[first[group]])


def _keys(points: Array) -> NDArray[np.uint64]:
    """(f,) a hash of each face's points (f, m, 3) that ignores their order."""
    whole = np.rint(points).astype(np.int64).view(np.uint64)
    mixed = (whole * PRIMES).sum(axis=2, dtype=np.uint64)
    for shift in (29, 32):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * PRIMES[1]
    return mixed.sum(axis=1, dtype=np.uint64)


def _side(normals: Array) -> NDArray[np.bool_]:
    """(f,) which of two opposite vectors (f, 3) each one is, by the sign of its first component above
    rounding.
    """
    size = np.abs(normals)
    first = (size > 1e-6 * size.max(axis=1, keepdims=True)).argmax(axis=1)
    return np.take_along_axis(normals, first[:, None], axis=1)[:, 0] > 0


def ambiguous(shapes: Sequence[ShapeDescription]) -> str | None:
    """The reason why a program that takes the first surface on a ray gets emitting shapes wrong; None if it
    does not.
    """
    found = coinciding(shapes)
    if found is None:
        return None
    where = shapes[int(found.shapes[0])].where
    at = f" ({where})" if where else ""
    return f"a light{at} is where another light is, or one of its own faces: a ray meets any one of them"
