"""The hemisphere form: a direction by some rule of the receiver's own, and the light that it happens to meet.

Lo = f(wo, wi) Le(wi) cos V / pdf(wi). The pdf knows nothing of the lights, so that no distance is divided by:
however near a light comes, the weights stay bounded. What it costs is that a small light is seldom met
[pharr2023, sec. 13.2]. A light of one direction is never met by chance: it gets one light sample of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from renderer.build import RenderScene
from renderer.interfaces.estimator import RADIANCE, Reflected
from renderer.math.vectors import Floats, combine, dot, frame_about
from renderer.math.warp import cosine_hemisphere, uniform_hemisphere
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from renderer.shading.bsdf import scatter
from renderer.shading.lights import light_along, pick, sample_light, samplers
from renderer.shading.visibility import Seen, visible
from scenes.description.scene import SceneDescription

# (scene, hit, u (2, n)) -> wi (3, n), pdf (n,) in 1/sr
Rule = Callable[[RenderScene, SurfaceHit, Floats], tuple[Floats, Floats]]


@dataclass(frozen=True)
class DirectionSampling:
    """An estimator for each rule by which a receiver may choose directions."""

    name: str
    title: str
    rule: Rule
    quantity: str = RADIANCE
    bias: str | None = None
    ratio: bool = False

    def refuses(self, scene: SceneDescription) -> str | None:
        """None: whatever cannot be met by chance is sampled."""
        return None

    def dimensions(self, scene: RenderScene) -> int:
        """Two for the direction, one more to choose among several lights of one direction."""
        return 3 if np.count_nonzero(scene.lights.delta) > 1 else 2

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        """See `Estimator`."""
        if hit.p.shape[1] == 0:
            return Reflected(np.zeros((3, 0)), 0)
        fixed = by_delta(scene, plan, hit, u[2:])
        if scene.lights.delta.all():
            return fixed
        wi, pdf = self.rule(scene, hit, u[:2])
        seen, le = light_along(scene, hit, wi)
        cosine = dot(wi, hit.n)
        useful = (seen.light >= 0) & (cosine > 0) & (pdf > 0) & le.any(axis=0)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            radiance = scatter(scene, hit, wi) * (le * (cosine / pdf))
        met = visible(scene, plan, hit, seen, useful, radiance)
        return met + fixed if scene.lights.delta.any() else met


def by_delta(scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
    """One sample of one of the lights that are never met by chance, all equally likely. u: (1, n), (0, n) for
    fewer than two.
    """
    n = hit.p.shape[1]
    some = np.flatnonzero(scene.lights.delta)
    if some.size == 0:
        return Reflected(np.zeros((3, n)), 0)
    chosen = pick(np.arange(1.0, some.size + 1), u[0]) if some.size > 1 else np.zeros(n, dtype=np.int64)
    light = some[chosen]
    nothing = np.zeros((2, n))
    sample = sample_light(scene, samplers(scene, "solid-angle", "area", "environment"), hit, light, nothing)
    cosine = dot(sample.wi, hit.n)
    with np.errstate(invalid="ignore", over="ignore"):
        radiance = scatter(scene, hit, sample.wi) * (sample.radiance * (cosine * some.size))
    seen = Seen(light, sample.wi, sample.dist, sample.normal)
    return visible(scene, plan, hit, seen, sample.valid & (cosine > 0), radiance)


def uniform(scene: RenderScene, hit: SurfaceHit, u: Floats) -> tuple[Floats, Floats]:
    """Every direction alike: pdf 1/(2 pi)."""
    return combine(frame_about(hit.n), *uniform_hemisphere(u)), np.full_like(u[0], 1 / (2 * np.pi))


def cosine(scene: RenderScene, hit: SurfaceHit, u: Floats) -> tuple[Floats, Floats]:
    """As the cosine: pdf cos / pi."""
    local = cosine_hemisphere(u)
    pdf: Floats = local[2] / np.pi
    return combine(frame_about(hit.n), *local), pdf
