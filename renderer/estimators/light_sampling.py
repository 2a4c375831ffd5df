"""The light sampled by one technique: Lo = f(wo, wi) Le cos V / (pmf(light) pdf(wi)), one light a sample
[pharr2023, sec. 13.2].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.build import RenderScene
from renderer.interfaces.estimator import RADIANCE, Reflected
from renderer.math.vectors import Floats
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from renderer.shading.bsdf import abs_cosine, bsdf_value
from renderer.shading.lights import chance, choose_light, sample_light, samplers, without
from renderer.shading.visibility import Seen, visible
from scenes.description.scene import SceneDescription


@dataclass(frozen=True)
class LightSampling:
    """An estimator for each technique that lights may have."""

    name: str
    title: str
    quantity: str = RADIANCE
    bias: str | None = None
    ratio: bool = False
    one_sided: bool = False  # whether the technique goes to the side of the normals alone

    def refuses(self, scene: SceneDescription) -> str | None:
        """The first light that lacks the technique, in words."""
        return without(self.name, scene, self.one_sided)

    def dimensions(self, scene: RenderScene) -> int:
        """Two for the direction, one more to choose among lights."""
        return 2 if len(scene.lights) == 1 else 3

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        """See `Estimator`."""
        return by_light(scene, plan, hit, u, self.name)


def by_light(scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats, *preferred: str) -> Reflected:
    """One light sample a row, by the first of the preferred techniques that each light has. u: as
    `choose_light` takes it.
    """
    if hit.p.shape[1] == 0:
        return Reflected(np.zeros((3, 0)), 0)
    light, u = choose_light(scene, u)
    sample = sample_light(scene, samplers(scene, *preferred), hit, light, u)
    f = bsdf_value(scene, hit, sample.wi)
    useful = sample.valid & f.any(axis=0) if plan.horizon else sample.valid
    # Rows that are not valid may hold anything, and are zeroed.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        weight = abs_cosine(hit, sample.wi) / (sample.pdf * chance(scene, light))
        radiance = f * (sample.radiance * weight)
    return visible(scene, plan, hit, Seen(light, sample.wi, sample.dist, sample.normal), useful, radiance)
