"""Proofs by separating planes, which are the grounds of the plan.

A shape cannot block if a plane has it on one side and both receiver and light on the other. The planes tried
are those normal to an axis or to a flat shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.build import RenderScene
from renderer.geometry.primitives import TOLERANCE
from renderer.interfaces.light import Source
from renderer.math.vectors import Floats
from scenes.arrays import Index, Mask
from scenes.description.shapes import ShapeDescription

# A distant light whose direction makes less with a plane may pass along it, as far as these proofs are
# concerned.
ALONG = 1e-6


LARGEST_PROOF = 20_000_000  # entries of the (planes, shapes, shapes) table, beyond which nothing is proved


def provable(scene: RenderScene) -> bool:
    """Whether a scene has something to prove and is small enough to try."""
    count, sources = len(scene), len(scene.sources.all)
    return 0 < (3 + count) * count * count * sources <= LARGEST_PROOF


@dataclass(frozen=True, eq=False)
class Extents:
    """Extents of shapes, sources and camera along m candidate normals.

    low, high: (m, s). plane: (s,) the row of a flat shape's own normal, or -1. camera: (m, e) of the eyes
    that its rays start between. both_sides: (s,) shapes that light may leave behind their plane: those that
    transmit, and those whose shading normals lean away from it. light_low, light_high: (m, q) of the sources;
    both are inf or -inf for a distant light, -inf and inf for an environment.
    """

    low: Floats
    high: Floats
    light_low: Floats
    light_high: Floats
    plane: Index
    camera: Floats
    both_sides: Mask
    tolerance: float


def extents(scene: RenderScene) -> Extents:
    """The extents of all shapes and sources along the normals to try."""
    flat = [i for i, b in enumerate(scene.bounds) if b.normal is not None]
    normals = np.array([*np.eye(3), *(b.normal for b in scene.bounds if b.normal is not None)])
    both = [b.extent(normals) for b in scene.bounds]
    low, high = np.stack([lo for lo, _ in both], axis=1), np.stack([hi for _, hi in both], axis=1)
    plane = np.full(len(scene.bounds), -1, dtype=np.int64)
    plane[flat] = 3 + np.arange(len(flat))
    camera = normals @ scene.camera.eyes
    scale = float(max(np.abs(low).max(), np.abs(high).max(), np.abs(camera).max()))
    lamps = [
        _lamp(source, low, high, normals, int(i))
        for source, i in zip(scene.sources.all, scene.sources.shape, strict=True)
    ]
    light_low, light_high = (
        np.stack([np.zeros(len(normals)), *side], axis=1)[:, 1:] for side in zip(*lamps, strict=True)
    )
    return Extents(
        low, high, light_low, light_high, plane, camera, scene.transmits | scene.smooth, TOLERANCE * scale
    )


def _lamp(source: Source, low: Floats, high: Floats, normals: Floats, shape: int) -> tuple[Floats, Floats]:
    """Least and greatest n . x over a source of light, (m,) each."""
    if isinstance(source, ShapeDescription):
        return low[:, shape], high[:, shape]
    if source.place is not None:
        at = np.einsum("mc,c->m", normals, source.place)
        return at, at
    if source.towards is not None:
        rise = np.einsum("mc,c->m", normals, source.towards)
        at = np.where(np.abs(rise) > ALONG, np.copysign(np.inf, rise), np.nan)  # NaN: nothing is proved
        return at, at
    return np.full(len(normals), -np.inf), np.full(len(normals), np.inf)


def _faces_camera(e: Extents) -> Index:
    """(s,) 1 or -1: the only side of its plane on which a flat shape is seen and lit. 0 if it is not flat, is
    seen edge-on, or may be lit from both sides.
    """
    rows = np.maximum(e.plane, 0)
    own = np.arange(e.plane.size)
    above = e.camera[rows].min(axis=1) > e.high[rows, own] + e.tolerance
    below = e.camera[rows].max(axis=1) < e.low[rows, own] - e.tolerance
    return np.where((e.plane < 0) | e.both_sides, 0, above.astype(np.int64) - below.astype(np.int64))


def _one_sided_plane(scene: RenderScene, e: Extents, source: int) -> int:
    """The row of a flat light's plane; -1 for a light that has no shape, is not flat or emits to
    both sides.
    """
    shape = int(scene.sources.shape[source])
    one_sided = shape >= 0 and not scene.two_sided[shape] and scene.bounds[shape].one_way
    return int(e.plane[shape]) if one_sided else -1


def reach(scene: RenderScene, e: Extents) -> Mask:
    """(s, q): whether light may reach a shape. False where the shape lies behind a one-sided flat light, or
    its visible side faces away from all of the light.
    """
    side = _faces_camera(e)
    columns: list[Mask] = []
    for source in range(len(scene.sources.all)):
        rows, own = np.maximum(e.plane, 0), np.arange(e.plane.size)
        away_up = (side > 0) & (e.light_high[rows, source] < e.low[rows, own] - e.tolerance)
        away_down = (side < 0) & (e.light_low[rows, source] > e.high[rows, own] + e.tolerance)
        plane = _one_sided_plane(scene, e, source)
        behind = (
            e.high[plane] < e.light_low[plane, source] - e.tolerance
            if plane >= 0
            else np.zeros(own.size, dtype=np.bool_)
        )
        columns.append(~(away_up | away_down | behind))
    return np.stack(columns, axis=1)


def blocks(scene: RenderScene, e: Extents) -> Mask:
    """(s, q, s): whether a shape may lie between a receiver and a light; False only where a plane separates
    them.
    """
    side = _faces_camera(e)
    count = e.plane.size
    out: list[Mask] = []
    for source, shape in enumerate(scene.sources.shape):
        apart = np.zeros((count, count), dtype=np.bool_)
        for low, high, lamp in ((e.low, e.high, e.light_low), (-e.high, -e.low, -e.light_high)):
            # The blocker ends at or below where the receiver begins and strictly below the light, or the
            # other way.
            top, receiver, goal = high[:, None, :], low[:, :, None], lamp[:, source][:, None, None]
            touching = (top <= receiver + e.tolerance) & (top < goal - e.tolerance)
            strict = (top < receiver - e.tolerance) & (top <= goal + e.tolerance)
            apart |= (touching | strict).any(axis=0)
        plane = _one_sided_plane(scene, e, source)
        if plane >= 0:  # light leaves on one side of this plane: what is wholly behind it is never in between
            apart |= e.high[plane] < e.light_low[plane, source] - e.tolerance
        apart |= _behind_receiver(e, side)
        if shape >= 0 and (e.plane[shape] >= 0 or np.count_nonzero(scene.lights.source == source) == 1):
            apart[:, shape] = True  # a flat or single light does not hide what it sends out
        out.append(~apart)
    return np.stack(out, axis=1)


def _behind_receiver(e: Extents, side: Index) -> Mask:
    """(s, s): whether a blocker lies wholly behind the visible side of a flat receiver; a flat receiver does
    not hide itself either.
    """
    rows, own = np.maximum(e.plane, 0), np.arange(e.plane.size)
    below = e.high[rows] < (e.low[rows, own] - e.tolerance)[:, None]
    above = e.low[rows] > (e.high[rows, own] + e.tolerance)[:, None]
    out = ((side > 0)[:, None] & below) | ((side < 0)[:, None] & above)
    out[own, own] |= e.plane >= 0
    return out


def crosses(scene: RenderScene, e: Extents) -> Mask:
    """(s, q): whether part of a light may lie below the horizon of a point on a receiver's visible side."""
    side = _faces_camera(e)
    rows, own = np.maximum(e.plane, 0), np.arange(e.plane.size)
    low, high = e.light_low[rows], e.light_high[rows]
    above = (side > 0)[:, None] & (low > (e.high[rows, own] + e.tolerance)[:, None])
    below = (side < 0)[:, None] & (high < (e.low[rows, own] - e.tolerance)[:, None])
    return ~(above | below)


def gap(e: Extents, receiver: int, source: int) -> float:
    """A lower bound, in world units, on the distance between a receiver and a source by the best of the
    planes; 0 where none separates them.
    """
    above, below = e.light_low[:, source] - e.high[:, receiver], e.low[:, receiver] - e.light_high[:, source]
    both = np.maximum(np.where(np.isnan(above), -np.inf, above), np.where(np.isnan(below), -np.inf, below))
    return max(float(both.max()), 0.0)
