"""The hemisphere form: the receiver chooses a direction by a rule of its own and takes the light that it
meets there.

Lo = f(wo, wi) Le(wi) cos V / pdf(wi). The pdf ignores the lights, and no distance divides: weights stay
bounded however near a light comes. The price is that a small light is seldom met [pharr2023, sec. 13.2]. A
light that sends one direction only is never met, and gets one light sample of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from renderer.build import RenderScene
from renderer.interfaces.estimator import ESTIMATORS, Estimator, Reflected
from renderer.math.vectors import Floats, combine, frame_about
from renderer.math.warp import cosine_hemisphere, uniform_hemisphere
from renderer.plan.plan import RenderPlan
from renderer.records import BSDFSample, SurfaceHit
from renderer.shading.bsdf import abs_cosine, bsdf_value, sample_bsdf
from renderer.shading.directions import lights_met, scattered
from renderer.shading.lights import sample_discrete, sample_light, supporting_techniques
from renderer.shading.visibility import Seen, visible
from scenes.arrays import Mask
from scenes.description.scene import SceneDescription

# (scene, hit, u (2, n)) -> a direction a row
Rule = Callable[[RenderScene, SurfaceHit, Floats], BSDFSample]


@dataclass(frozen=True)
class DirectionSampling(Estimator):
    """An estimator for each rule by which a receiver chooses directions."""

    rule: Rule
    meets_lights_by_chance: bool = field(default=True, kw_only=True)

    def refuses(self, scene: SceneDescription) -> str | None:
        """None: lights that no ray meets by chance get a light sample of their own."""
        return None

    def dimensions(self, scene: RenderScene) -> int:
        """Two for the direction; for lights that are never met, one to choose among several and two for a
        direction to one that has an extent.
        """
        several = 1 if np.count_nonzero(scene.lights.delta) > 1 else 0
        return 2 + several + (2 if _has_extent(scene).any() else 0)

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        if hit.p.shape[1] == 0:
            return Reflected(np.zeros((3, 0)), 0)
        fixed = by_delta(scene, plan, hit, u[2:])
        if scene.lights.delta.all():
            return fixed
        sample = self.rule(scene, hit, u[:2])
        met = scattered(scene, plan, hit, sample, lights_met(scene, hit, sample))
        return met + fixed if scene.lights.delta.any() else met


def _has_extent(scene: RenderScene) -> Mask:
    """(K,): lights that have a shape and are yet never met, since their alpha is 0."""
    return scene.lights.delta & (scene.sources.shape[scene.lights.source] >= 0)


def by_delta(scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
    """One sample of one of the lights that no ray meets by chance, all equally likely.

    u: (1, n) to choose a light, (0, n) where there is only one; then two rows for a direction where such a
    light has an extent.
    """
    n = hit.p.shape[1]
    some = np.flatnonzero(scene.lights.delta)
    if some.size == 0:
        return Reflected(np.zeros((3, n)), 0)
    chosen = np.zeros(n, dtype=np.int64)
    if some.size > 1:
        chosen = sample_discrete(np.arange(1.0, some.size + 1), u[0])
    light = some[chosen]
    techniques = supporting_techniques(scene, "solid-angle", "area", "environment")
    inside = u[-2:] if _has_extent(scene).any() else np.zeros((2, n))
    sample = sample_light(scene, techniques, hit, light, inside)
    f, cosine = bsdf_value(scene, hit, sample.wi), abs_cosine(hit, sample.wi)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        radiance = f * (sample.radiance * (cosine * some.size / sample.pdf))
    seen = Seen(light, sample.wi, sample.dist, sample.normal)
    return visible(scene, plan, hit, seen, sample.valid & f.any(axis=0), radiance)


def uniform(scene: RenderScene, hit: SurfaceHit, u: Floats) -> BSDFSample:
    """Uniform directions: pdf 1/(2 pi)."""
    return _about_normals(scene, hit, u, uniform_hemisphere, lambda z: np.full_like(z, 1 / (2 * np.pi)))


def cosine(scene: RenderScene, hit: SurfaceHit, u: Floats) -> BSDFSample:
    """Cosine-weighted directions: pdf cos / pi."""
    return _about_normals(scene, hit, u, cosine_hemisphere, lambda z: z / np.pi)


def _about_normals(
    scene: RenderScene,
    hit: SurfaceHit,
    u: Floats,
    warp: Callable[[Floats], Floats],
    density: Callable[[Floats], Floats],
) -> BSDFSample:
    """Directions in the hemisphere about each normal; where the surface transmits light, in either hemisphere
    with equal probability. density: the pdf from the cosine (n,) of a direction with the axis of its
    hemisphere.
    """
    axis, share = hit.ns, 1.0
    if scene.transmits.any():
        both = scene.transmits[hit.shape]
        under = both & (u[0] < 0.5)
        u = np.where(both & np.array([[True], [False]]), 2 * u % 1.0, u)
        axis, share = np.where(under, -axis, axis), np.where(both, 0.5, 1.0)
    local = warp(u)
    wi = combine(frame_about(axis), *local)
    return BSDFSample(wi, bsdf_value(scene, hit, wi), share * density(local[2]))


ESTIMATORS.add("bsdf", DirectionSampling("bsdf", "proportional to the BRDF", sample_bsdf))
ESTIMATORS.add("cosine", DirectionSampling("cosine", "proportional to the cosine", cosine))
ESTIMATORS.add("hemisphere", DirectionSampling("hemisphere", "uniform over the hemisphere", uniform))
