"""Which effects a scene calls for, and why: the renderer simulates those and proves that the rest is nothing.

A pruning is made only where the work left out is provably an identity or a zero, so that the pruned image is the
unpruned one bit for bit. All proofs are about supporting planes: of the axes, of flat shapes, of flat lights.
Prunings: `emission` (lights out of view), `reach` (receivers that no light can reach), `occlusion` (receiver and light
with nothing in between), `blockers` (shapes that never shade), `horizon` (lights wholly above a receiver's horizon).
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.arrays import Floats
from renderer.bounds import TOLERANCE
from renderer.build import RenderScene
from renderer.intersect import Triangles

PRUNINGS = ("emission", "reach", "occlusion", "blockers", "horizon")
LARGEST_PROOF = 20_000_000  # entries of the (planes, shapes, shapes) table, beyond which nothing is proved

Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Decision:
    """One effect: whether this scene calls for it, and why. `pruning` is the name to keep it by."""

    effect: str
    needed: bool
    reason: str
    pruning: str


@dataclass(frozen=True, eq=False)
class RenderPlan:
    """s shapes, K lights. in_view: (q,) indices of quadrics that a camera ray may meet. receivers: (s,) shapes to shade.

    shadow: (s, K) pairs with something in between. blockers: (s,) shapes that may shade. horizon: whether any light may
    dip below a receiver's horizon. emits: whether light is seen directly. shadow_triangles, shadow_quadrics: the blockers.
    """

    in_view: NDArray[np.int64]
    receivers: Bools
    shadow: Bools
    horizon: bool
    emits: bool
    shadow_triangles: Triangles | None
    shadow_quadrics: NDArray[np.int64]
    decisions: tuple[Decision, ...]
    seconds: float


@dataclass(frozen=True, eq=False)
class _Extents:
    """Extents along q candidate normals. low, high: (q, s). plane: (s,) row of a flat shape's own, or -1. camera: (q,)."""

    low: Floats
    high: Floats
    plane: NDArray[np.int64]
    camera: Floats
    tolerance: float


def make_plan(scene: RenderScene, prune: bool = True, keep: frozenset[str] = frozenset()) -> RenderPlan:
    """The plan for a scene. prune False, or a pruning named in `keep`, simulates the effect needed or not."""
    start = time.perf_counter()
    active = frozenset(PRUNINGS) - keep if prune else frozenset[str]()
    count, lights = len(scene.bounds), scene.light_shape.size
    black = np.all([kind.black() for kind in scene.materials], axis=0)
    small = (3 + count) * count * count * lights <= LARGEST_PROOF
    extents = _extents(scene) if small else None
    reach = _reach(scene, extents) if extents is not None else np.ones((count, lights), dtype=np.bool_)
    blocks = _blocks(scene, extents) if extents is not None else np.ones((count, lights, count), dtype=np.bool_)
    lit = ~black & reach.any(axis=1)
    blocks &= (lit[:, None] & reach)[:, :, None]
    shadow, blockers = blocks.any(axis=2), blocks.any(axis=(0, 1))
    crosses = _crosses(scene, extents) & lit[:, None] if extents is not None else np.ones_like(shadow)
    visible = np.array([scene.camera.sees(_corners(scene, i)) for i in range(count)])
    seen = visible[scene.light_shape]
    decisions = (
        _emission(scene, seen),
        _receivers(black, reach),
        *_occlusion(scene, blocks),
        _blockers(blockers),
        _horizon(bool(crosses.any())),
    )
    emitter = np.isin(np.arange(count), scene.light_shape)
    in_view = visible | ~emitter if "emission" in active else np.ones(count, dtype=np.bool_)
    shades = blockers if "blockers" in active else np.ones(count, dtype=np.bool_)
    shadow_triangles, shadow_quadrics = _shadow_casters(scene, shades)
    return RenderPlan(
        in_view=np.flatnonzero(in_view[scene.quadrics.shape]),
        receivers=lit if "reach" in active else np.ones(count, dtype=np.bool_),
        shadow=shadow if "occlusion" in active else np.ones_like(shadow),
        horizon=bool(crosses.any()) if "horizon" in active else True,
        emits=bool(seen.any()) if "emission" in active else True,
        shadow_triangles=shadow_triangles,
        shadow_quadrics=shadow_quadrics,
        decisions=decisions,
        seconds=time.perf_counter() - start,
    )


