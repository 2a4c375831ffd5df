"""One light sample by one technique: Lo = f(wo, wi) Le cos V / (pmf(light) pdf(wi)) [pharr2023,
sec. 13.2].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.build import RenderScene
from renderer.interfaces.estimator import ESTIMATORS, Estimator, Reflected
from renderer.math.vectors import Floats
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from renderer.shading.bsdf import abs_cosine, bsdf_value
from renderer.shading.lights import (
    choose_light,
    light_pmf,
    missing_technique,
    sample_light,
    supporting_techniques,
)
from renderer.shading.visibility import Seen, visible
from scenes.description.scene import SceneDescription


@dataclass(frozen=True)
class LightSampling(Estimator):
    """An estimator for each technique that lights may have."""

    one_sided: bool = False  # whether the technique goes to the side of the normals alone

    def refuses(self, scene: SceneDescription) -> str | None:
        """The first light that lacks the technique, in words; None where all have it."""
        return missing_technique(self.name, scene, self.one_sided)

    def dimensions(self, scene: RenderScene) -> int:
        """Two for the direction, one more to choose among lights."""
        return 2 if len(scene.lights) == 1 else 3

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        return by_light(scene, plan, hit, u, self.name)


def by_light(scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats, *preferred: str) -> Reflected:
    """One light sample a row, by the first of the preferred techniques that each light has. u: as for
    `choose_light`.
    """
    if hit.p.shape[1] == 0:
        return Reflected(np.zeros((3, 0)), 0)
    light, u = choose_light(scene, u)
    sample = sample_light(scene, supporting_techniques(scene, *preferred), hit, light, u)
    f = bsdf_value(scene, hit, sample.wi)
    useful = sample.valid & f.any(axis=0) if plan.horizon else sample.valid
    # Rows that are not valid may hold anything, and are zeroed.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        weight = abs_cosine(hit, sample.wi) / (sample.pdf * light_pmf(scene, light))
        radiance = f * (sample.radiance * weight)
    return visible(scene, plan, hit, Seen(light, sample.wi, sample.dist, sample.normal), useful, radiance)


# The area form's cos cos' / d^2 is unbounded where d may go to 0.
ESTIMATORS.add("area", LightSampling("area", "uniform over the light's surface", bounded=False))
# The pdf carries the 1/d^2.
ESTIMATORS.add("solid-angle", LightSampling("solid-angle", "uniform in the light's solid angle"))
# Unshadowed diffuse surfaces have no noise under polygonal lights.
ESTIMATORS.add(
    "projected-solid-angle",
    LightSampling("projected-solid-angle", "proportional to the cosine over the light", one_sided=True),
)
