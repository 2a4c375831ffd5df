"""The effects that a scene calls for, with reasons. The renderer simulates these and proves that the others
are nothing.

A pruning is made only where the work left out is provably an identity or a zero, so that the pruned image is
bit for bit the unpruned one. All proofs rest on planes: of the axes, of flat shapes, of flat lights.

Prunings: `emission` (lights out of view), `reach` (receivers that no light can reach), `occlusion` (receiver
and light with nothing in between), `blockers` (shapes that never shade), `horizon` (lights wholly above a
receiver's horizon).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from renderer.build import RenderScene
from renderer.geometry.cutouts import CutoutBlockers
from renderer.geometry.triangles import Triangles
from renderer.interfaces.light import Source
from renderer.interfaces.material import Lobes
from renderer.math.vectors import Floats
from renderer.plan.proofs import blocks, crosses, extents, provable, reach
from renderer.records import SurfaceHit
from scenes.arrays import Index, Mask
from scenes.description.materials import MixedMaterial
from scenes.description.shapes import ShapeDescription

PRUNINGS = ("emission", "reach", "occlusion", "blockers", "horizon")

# Told of samples: points, wi (3, n), the distance to what they would see (n,), and whether they were of use
# at all and hidden, (n,).
Witness = Callable[[SurfaceHit, Floats, Floats, Mask, Mask], None]


@dataclass(frozen=True)
class Decision:
    """An effect, whether this scene calls for it, and why. `pruning`: the name by which to keep it."""

    effect: str
    needed: bool
    reason: str
    pruning: str


@dataclass(frozen=True, eq=False)
class RenderPlan:
    """The work that is left for s shapes and q sources of light.

    in_view: analytic primitives that a camera ray may meet. receivers: (s,) shapes to shade. shadow: (s, q)
    pairs with something in between. blockers: (s,) shapes that may shade. horizon: whether a light may dip
    below a receiver's horizon. emits: whether light is seen directly. shadow_triangles, shadow_analytic: the
    blockers without an alpha. shadow_cutouts: the blockers with an alpha, None without any. witness: receives
    every sample, for pictures of what an estimator does; None in every render.
    """

    in_view: Index
    receivers: Mask
    shadow: Mask
    horizon: bool
    emits: bool
    shadow_triangles: Triangles | None
    shadow_analytic: Index
    shadow_cutouts: CutoutBlockers | None
    decisions: tuple[Decision, ...]
    seconds: float
    witness: Witness | None = None


def make_plan(scene: RenderScene, prune: bool = True, keep: frozenset[str] = frozenset()) -> RenderPlan:
    """The plan for a scene's light. With prune False all effects are simulated; those named in `keep` are in
    any case.
    """
    start = time.perf_counter()
    active = frozenset(PRUNINGS) - keep if prune else frozenset[str]()
    count = len(scene)
    black = scene.lobes == 0
    proved = _proved(scene, black)
    visible = scene.camera.sees_each(_corners(scene))
    seen = np.array([_seen(source, visible, int(i)) for source, i in _sources(scene)], dtype=np.bool_)
    decisions = (
        _emission(scene, seen),
        _receivers(black, proved.reach),
        *_occlusion(scene, proved),
        _blockers(proved.blockers),
        _horizon(proved.crosses),
        *_surfaces(scene),
    )
    in_view = (
        visible | (scene.sources.of_shape < 0) if "emission" in active else np.ones(count, dtype=np.bool_)
    )
    shades = proved.blockers if "blockers" in active else np.ones(count, dtype=np.bool_)
    shadow_triangles, shadow_analytic, shadow_cutouts = _shadow_casters(scene, shades)
    return RenderPlan(
        in_view=np.flatnonzero(in_view[scene.analytic.shape]),
        receivers=proved.lit if "reach" in active else np.ones(count, dtype=np.bool_),
        shadow=proved.shadow if "occlusion" in active else np.ones_like(proved.shadow),
        horizon=proved.crosses if "horizon" in active else True,
        emits=bool(seen.any()) if "emission" in active else True,
        shadow_triangles=shadow_triangles,
        shadow_analytic=shadow_analytic,
        shadow_cutouts=shadow_cutouts,
        decisions=decisions,
        seconds=time.perf_counter() - start,
    )


def plan_occlusion(scene: RenderScene) -> RenderPlan:
    """The plan for ambient occlusion: every surface is shaded, every shape occludes, and no light is seen."""
    start = time.perf_counter()
    count = len(scene)
    everyone = np.ones(count, dtype=np.bool_)
    triangles, analytic, shadow_cutouts = _shadow_casters(scene, everyone)
    lights = Decision("light", False, "ambient occlusion asks only what is open, not what shines", "none")
    return RenderPlan(
        in_view=np.arange(len(scene.analytic)),
        receivers=everyone,
        shadow=np.ones((count, len(scene.sources.all)), dtype=np.bool_),
        horizon=True,
        emits=False,
        shadow_triangles=triangles,
        shadow_analytic=analytic,
        shadow_cutouts=shadow_cutouts,
        decisions=(lights,),
        seconds=time.perf_counter() - start,
    )


@dataclass(frozen=True, eq=False)
class _Proofs:
    """The results of the proofs. reach, shadow: (s, q). lit, blockers: (s,). between: (q,) the number of
    shapes that may shade the light of each source.
    """

    reach: Mask
    lit: Mask
    shadow: Mask
    blockers: Mask
    between: Index
    crosses: bool


def _proved(scene: RenderScene, black: Mask) -> _Proofs:
    """The effects that the proofs leave; every effect in a scene that is too large to prove."""
    count, sources = len(scene), len(scene.sources.all)
    if not provable(scene):
        everything = np.ones((count, sources), dtype=np.bool_)
        lit = ~black & bool(sources)
        return _Proofs(
            everything, lit, everything, np.ones(count, dtype=np.bool_), np.full(sources, count), True
        )
    e = extents(scene)
    reached, between = reach(scene, e), blocks(scene, e)
    lit = ~black & reached.any(axis=1)
    between &= (lit[:, None] & reached)[:, :, None]
    crossing = bool((crosses(scene, e) & lit[:, None]).any())
    counts = between.any(axis=0).sum(axis=1)
    shadow: Mask = np.asarray(between.any(axis=2))
    blockers: Mask = np.asarray(between.any(axis=(0, 1)))
    return _Proofs(reached, lit, shadow, blockers, counts, crossing)


def _sources(scene: RenderScene) -> Iterable[tuple[Source, int]]:
    return zip(scene.sources.all, scene.sources.shape, strict=True)


def _seen(source: Source, visible: Mask, shape: int) -> bool:
    """Whether a camera ray may meet a light: never one without extent, always one that surrounds
    the scene.
    """
    return bool(visible[shape]) if isinstance(source, ShapeDescription) else source.surrounds


def _corners(scene: RenderScene) -> Floats:
    """(s, 3, 8): the corners of each shape's box."""
    low, high = scene.boxes
    choose = np.indices((2, 2, 2)).reshape(3, 8)
    return np.where(choose == 0, low[:, :, None], high[:, :, None])