def _extents(scene: RenderScene) -> _Extents:
    flat = [i for i, b in enumerate(scene.bounds) if b.normal is not None]
    normals = np.array([*np.eye(3), *(b.normal for b in scene.bounds if b.normal is not None)])
    both = [b.extent(normals) for b in scene.bounds]
    low, high = np.stack([lo for lo, _ in both], axis=1), np.stack([hi for _, hi in both], axis=1)
    plane = np.full(len(scene.bounds), -1, dtype=np.int64)
    plane[flat] = 3 + np.arange(len(flat))
    camera = np.einsum("qc,c->q", normals, scene.camera.origin[:, 0])
    scale = float(max(np.abs(low).max(), np.abs(high).max(), np.abs(camera).max()))
    return _Extents(low, high, plane, camera, TOLERANCE * scale)


def _faces_camera(e: _Extents) -> NDArray[np.int64]:
    """(s,) 1 or -1: the side of its plane from which a flat shape is seen; 0 if it is not flat or seen edge-on."""
    rows = np.maximum(e.plane, 0)
    own = np.arange(e.plane.size)
    above = e.camera[rows] > e.high[rows, own] + e.tolerance
    below = e.camera[rows] < e.low[rows, own] - e.tolerance
    return np.where(e.plane < 0, 0, above.astype(np.int64) - below.astype(np.int64))


def _one_sided_plane(scene: RenderScene, e: _Extents, light: int) -> int:
    """The row of a flat light's plane, or -1 if it is not flat or emits on both sides."""
    shape = int(scene.light_shape[light])
    return -1 if scene.two_sided[shape] else int(e.plane[shape])


def _reach(scene: RenderScene, e: _Extents) -> Bools:
    """(s, K): False where a shape lies behind a one-sided flat light, or its visible side faces away from all of it."""
    side = _faces_camera(e)
    columns: list[Bools] = []
    for light, shape in enumerate(scene.light_shape):
        rows, own = np.maximum(e.plane, 0), np.arange(e.plane.size)
        away_up = (side > 0) & (e.high[rows, shape] < e.low[rows, own] - e.tolerance)
        away_down = (side < 0) & (e.low[rows, shape] > e.high[rows, own] + e.tolerance)
        plane = _one_sided_plane(scene, e, light)
        behind = e.high[plane] < e.low[plane, shape] - e.tolerance if plane >= 0 else np.zeros(own.size, dtype=np.bool_)
        columns.append(~(away_up | away_down | behind))
    return np.stack(columns, axis=1)


def _blocks(scene: RenderScene, e: _Extents) -> Bools:
    """(s, K, s): whether a shape may lie between a receiver and a light; False only with a plane that separates them."""
    side = _faces_camera(e)
    count = e.plane.size
    out: list[Bools] = []
    for light, shape in enumerate(scene.light_shape):
        apart = np.zeros((count, count), dtype=np.bool_)
        for low, high in ((e.low, e.high), (-e.high, -e.low)):
            # The blocker ends at or below where the receiver begins and strictly below the light, or the other way.
            top, receiver, lamp = high[:, None, :], low[:, :, None], low[:, shape][:, None, None]
            touching = (top <= receiver + e.tolerance) & (top < lamp - e.tolerance)
            strict = (top < receiver - e.tolerance) & (top <= lamp + e.tolerance)
            apart |= (touching | strict).any(axis=0)
        plane = _one_sided_plane(scene, e, light)
        if plane >= 0:  # light leaves on one side of this plane: what is wholly behind it is never in between
            apart |= e.high[plane] < e.low[plane, shape] - e.tolerance
        apart |= _behind_receiver(e, side)
        if e.plane[shape] >= 0 or np.count_nonzero(scene.light_shape == shape) == 1:
            apart[:, shape] = True  # a flat or single light does not hide what it sends out
        out.append(~apart)
    return np.stack(out, axis=1)


