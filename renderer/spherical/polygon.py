"""Convex polygons as a surface sees them: in the surface's frame, clipped at its horizon, cut into triangles.

The third axis of a point's frame is the surface's normal, so that third coordinates are heights over the
horizon. The frame is mirrored where the polygon turns clockwise, so that every polygon turns
counter-clockwise about the zenith. A polygon is held as one corner and the offsets of the others; a
difference of corners would carry the rounding of the distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.math.vectors import Floats, cross, dot, frame_about
from scenes.arrays import Index

Frame = tuple[Floats, Floats, Floats]


@dataclass(frozen=True, eq=False)
class Polygon:
    """Polygons of up to m corners in the frames of n points; a polygon wholly below the horizon has volumes
    of 0.

    base: (3, n), where the offsets start. offset: (3, m, n), the corners from there. up: (m, n), their
    heights, >= 0. volume: (m - 2, n), the triple products of the triangles of the fan at the first corner, 0
    for none. frame: the axes in the world, (3, n) each.
    """

    base: Floats
    offset: Floats
    up: Floats
    volume: Floats
    frame: Frame

    def take(self, rows: Index) -> Polygon:
        """Those of some points."""
        x, y, z = (axis.take(rows, axis=-1) for axis in self.frame)
        base, offset, up, volume = (
            v.take(rows, axis=-1) for v in (self.base, self.offset, self.up, self.volume)
        )
        return Polygon(base, offset, up, volume, (x, y, z))


def seen_from(corner: Floats, others: Floats, ref_n: Floats) -> Polygon:
    """The part above the horizon of convex planar polygons, with one corner more; the last is repeated as
    needed.

    corner: (3, n), the first corner relative to the points. others: (3, v - 1, n) or (3, v - 1, 1), the
    others as offsets from the first, in order. ref_n: (3, n), the surface's unit normal. A polygon seen
    edge-on, or one that merely touches the horizon, has volumes of 0.
    """
    area = cross(others[:, 0], others[:, 1])
    with np.errstate(invalid="ignore", divide="ignore"):
        height = dot(corner, area / np.sqrt(dot(area, area)))
    x, y, _ = frame_about(ref_n)
    frame = (x, y * np.sign(height), ref_n)
    base = np.stack([dot(corner, axis) for axis in frame])
    local = np.stack([dot(others, axis[:, None]) for axis in frame])
    # The first corner is no offset; the last one comes twice.
    offset = np.concatenate([np.zeros_like(local[:, :1]), local, local[:, -1:]], axis=1)
    up = base[2] + offset[2]
    above = (up > 0).any(axis=0)
    rows = np.flatnonzero(above & (up < 0).any(axis=0))
    if rows.size:
        offset[:, :, rows], up[:, rows] = _clip(offset[:, :-1, rows], up[:-1, rows])
    leg = offset[:, 1:] - offset[:, :1]
    area = cross(leg[:, :-1], leg[:, 1:])
    volume = np.sqrt(dot(area, area)) * (np.abs(height) * above)
    return Polygon(base, offset, np.maximum(up, 0.0), volume, frame)


def _clip(offset: Floats, up: Floats) -> tuple[Floats, Floats]:
    """The part above the horizon of polygons that cross it: offset (3, v, n), up (v, n) -> (3, v + 1, n), (v
    + 1, n).

    A convex polygon enters once and leaves once: the corners between are a run, and the two cuts end it.
    """
    v, inside = len(up), up > 0
    start = (inside & ~np.roll(inside, 1, axis=0)).argmax(axis=0)
    count = inside.sum(axis=0)
    turn = (start + np.arange(v)[:, None]) % v
    offset, up = np.take_along_axis(offset, turn[None], axis=1), np.take_along_axis(up, turn, axis=0)
    # In this order corners 0 ... count - 1 are above.
    enter = _cut(offset[:, 0], up[0], offset[:, -1], up[-1])
    last = np.stack([count - 1, count])
    ends, heights = np.take_along_axis(offset, last[None], axis=1), np.take_along_axis(up, last, axis=0)
    leave = _cut(ends[:, 0], heights[0], ends[:, 1], heights[1])
    own = np.arange(v)[:, None] < count
    clipped = np.concatenate([enter[:, None], np.where(own, offset, leave[:, None])], axis=1)
    return clipped, np.concatenate([np.zeros_like(up[:1]), np.where(own, up, 0.0)])


def _cut(above: Floats, up: Floats, below: Floats, down: Floats) -> Floats:
    """The point where an edge meets the horizon, from a corner at height up > 0 to one at height
    down <= 0.
    """
    return above + (below - above) * (up / (up - down))
