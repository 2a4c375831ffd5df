"""Visibility: shadow rays from points to what they would see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.build import RenderScene
from renderer.geometry.cutouts import CutoutBlockers
from renderer.interfaces.estimator import Reflected
from renderer.math.vectors import Floats, dot, gather
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from scenes.arrays import Index, Mask


@dataclass(frozen=True, eq=False)
class Seen:
    """The aims of rays wi (3, n). light: (n,), -1 for none. dist: (n,), inf for an environment. normal: (3,
    n) or (3, 1), the aim's, 0 where the ray ends in free space.
    """

    light: Index
    wi: Floats
    dist: Floats
    normal: Floats


def visible(
    scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, seen: Seen, useful: Mask, radiance: Floats
) -> Reflected:
    """The `radiance` (3, n) that arrives: 0 where a row is not `useful` (n,), and where something blocks the
    ray.

    Rows that are not useful may hold anything. Shadow rays are traced where the plan calls for them.
    """
    radiance = np.where(useful, radiance, 0.0)
    if plan.witness is not None and not useful.all():
        idle = np.flatnonzero(~useful)
        nothing = np.zeros(idle.size, dtype=np.bool_)
        plan.witness(hit.take(idle), seen.wi.take(idle, axis=1), seen.dist[idle], nothing, nothing)
    source = scene.lights.source.take(np.maximum(seen.light, 0))
    rows = np.flatnonzero(useful & plan.shadow[np.maximum(hit.shape, 0), source])
    if rows.size:
        radiance[:, rows[hidden(scene, plan, hit, seen, rows)]] = 0.0
    return Reflected(radiance, rows.size)


def hidden(scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, seen: Seen, rows: Index) -> Mask:
    """(m,): whether a blocker of the plan lies between the points `rows` (m,) and their aims."""
    some, wi = hit.take(rows), seen.wi.take(rows, axis=1)
    p, n = some.p, some.normal_towards(wi)
    dist, ny = seen.dist[rows], gather(seen.normal, rows)
    cos_light = dot(wi, ny)
    ny = np.where(cos_light > 0, -ny, ny)  # on the side of p
    out = np.zeros(rows.size, dtype=np.bool_)
    if plan.shadow_triangles is not None:
        out |= plan.shadow_triangles.occluded(
            p, n, some.triangle, p + wi * np.minimum(dist, scene.scene_diameter), ny
        )
    if plan.shadow_analytic.size:
        # Within contact_epsilon of the plane of either end is part of that end, as in the plan's proofs.
        with np.errstate(divide="ignore"):
            tmin, margin = (
                scene.contact_epsilon / np.abs(dot(wi, n)),
                scene.contact_epsilon / np.abs(cos_light),
            )
        tmax = dist - np.where(cos_light == 0, 0.0, margin)
        light = seen.light[rows]
        goal = (
            np.where(light >= 0, scene.lights.primitive.take(np.maximum(light, 0)), -1)
            if len(scene.lights)
            else light
        )
        out |= scene.analytic.occluded(plan.shadow_analytic, p, wi, tmin, tmax, some.primitive, goal)
    if plan.shadow_cutouts is not None:
        left = np.flatnonzero(~out)
        out[left] = _stopped(scene, plan.shadow_cutouts, some.take(left), wi.take(left, axis=1), dist[left])
    if plan.witness is not None:
        plan.witness(some, wi, dist, np.ones_like(out), out)
    return out


def _stopped(scene: RenderScene, holed: CutoutBlockers, hit: SurfaceHit, wi: Floats, dist: Floats) -> Mask:
    """(n,): whether a shape with an alpha stops the rays wi (3, n) within the distance dist (n,)."""
    reach = np.minimum(dist, scene.scene_diameter) - scene.contact_epsilon
    return holed.occluded(hit.p, hit.normal_towards(wi), hit.triangle, hit.primitive, wi, reach)