def _shadow_casters(
    scene: RenderScene, shades: Mask
) -> tuple[Triangles | None, Index, CutoutBlockers | None]:
    """The blockers among shapes (s,): triangles and analytic primitives without an alpha, and those
    with one.
    """
    if scene.cutouts is None:
        return *_members(scene, shades), None
    some = scene.cutouts.some & shades
    shadow_cutouts = (
        CutoutBlockers(scene.cutouts, *_members(scene, some), scene.analytic) if some.any() else None
    )
    return *_members(scene, shades & ~scene.cutouts.some), shadow_cutouts


def _members(scene: RenderScene, some: Mask) -> tuple[Triangles | None, Index]:
    """The triangles and the analytic primitives of some shapes (s,)."""
    triangles = scene.triangles
    if triangles is not None:
        keep = some[triangles.shape]
        triangles = None if not keep.any() else triangles if keep.all() else triangles.only(keep)
    return triangles, np.flatnonzero(some[scene.analytic.shape])


def _emission(scene: RenderScene, seen: Mask) -> Decision:
    names = [n for n, s in zip(scene.sources.names, seen, strict=True) if s]
    reason = f"may be seen: {', '.join(names)}" if names else "every light lies outside the view frustum"
    return Decision("lights seen by the camera", bool(names), reason, "emission")


def _receivers(black: Mask, reach: Mask) -> Decision:
    dark = ~reach.any(axis=1) & ~black
    reason = (
        f"of {black.size} shapes {int(dark.sum())} are out of reach of all lights and "
        f"{int(black.sum())} are black"
    )
    return Decision("shading of every shape", not bool((dark | black).any()), reason, "reach")


def _occlusion(scene: RenderScene, proved: _Proofs) -> list[Decision]:
    out: list[Decision] = []
    for source, name in enumerate(scene.sources.names):
        pairs = proved.shadow[:, source]
        reason = f"{int(proved.between[source])} shapes may lie between it and {int(pairs.sum())} receivers"
        reason = reason if pairs.any() else "nothing can lie between it and any receiver"
        out.append(Decision(f"shadow rays to {name}", bool(pairs.any()), reason, "occlusion"))
    return out


def _blockers(blockers: Mask) -> Decision:
    idle = int((~blockers).sum())
    reason = f"{idle} of {blockers.size} shapes never lie between a receiver and a light"
    return Decision("all shapes in shadow tests", idle == 0, reason, "blockers")


def _surfaces(scene: RenderScene) -> Iterable[Decision]:
    """Effects that only some surfaces have: their stages run where a scene has such a surface, and nowhere
    else.
    """
    shapes = scene.description.shapes
    mixed = [isinstance(s.material, MixedMaterial) for s in shapes]
    kinds = {
        "shading normals": (scene.smooth, "vertex normals, normal maps or bumps"),
        "holes in surfaces": ([s.alpha is not None for s in shapes], "an alpha"),
        "delta lobes": ((scene.lobes & Lobes.SPECULAR) != 0, "a mirror or smooth glass in their material"),
        "light through surfaces": (scene.transmits, "a material that transmits"),
        "texture coordinates": ([s.needs_uv for s in shapes], "something that varies over their surface"),
        "choice of materials": (mixed, "a mix of materials"),
    }
    for effect, (some, what) in kinds.items():
        count = int(np.count_nonzero(some))
        reason = f"{count} of {len(shapes)} shapes have {what}" if count else f"no shape has {what}"
        yield Decision(effect, count > 0, reason, "none")


def _horizon(crosses: bool) -> Decision:
    reason = (
        "a light may dip below the horizon of a receiver" if crosses else "every light is above every horizon"
    )
    return Decision("horizon tests", crosses, reason, "horizon")
