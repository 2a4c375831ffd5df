"""Directions that receivers choose, and the light that they meet."""

from __future__ import annotations

import numpy as np

from renderer.build import RenderScene
from renderer.interfaces.estimator import Reflected
from renderer.math.vectors import Floats
from renderer.plan.plan import RenderPlan
from renderer.records import BSDFSample, SurfaceHit
from renderer.shading.bsdf import abs_cosine
from renderer.shading.lights import light_along
from renderer.shading.visibility import Seen, visible
from scenes.arrays import Mask


def lights_met(scene: RenderScene, hit: SurfaceHit, sample: BSDFSample) -> tuple[Seen, Floats, Mask]:
    """Radiance (3, n) of the light along each sample, and whether any of it may be scattered (n,)."""
    seen, le = light_along(scene, hit, sample.wi)
    useful = (seen.light >= 0) & (sample.pdf > 0) & le.any(axis=0) & sample.value.any(axis=0)
    return seen, le, useful


def scattered(
    scene: RenderScene,
    plan: RenderPlan,
    hit: SurfaceHit,
    sample: BSDFSample,
    met: tuple[Seen, Floats, Mask],
    weight: Floats | float = 1.0,
) -> Reflected:
    """f Le |cos| V / pdf of the lights `met` along the samples, times a weight (n,)."""
    seen, le, useful = met
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        radiance = sample.value * (le * (weight * abs_cosine(hit, sample.wi) / sample.pdf))
    return visible(scene, plan, hit, seen, useful, radiance)
