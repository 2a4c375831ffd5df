"""Light that delta lobes scatter, and all reflected light with it.

A delta lobe leaves no choice of direction, so that all estimators of radiance share this part.
"""

from __future__ import annotations

import numpy as np

from renderer.build import RenderScene
from renderer.interfaces.estimator import RADIANCE, Estimator, Reflected
from renderer.interfaces.material import Lobes
from renderer.math.vectors import Floats
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from renderer.shading.bsdf import sample_delta_lobes
from renderer.shading.directions import lights_met, scattered


def dimensions(estimator: Estimator, scene: RenderScene) -> int:
    """The number of random numbers that one sample of `reflected_light` takes."""
    return estimator.dimensions(scene) + (2 if _adds_delta_lobes(estimator, scene) else 0)


def reflected_light(
    estimator: Estimator, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats
) -> Reflected:
    """One sample a row of all light that points reflect: the estimator's, and that of delta lobes.

    u: (dimensions, n) in [0, 1).
    """
    if not _adds_delta_lobes(estimator, scene):
        return estimator.estimate(scene, plan, hit, u)
    return estimator.estimate(scene, plan, hit, u[:-2]) + _specular_light(scene, plan, hit, u[-2:])


def _adds_delta_lobes(estimator: Estimator, scene: RenderScene) -> bool:
    return scene.specular and estimator.quantity == RADIANCE


def _specular_light(scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
    """Light that delta lobes scatter; u (2, n) chooses among the lobes of a point."""
    out = np.zeros_like(hit.p)
    rows = np.flatnonzero(scene.lobes[hit.shape] & Lobes.SPECULAR)
    if rows.size == 0:
        return Reflected(out, 0)
    some = hit.take(rows)
    sample = sample_delta_lobes(scene, some, u.take(rows, axis=1))
    part = scattered(scene, plan, some, sample, lights_met(scene, some, sample))
    out[:, rows] = part.radiance
    return Reflected(out, part.shadow_rays)
