"""`analytic-visibility`: unshadowed light in closed form times the visible share of it, so that only shadows
are noisy.

The ratio form [heitz2018] multiplies the closed form A of a pixel by S/U: the pixel's shadowed samples S over
the same samples without shadows U. A ratio of means is consistent, with a bias of O(1/spp). The control
variate A + (S - U) has no bias and is as free of noise where nothing blocks the light, but is noisier than
the ratio in the umbra.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from renderer.build import RenderScene
from renderer.estimators.mis import BEST
from renderer.interfaces.estimator import ESTIMATORS, Estimator, Reflected
from renderer.interfaces.light import LIGHTS
from renderer.interfaces.material import LAMBERTIAN, lobes_of
from renderer.math.vectors import Floats
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from renderer.shading.bsdf import abs_cosine, bsdf_value
from renderer.shading.lights import choose_light, light_pmf, sample_light, supporting_techniques
from renderer.shading.visibility import Seen, visible
from scenes.description.scene import SceneDescription

BLOCK = 8  # lights whose closed forms are worked out at once: bounds the temporaries


@dataclass(frozen=True)
class AnalyticVisibility(Estimator):
    """One light sample, and the closed forms of all lights."""

    closed_form: bool = field(default=True, kw_only=True)

    def refuses(self, scene: SceneDescription) -> str | None:
        """The reason against surfaces that are not diffuse and lights without a closed form, else None."""
        if any(lobes_of(s) & ~LAMBERTIAN for s in scene.shapes):
            return "closed forms hold for diffuse surfaces only, and it has others"
        if not all(light.has_closed_form for light in scene.lights):
            return "an environment's image and a portal have no closed form"
        if any(s.emission is not None and s.emission.image is not None for s in scene.shapes):
            return "a light with an image has no closed form"
        for _, kind in LIGHTS.items():
            if not kind.closed_form and any(kind.accepts(s) for s in scene.shapes):
                return f"{kind.plural} that emit have no closed form"
        return None

    def dimensions(self, scene: RenderScene) -> int:
        """Two for the direction, one more to choose among lights."""
        return 2 if len(scene.lights) == 1 else 3

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        n = hit.p.shape[1]
        if n == 0:
            return Reflected(np.zeros((3, 0)), 0)
        light, u = choose_light(scene, u)
        sample = sample_light(scene, supporting_techniques(scene, *BEST), hit, light, u)
        f = bsdf_value(scene, hit, sample.wi)
        useful = sample.valid & f.any(axis=0)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            weight = abs_cosine(hit, sample.wi) / (sample.pdf * light_pmf(scene, light))
            radiance = np.where(useful, f * (sample.radiance * weight), 0.0)
        seen = visible(scene, plan, hit, Seen(light, sample.wi, sample.dist, sample.normal), useful, radiance)
        closed = bsdf_value(scene, hit, hit.ns) * irradiance(scene, hit)
        if self.ratio:
            return Reflected(seen.radiance, seen.shadow_rays, (closed, radiance))
        return Reflected(closed + (seen.radiance - radiance), seen.shadow_rays)


def irradiance(scene: RenderScene, hit: SurfaceHit) -> Floats:
    """Unshadowed irradiance (3, n) of all lights together. Every light must have a closed form."""
    n = hit.p.shape[1]
    total = np.zeros((3, n))
    for kind in scene.lights.kinds:
        for first in range(0, kind.parts.source.size, BLOCK):
            some = np.arange(first, min(first + BLOCK, kind.parts.source.size))
            p, normal = (np.tile(v, (1, some.size)) for v in (hit.p, hit.ns))
            part = kind.irradiance(some.repeat(n), p, normal)
            assert part is not None, "refuses() lets only lights with closed forms through"
            by_light = np.broadcast_to(part, p.shape).reshape(3, some.size, n)
            for j in range(some.size):
                total += by_light[:, j]
    return total


ESTIMATORS.add(
    "analytic-visibility",
    AnalyticVisibility(
        "analytic-visibility",
        "closed form times sampled visibility",
        ratio=True,
        bias="a ratio of means: consistent, with a bias that falls as 1/spp",
    ),
)
ESTIMATORS.add(
    "analytic-visibility-unbiased",
    AnalyticVisibility("analytic-visibility-unbiased", "closed form as a control variate"),
)
