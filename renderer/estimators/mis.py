"""`mis`: light and BRDF sampling together, each weighted by how likely it was to find what it found.

Veach's multi-sample estimator with one sample of each technique [veach1995]: wherever one technique's pdf is
small, the other's carries the sample, so that neither a near light nor a smooth surface makes a weight large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.arrays import Floats, dot
from renderer.build import RenderScene
from renderer.estimators.direction_sampling import brdf
from renderer.estimators.protocol import ESTIMATORS, Reflected
from renderer.estimators.shading import (
    Seen,
    best_technique,
    choose_light,
    hidden,
    light_along,
    light_pdf,
    sample_light,
    scatter,
)
from renderer.plan import RenderPlan
from renderer.records import SurfaceHit
from scenes.description import SceneDescription


@dataclass(frozen=True)
class MultipleImportance:
    """One light sample and one BRDF sample. power: 1 for the balance heuristic, 2 for the power heuristic."""

    name: str
    title: str
    power: int

    def refuses(self, scene: SceneDescription) -> str | None:
        """None: lights without a solid-angle technique are sampled by area, and the BRDF takes what area does badly."""
        return None

    def dimensions(self, scene: RenderScene) -> int:
        """Two for each direction, one more to choose among lights."""
        return 4 if scene.light_shape.size == 1 else 5

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        """See `Estimator`."""
        if hit.p.shape[1] == 0:
            return Reflected(np.zeros((3, 0)), 0)
        by_light = self._light(scene, plan, hit, u[2:])
        by_brdf = self._brdf(scene, plan, hit, u[:2])
        return Reflected(by_light.radiance + by_brdf.radiance, by_light.shadow_rays + by_brdf.shadow_rays)

    def _light(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        lights = scene.light_shape.size
        light, u = choose_light(scene, u)
        sample = sample_light(scene, [best_technique(kind) for kind in scene.lights], hit, light, u)
        cosine = dot(sample.wi, hit.n)
        useful = sample.valid & (cosine > 0)
        other = material_pdf(scene, hit, sample.wi)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            own = sample.pdf / lights
            weight = self._weight(own, other) * cosine / own
            radiance = np.where(useful, scatter(scene, hit, sample.wi) * (sample.radiance * weight), 0.0)
        rows = np.flatnonzero(useful & plan.shadow[np.maximum(hit.shape, 0), light])
        if rows.size:
            seen = Seen(light, sample.wi, sample.dist, sample.normal)
            radiance[:, rows[hidden(scene, plan, hit, seen, rows)]] = 0.0
        return Reflected(radiance, rows.size)

    def _brdf(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        wi, own = brdf(scene, hit, u)
        seen, le = light_along(scene, hit, wi)
        light = seen.light
        cosine = dot(wi, hit.n)
        useful = (light >= 0) & (cosine > 0) & (own > 0) & le.any(axis=0)
        samplers = [best_technique(kind) for kind in scene.lights]
        other = light_pdf(scene, samplers, hit, np.where(useful, light, -1), wi) / scene.light_shape.size
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            weight = self._weight(own, other) * cosine / own
            radiance = np.where(useful, scatter(scene, hit, wi) * (le * weight), 0.0)
        rows = np.flatnonzero(useful & plan.shadow[np.maximum(hit.shape, 0), np.maximum(light, 0)])
        if rows.size:
            radiance[:, rows[hidden(scene, plan, hit, seen, rows)]] = 0.0
        return Reflected(radiance, rows.size)

    def _weight(self, own: Floats, other: Floats) -> Floats:
        """own^b / (own^b + other^b), by the ratio, so that neither power overflows."""
        ratio = other / own
        return 1.0 / (1.0 + (ratio if self.power == 1 else ratio * ratio))


def material_pdf(scene: RenderScene, hit: SurfaceHit, wi: Floats) -> Floats:
    """Density (n,) in 1/sr with which BRDF sampling goes along wi (3, n)."""
    out = np.zeros(wi.shape[1])
    for kind, rows in scene.rows_of_materials(hit.shape):
        part = (v.take(rows, axis=1) for v in (hit.n, hit.wo, wi))
        out[rows] = kind.pdf(hit.shape[rows], *part)
    return out


ESTIMATORS.add("mis", MultipleImportance("mis", "light and BRDF samples, power heuristic", 2))
ESTIMATORS.add("mis-balance", MultipleImportance("mis-balance", "light and BRDF samples, balance heuristic", 1))