def _behind_receiver(e: _Extents, side: NDArray[np.int64]) -> Bools:
    """(s, s): blockers wholly behind the visible side of a flat receiver; a flat receiver does not hide itself either."""
    rows, own = np.maximum(e.plane, 0), np.arange(e.plane.size)
    below = e.high[rows] < (e.low[rows, own] - e.tolerance)[:, None]
    above = e.low[rows] > (e.high[rows, own] + e.tolerance)[:, None]
    out = ((side > 0)[:, None] & below) | ((side < 0)[:, None] & above)
    out[own, own] |= e.plane >= 0
    return out


def _crosses(scene: RenderScene, e: _Extents) -> Bools:
    """(s, K): whether part of a light may lie below the horizon of some point of a receiver's visible side."""
    side = _faces_camera(e)
    rows, own = np.maximum(e.plane, 0), np.arange(e.plane.size)
    low, high = e.low[rows][:, scene.light_shape], e.high[rows][:, scene.light_shape]
    above = (side > 0)[:, None] & (low > (e.high[rows, own] + e.tolerance)[:, None])
    below = (side < 0)[:, None] & (high < (e.low[rows, own] - e.tolerance)[:, None])
    return ~(above | below)


def _corners(scene: RenderScene, shape: int) -> Floats:
    """(3, m): points whose hull holds a shape."""
    low, high = scene.bounds[shape].extent(np.eye(3))
    choose = np.indices((2, 2, 2)).reshape(3, 8)
    return np.where(choose == 0, low[:, None], high[:, None])


def _shadow_casters(scene: RenderScene, shades: Bools) -> tuple[Triangles | None, NDArray[np.int64]]:
    triangles = scene.triangles
    if triangles is not None:
        keep = shades[triangles.shape]
        triangles = None if not keep.any() else triangles if keep.all() else triangles.only(keep)
    return triangles, np.flatnonzero(shades[scene.quadrics.shape])


def _emission(scene: RenderScene, seen: Bools) -> Decision:
    names = [n for n, s in zip(scene.light_names, seen, strict=True) if s]
    reason = f"in the view frustum: {', '.join(names)}" if names else "every light lies outside the view frustum"
    return Decision("lights seen by the camera", bool(names), reason, "emission")


def _receivers(black: Bools, reach: Bools) -> Decision:
    dark = ~reach.any(axis=1) & ~black
    reason = f"of {black.size} shapes {int(dark.sum())} are out of reach of all lights and {int(black.sum())} are black"
    return Decision("shading of every shape", not bool((dark | black).any()), reason, "reach")


def _occlusion(scene: RenderScene, blocks: Bools) -> list[Decision]:
    out: list[Decision] = []
    for light, name in enumerate(scene.light_names):
        pairs = blocks[:, light].any(axis=1)
        between = int(blocks[:, light].any(axis=0).sum())
        reason = f"{between} shapes may lie between it and {int(pairs.sum())} receivers"
        reason = reason if pairs.any() else "nothing can lie between it and any receiver"
        out.append(Decision(f"shadow rays to {name}", bool(pairs.any()), reason, "occlusion"))
    return out


def _blockers(blockers: Bools) -> Decision:
    idle = int((~blockers).sum())
    reason = f"{idle} of {blockers.size} shapes never lie between a receiver and a light"
    return Decision("all shapes in shadow tests", idle == 0, reason, "blockers")


def _horizon(crosses: bool) -> Decision:
    reason = "a light may dip below the horizon of a receiver" if crosses else "every light is above every horizon"
    return Decision("horizon tests", crosses, reason, "horizon")
