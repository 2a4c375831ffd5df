"""`mis`: one light sample and one BRDF sample, each weighted by the pdfs of both techniques for its
direction.

Veach's multi-sample estimator with one sample of each technique [veach1995]. Where one technique's pdf is
small, the other's carries the sample, so that neither a near light nor a smooth surface makes a weight large.
`mis-compensated` leaves the darker parts of an environment to the BRDF [karlik2019].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.build import RenderScene
from renderer.interfaces.estimator import ESTIMATORS, Estimator, Reflected
from renderer.interfaces.light import DirectionSampler
from renderer.math.vectors import Floats
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from renderer.shading.bsdf import abs_cosine, bsdf_pdf, bsdf_value, sample_bsdf
from renderer.shading.directions import lights_met, scattered
from renderer.shading.lights import (
    choose_light,
    light_pdf,
    light_pmf,
    sample_light,
    supporting_techniques,
)
from renderer.shading.visibility import Seen, visible
from scenes.description.scene import SceneDescription

# Lights are sampled by the first of these that they have: bounded weights before unbounded ones.
BEST = ("environment", "solid-angle", "area")


@dataclass(frozen=True)
class MultipleImportance(Estimator):
    """One light sample and one BRDF sample.

    power: 1 for the balance heuristic, 2 for the power heuristic. preferred: techniques for the light sample,
    best first.
    """

    power: int
    preferred: tuple[str, ...] = BEST

    def refuses(self, scene: SceneDescription) -> str | None:
        """The reason against compensation without an environment image, else None."""
        if self.preferred == BEST or any(light.surrounds for light in scene.lights):
            return None
        return "it has no environment to compensate"

    def dimensions(self, scene: RenderScene) -> int:
        """Two for each direction, one more to choose among lights."""
        return 4 if len(scene.lights) == 1 else 5

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        if hit.p.shape[1] == 0:
            return Reflected(np.zeros((3, 0)), 0)
        techniques = supporting_techniques(scene, *self.preferred)
        by_light = self._light(scene, plan, hit, u[2:], techniques)
        if scene.lights.delta.all():
            return by_light
        return by_light + self._brdf(scene, plan, hit, u[:2], techniques)

    def _light(
        self,
        scene: RenderScene,
        plan: RenderPlan,
        hit: SurfaceHit,
        u: Floats,
        techniques: list[DirectionSampler],
    ) -> Reflected:
        light, u = choose_light(scene, u)
        sample = sample_light(scene, techniques, hit, light, u)
        f, cosine = bsdf_value(scene, hit, sample.wi), abs_cosine(hit, sample.wi)
        other = bsdf_pdf(scene, hit, sample.wi)
        if scene.lights.delta.any():
            other = np.where(scene.lights.delta.take(light), 0.0, other)  # the BRDF's samples never meet it
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            own = sample.pdf * light_pmf(scene, light)
            weight = self._weight(own, other) * cosine / own
            radiance = f * (sample.radiance * weight)
        seen = Seen(light, sample.wi, sample.dist, sample.normal)
        return visible(scene, plan, hit, seen, sample.valid & f.any(axis=0), radiance)

    def _brdf(
        self,
        scene: RenderScene,
        plan: RenderPlan,
        hit: SurfaceHit,
        u: Floats,
        techniques: list[DirectionSampler],
    ) -> Reflected:
        sample = sample_bsdf(scene, hit, u)
        met = seen, _, useful = lights_met(scene, hit, sample)
        other = light_pdf(scene, techniques, hit, np.where(useful, seen.light, -1), sample.wi)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            weight = self._weight(sample.pdf, other)
        return scattered(scene, plan, hit, sample, met, weight)

    def _weight(self, own: Floats, other: Floats) -> Floats:
        """own^b / (own^b + other^b), by the ratio, so that neither power overflows."""
        ratio = other / own
        return 1.0 / (1.0 + (ratio if self.power == 1 else ratio * ratio))


ESTIMATORS.add("mis", MultipleImportance("mis", "light and BRDF samples, power heuristic", 2))
ESTIMATORS.add(
    "mis-balance", MultipleImportance("mis-balance", "light and BRDF samples, balance heuristic", 1)
)
COMPENSATED = "light and BRDF samples, the environment's brighter part"
# The balance heuristic is what compensation was derived for.
ESTIMATORS.add(
    "mis-compensated",
    MultipleImportance("mis-compensated", COMPENSATED, 1, ("environment-compensated", *BEST)),
)
