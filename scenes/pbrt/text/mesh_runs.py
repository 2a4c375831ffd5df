"""Runs of plain triangle meshes, read as one: each directive alone costs a tenth of a millisecond.

Exporters write a `Shape "trianglemesh"` for every leaf and brick. Neighbours under one state differ in their
numbers alone, so that one pattern finds them and NumPy reads all their numbers at once. A run ends at
anything that the pattern does not know, and at numbers that are no mesh. The directive there is read on its
own, with errors at their place.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.pbrt.text.lexer import Source

FEW = 32  # meshes: fewer stay shapes of their own, which plans and reports can name
LONG = 10_000  # characters of a mesh: from there on its own directive is as quick

_SPACE = r"[ \t\r\n]*+"
_P = rf'"point3?+[ \t]++P"{_SPACE}\[(?P<p{{0}}>[-+0-9.eE \t\r\n]*+)\]'
_INDICES = rf'"integer[ \t]++indices"{_SPACE}\[(?P<i{{0}}>[0-9 \t\r\n]*+)\]'
# Another parameter, behind the two or behind a comment, belongs to the same shape: then it is no plain mesh.
_MESH = re.compile(
    rf'{_SPACE}"trianglemesh"{_SPACE}'
    rf"(?:{_P.format(1)}{_SPACE}{_INDICES.format(1)}|{_INDICES.format(2)}{_SPACE}{_P.format(2)})"
    rf"(?={_SPACE}[A-Z])"
)
_NEXT = re.compile(rf"{_SPACE}Shape(?=[ \t\r\n\"])")


@dataclass(frozen=True, eq=False)
class MeshRun:
    """vertices: (m, 3) float64 as written. faces: (t, 3) int64 of them."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


def read_meshes(source: Source, start: int) -> tuple[MeshRun | None, int]:
    """The plain meshes from offset `start`, right after a `Shape`, and the offset after them. None if they
    are few or one is malformed: no run begins before that offset.
    """
    points: list[str] = []
    indices: list[str] = []
    offset = end = start
    while (match := _MESH.match(source.text, offset, offset + LONG)) is not None:
        points.append(match["p1"] or match["p2"] or "")
        indices.append(match["i1"] or match["i2"] or "")
        end = match.end()
        following = _NEXT.match(source.text, end)
        if following is None:
            break
        offset = following.end()
    return (None if len(points) < FEW else _joined(points, indices)), end


def _joined(points: Sequence[str], indices: Sequence[str]) -> MeshRun | None:
    vertices, corners = _numbers(points), _numbers(indices)
    if vertices is None or corners is None:
        return None
    of_points = np.array([len(text.split()) for text in points])
    of_indices = np.array([len(text.split()) for text in indices])
    counts = of_points // 3
    if np.any(of_points % 3) or np.any(of_indices % 3) or not np.all(of_indices):
        return None
    if np.any(corners >= np.repeat(counts, of_indices)):
        return None
    first = np.cumsum(counts) - counts
    faces = corners.astype(np.int64) + np.repeat(first, of_indices)
    return MeshRun(vertices.reshape(-1, 3) + 0.0, faces.reshape(-1, 3))


def _numbers(texts: Sequence[str]) -> NDArray[np.float64] | None:
    """All numbers of the texts; None if a word is no finite number."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # of words that are no numbers
        try:
            values = np.fromstring(" ".join(texts), dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            return None
    return values if np.all(np.isfinite(values)) else None
