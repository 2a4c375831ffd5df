"""Direct light by sampling a light: pick one, pick a direction to it by some technique, ask whether it is seen.

Lo = f(wo, wi) Le(wi) |cos| V / (pdf(wi) / K), the light picked uniformly among K [pharr2023, sec. 13.4].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.arrays import Floats, dot
from renderer.build import RenderScene
from renderer.estimators.protocol import Reflected
from renderer.estimators.shading import Seen, choose_light, hidden, sample_light, scatter, without
from renderer.plan import RenderPlan
from renderer.records import SurfaceHit
from scenes.description import SceneDescription


@dataclass(frozen=True)
class LightSampling:
    """An estimator for each technique that lights may have."""

    name: str
    title: str

    def refuses(self, scene: SceneDescription) -> str | None:
        """The first light that lacks the technique, in words."""
        return without(self.name, scene)

    def dimensions(self, scene: RenderScene) -> int:
        """Two for the direction, one more to choose among lights."""
        return 2 if scene.light_shape.size == 1 else 3

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        """See `Estimator`."""
        if hit.p.shape[1] == 0:
            return Reflected(np.zeros((3, 0)), 0)
        samplers = [kind.techniques[self.name] for kind in scene.lights]
        light, u = choose_light(scene, u)
        sample = sample_light(scene, samplers, hit, light, u)
        cosine = dot(sample.wi, hit.n)
        useful = sample.valid & (cosine > 0) if plan.horizon else sample.valid
        # Rows that are not valid may hold anything, and are zeroed.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            weight = cosine * scene.light_shape.size / sample.pdf
            radiance = scatter(scene, hit, sample.wi) * (sample.radiance * weight)
        radiance = np.where(useful, radiance, 0.0)
        rows = np.flatnonzero(useful & plan.shadow[np.maximum(hit.shape, 0), light])
        if rows.size:
            seen = Seen(light, sample.wi, sample.dist, sample.normal)
            radiance[:, rows[hidden(scene, plan, hit, seen, rows)]] = 0.0
        return Reflected(radiance, rows.size)
