"""Direct light by sampling a light: pick one, pick a direction to it by some technique, ask whether it is seen.

Lo = f(wo, wi) Li(wi) |cos| V / (pdf(wi) / K), the light picked uniformly among K [pbrt4, sec. 13.4].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.arrays import Floats, dot
from renderer.build import RenderScene
from renderer.estimators.protocol import Reflected
from renderer.lights.protocol import LIGHTS
from renderer.plan import RenderPlan
from renderer.records import LightSample, SurfaceHit
from scenes.description import SceneDescription


@dataclass(frozen=True)
class LightSampling:
    """An estimator for each technique that lights may have."""

    name: str
    title: str

    def refuses(self, scene: SceneDescription) -> str | None:
        """The first light that lacks the technique, in words."""
        for shape in scene.shapes:
            for _, kind in LIGHTS.items():
                if kind.accepts(shape) and (why := kind.missing(self.name)):
                    return why
        return None

    def dimensions(self, scene: RenderScene) -> int:
        """Two for the direction, one more to choose among lights."""
        return 2 if scene.light_shape.size == 1 else 3

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        """See `Estimator`."""
        n = hit.p.shape[1]
        if n == 0:
            return Reflected(np.zeros((3, 0)), 0)
        light, sample = self._sample(scene, hit, u)
        cosine = dot(sample.wi, hit.n)
        useful = sample.valid & (cosine > 0) if plan.horizon else sample.valid
        radiance = _shade(scene, hit, sample, cosine, scene.light_shape.size)
        radiance = np.where(useful, radiance, 0.0)
        needs = np.flatnonzero(useful & plan.shadow[np.maximum(hit.shape, 0), light])
        if needs.size:
            hidden = occluded(scene, plan, hit, sample, light, needs)
            radiance[:, needs[hidden]] = 0.0
        return Reflected(radiance, needs.size)

    def _sample(self, scene: RenderScene, hit: SurfaceHit, u: Floats) -> tuple[NDArray[np.int64], LightSample]:
        """A light (n,) and a direction to it for each row."""
        n = hit.p.shape[1]
        lights = scene.light_shape.size
        if lights == 1:
            light = np.zeros(n, dtype=np.int64)
            return light, scene.lights[0].techniques[self.name].sample_direction(light, hit.p, hit.n, u)
        light = np.minimum((u[0] * lights).astype(np.int64), lights - 1)
        if len(scene.lights) == 1:
            return light, scene.lights[0].techniques[self.name].sample_direction(light, hit.p, hit.n, u[1:])
        return light, self._sample_kinds(scene, hit, u[1:], light)

    def _sample_kinds(self, scene: RenderScene, hit: SurfaceHit, u: Floats, light: NDArray[np.int64]) -> LightSample:
        """Rows dealt to the kinds of their lights."""
        n = light.size
        wi, dist, radiance = np.zeros((3, n)), np.zeros(n), np.zeros((3, n))
        pdf, valid = np.ones(n), np.zeros(n, dtype=np.bool_)
        first = 0
        for kind in scene.lights:
            count = kind.shape.size
            rows = np.flatnonzero((light >= first) & (light < first + count))
            p, normal = hit.p.take(rows, axis=1), hit.n.take(rows, axis=1)
            part = kind.techniques[self.name].sample_direction(light[rows] - first, p, normal, u.take(rows, axis=1))
            wi[:, rows], dist[rows], radiance[:, rows] = part.wi, part.dist, part.radiance
            pdf[rows], valid[rows] = part.pdf, part.valid
            first += count
        return LightSample(wi, dist, radiance, pdf, valid)


def _shade(scene: RenderScene, hit: SurfaceHit, sample: LightSample, cosine: Floats, lights: int) -> Floats:
    """(3, n) unoccluded radiance towards wo; rows that are not valid may be anything."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        weight = cosine * lights / sample.pdf
        value = scene.materials[0].evaluate(hit.shape, hit.n, hit.wo, sample.wi)
        for kind in scene.materials[1:]:
            value = value + kind.evaluate(hit.shape, hit.n, hit.wo, sample.wi)
        return value * (sample.radiance * weight)


def occluded(
    scene: RenderScene,
    plan: RenderPlan,
    hit: SurfaceHit,
    sample: LightSample,
    light: NDArray[np.int64],
    rows: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """(m,): whether anything of the plan's blockers lies between the points of `rows` (m,) and their light samples."""
    p, n, wi = hit.p.take(rows, axis=1), hit.n.take(rows, axis=1), sample.wi.take(rows, axis=1)
    dist = sample.dist[rows]
    hidden = np.zeros(rows.size, dtype=np.bool_)
    if plan.shadow_triangles is not None:
        hidden |= plan.shadow_triangles.occluded(p, n, hit.triangle[rows], wi, dist)
    if plan.shadow_quadrics.size:
        goal = scene.light_quadric[light[rows]]
        hidden |= scene.quadrics.occluded(plan.shadow_quadrics, p, wi, dist, hit.quadric[rows], goal)
    return hidden
