"""The hemisphere form: a direction by some rule of the receiver's own, and the light that it happens to meet.

Lo = f(wo, wi) Le(wi) cos V / pdf(wi). The pdf knows nothing of the lights, so that no distance is divided by: however
near a light comes, the weights stay bounded. What it costs is that a small light is seldom met [pharr2023, sec. 13.2].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from renderer.arrays import Floats, combine, dot, frame_about
from renderer.build import RenderScene
from renderer.estimators.protocol import Reflected
from renderer.estimators.shading import hidden, light_along, scatter
from renderer.plan import RenderPlan
from renderer.records import SurfaceHit
from renderer.warp import cosine_hemisphere, uniform_hemisphere
from scenes.description import SceneDescription

# (scene, hit, u (2, n)) -> wi (3, n), pdf (n,) in 1/sr
Rule = Callable[[RenderScene, SurfaceHit, Floats], tuple[Floats, Floats]]


@dataclass(frozen=True)
class DirectionSampling:
    """An estimator for each rule by which a receiver may choose directions."""

    name: str
    title: str
    rule: Rule

    def refuses(self, scene: SceneDescription) -> str | None:
        """None: every light that has an area can be met by chance."""
        return None

    def dimensions(self, scene: RenderScene) -> int:
        """Two for the direction."""
        return 2

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        """See `Estimator`."""
        if hit.p.shape[1] == 0:
            return Reflected(np.zeros((3, 0)), 0)
        wi, pdf = self.rule(scene, hit, u)
        seen, le = light_along(scene, hit, wi)
        light = seen.light
        cosine = dot(wi, hit.n)
        useful = (light >= 0) & (cosine > 0) & le.any(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            radiance = np.where(useful, scatter(scene, hit, wi) * (le * (cosine / pdf)), 0.0)
        rows = np.flatnonzero(useful & plan.shadow[np.maximum(hit.shape, 0), np.maximum(light, 0)])
        if rows.size:
            radiance[:, rows[hidden(scene, plan, hit, seen, rows)]] = 0.0
        return Reflected(radiance, rows.size)


def uniform(scene: RenderScene, hit: SurfaceHit, u: Floats) -> tuple[Floats, Floats]:
    """Every direction alike: pdf 1/(2 pi)."""
    return combine(frame_about(hit.n), *uniform_hemisphere(u)), np.full_like(u[0], 1 / (2 * np.pi))


def cosine(scene: RenderScene, hit: SurfaceHit, u: Floats) -> tuple[Floats, Floats]:
    """As the cosine: pdf cos / pi."""
    local = cosine_hemisphere(u)
    pdf: Floats = local[2] / np.pi
    return combine(frame_about(hit.n), *local), pdf


def brdf(scene: RenderScene, hit: SurfaceHit, u: Floats) -> tuple[Floats, Floats]:
    """As the material of each point would have it."""
    wi, pdf = np.zeros_like(hit.p), np.zeros(u.shape[1])
    for kind, rows in scene.rows_of_materials(hit.shape):
        part = (v.take(rows, axis=1) for v in (hit.n, hit.wo, u))
        wi[:, rows], pdf[rows] = kind.sample(hit.shape[rows], *part)
    return wi, pdf
