"""What estimators share: picking a light, scattering at the surface, and asking what lies in between."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.arrays import Floats, dot, gather
from renderer.build import RenderScene
from renderer.lights.protocol import LIGHTS, DirectionSampler, LightKind
from renderer.plan import RenderPlan
from renderer.records import LightSample, SurfaceHit
from scenes.description import SceneDescription

Integers = NDArray[np.int64]


def without(technique: str, scene: SceneDescription) -> str | None:
    """Why some light of the scene has no such technique, in words, or None."""
    for shape in scene.shapes:
        for _, kind in LIGHTS.items():
            if kind.accepts(shape) and (why := kind.missing(technique)):
                return why
    return None


def best_technique(kind: LightKind) -> DirectionSampler:
    """The technique with bounded weights where a kind has one."""
    return kind.techniques.get("solid-angle") or kind.techniques["area"]


def scatter(scene: RenderScene, hit: SurfaceHit, wi: Floats) -> Floats:
    """BRDF values (3, n) or (3, 1), in 1/sr."""
    value = scene.materials[0].evaluate(hit.shape, hit.n, hit.wo, wi)
    for kind in scene.materials[1:]:
        value = value + kind.evaluate(hit.shape, hit.n, hit.wo, wi)
    return value


def choose_light(scene: RenderScene, u: Floats) -> tuple[Integers, Floats]:
    """A light (n,) for each row, all equally likely, and the numbers (2, n) left for its direction.

    u: (2, n) for a scene with one light, (3, n) for more; the choice takes the third, so that directions keep a pair of
    dimensions that samplers stratify together.
    """
    lights = scene.light_shape.size
    if lights == 1:
        return np.zeros_like(u[0], dtype=np.int64), u
    choice: Integers = (u[2] * lights).astype(np.int64)
    return np.minimum(choice, lights - 1), u[:2]


def sample_light(
    scene: RenderScene, samplers: list[DirectionSampler], hit: SurfaceHit, light: Integers, u: Floats
) -> LightSample:
    """A direction to the light of each row. samplers: one for each kind. light: (n,). u: (2, n). The pdf is the light's own."""
    if len(samplers) == 1:
        return samplers[0].sample_direction(light, hit.p, hit.n, u)
    n = light.size
    wi, dist, facing, radiance = np.zeros((3, n)), np.zeros(n), np.zeros((3, n)), np.zeros((3, n))
    pdf, valid = np.ones(n), np.zeros(n, dtype=np.bool_)
    for first, rows, sampler in _dealt(scene, samplers, light):
        p, normal = hit.p.take(rows, axis=1), hit.n.take(rows, axis=1)
        part = sampler.sample_direction(light[rows] - first, p, normal, u.take(rows, axis=1))
        wi[:, rows], dist[rows], facing[:, rows] = part.wi, part.dist, part.normal
        radiance[:, rows] = part.radiance
        pdf[rows], valid[rows] = part.pdf, part.valid
    return LightSample(wi, dist, facing, radiance, pdf, valid)


def light_pdf(
    scene: RenderScene, samplers: list[DirectionSampler], hit: SurfaceHit, light: Integers, wi: Floats
) -> Floats:
    """Density (n,) in 1/sr with which `sample_light` would have gone along wi (3, n) to the light (n,); 0 where light is -1."""
    pdf = np.zeros(light.size)
    for first, rows, sampler in _dealt(scene, samplers, light):
        p, normal = hit.p.take(rows, axis=1), hit.n.take(rows, axis=1)
        pdf[rows] = sampler.pdf_direction(light[rows] - first, p, normal, wi.take(rows, axis=1))
    return pdf


def _dealt(
    scene: RenderScene, samplers: list[DirectionSampler], light: Integers
) -> Iterator[tuple[int, Integers, DirectionSampler]]:
    """Each kind's first light, the rows that go to it, and its sampler."""
    first = 0
    for kind, sampler in zip(scene.lights, samplers, strict=True):
        count = kind.shape.size
        rows = np.flatnonzero((light >= first) & (light < first + count))
        if rows.size:
            yield first, rows, sampler
        first += count


@dataclass(frozen=True, eq=False)
class Seen:
    """What a ray wi (3, n) would meet: which light (n,), at what distance (n,), and its normal there (3, n) or (3, 1)."""

    light: Integers
    wi: Floats
    dist: Floats
    normal: Floats


def hidden(scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, seen: Seen, rows: Integers) -> NDArray[np.bool_]:
    """(m,): whether anything of the plan's blockers lies between the points of `rows` (m,) and what they would see."""
    p, n, wi = hit.p.take(rows, axis=1), hit.n.take(rows, axis=1), seen.wi.take(rows, axis=1)
    dist, ny = seen.dist[rows], gather(seen.normal, rows)
    cos_light = dot(wi, ny)
    ny = np.where(cos_light > 0, -ny, ny)  # on the side of p
    out = np.zeros(rows.size, dtype=np.bool_)
    if plan.shadow_triangles is not None:
        out |= plan.shadow_triangles.occluded(p, n, hit.triangle[rows], p + wi * dist, ny)
    if plan.shadow_quadrics.size:
        # What lies within `touch` of the plane of either end counts as part of it, as it does in the plan's proofs.
        with np.errstate(divide="ignore"):
            tmin, tmax = scene.touch / np.abs(dot(wi, n)), dist - scene.touch / np.abs(cos_light)
        own, goal = hit.quadric[rows], scene.light_quadric[seen.light[rows]]
        out |= scene.quadrics.occluded(plan.shadow_quadrics, p, wi, tmin, tmax, own, goal)
    return out


def light_along(scene: RenderScene, hit: SurfaceHit, wi: Floats) -> tuple[Seen, Floats]:
    """The light that each point sees first along wi (3, n) if nothing but lights were there, and its Le (3, n).

    The light is -1 and its distance inf where there is none.
    """
    t, quadric = scene.quadrics.closest(scene.light_quadric, hit.p, wi, hit.quadric)
    met = np.flatnonzero(quadric >= 0)
    light, radiance, normal = np.full_like(quadric, -1), np.zeros_like(wi), np.zeros_like(wi)
    if met.size:
        own, along = quadric[met], wi.take(met, axis=1)
        _, facing = scene.quadrics.surface(own, hit.p.take(met, axis=1) + along * t[met])
        shape = scene.quadrics.shape[own]
        front = (dot(along, facing) < 0) | scene.two_sided[shape]
        light[met], normal[:, met] = scene.quadric_light[own], facing
        radiance[:, met] = np.where(front, scene.emission.take(shape, axis=1), 0.0)
    return Seen(light, wi, t, normal), radiance
