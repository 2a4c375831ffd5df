"""Lights as estimators use them: the choice of one, directions to it, their density, and the light along a
direction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from renderer.build import RenderScene
from renderer.interfaces.light import LIGHTS, DirectionSampler, Source
from renderer.interfaces.material import Lobes, lobes_of
from renderer.light_sampling.coincident import Coincident
from renderer.math.vectors import Floats, dot, gather
from renderer.records import LightSample, SurfaceHit
from renderer.shading.emission import with_emission_images
from renderer.shading.visibility import Seen
from scenes.arrays import Index
from scenes.description.scene import SceneDescription


def sources_of(scene: SceneDescription) -> list[Source]:
    """All sources of light of a scene."""
    return [*(s for s in scene.shapes if s.emission is not None), *scene.lights]


def missing_technique(technique: str, scene: SceneDescription, one_sided: bool = False) -> str | None:
    """The reason why the technique does not serve the scene's lights and surfaces, in words; None where it
    does.

    one_sided: whether the technique goes to the side of the normals alone.
    """
    if one_sided and any(lobes_of(s) & Lobes.TRANSMISSION for s in scene.shapes):
        return f"{technique} sampling takes light on one side of a surface, and some surfaces transmit light"
    for source in sources_of(scene):
        for _, kind in LIGHTS.items():
            if kind.accepts(source) and (why := kind.missing(technique)):
                return why
    return None


def supporting_techniques(scene: RenderScene, *preferred: str) -> list[DirectionSampler]:
    """For each kind of light the first of the preferred techniques that it has. Every kind must have one."""
    out: list[DirectionSampler] = []
    for kind in scene.lights.kinds:
        own = kind.techniques
        out.append(next(own[name] for name in preferred if name in own))
    return out


def choose_light(scene: RenderScene, u: Floats) -> tuple[Index, Floats]:
    """A light (n,) for each row, and the numbers (2, n) left for its direction.

    u: (2, n) for a scene with one light, (3, n) for more. The third row chooses, so that directions keep a
    pair of dimensions that samplers stratify together.
    """
    if len(scene.lights) == 1:
        return np.zeros_like(u[0], dtype=np.int64), u[:2]
    return sample_discrete(scene.lights.cdf, u[2]), u[:2]


def sample_discrete(cdf: Floats, u: Floats) -> Index:
    """The entry (n,) that each u (n,) falls on. cdf: (k,), the running sum of weights. An entry without
    weight is never picked.
    """
    last = int(np.argmax(cdf == cdf[-1]))
    entry = np.array(np.searchsorted(cdf, u * cdf[-1], side="right"), dtype=np.int64)
    return np.minimum(entry, last)


def sample_light(
    scene: RenderScene, techniques: Sequence[DirectionSampler], hit: SurfaceHit, light: Index, u: Floats
) -> LightSample:
    """A direction to the light of each row. techniques: one for each kind. light: (n,). u: (2, n). The pdf is
    that of the direction alone.
    """
    sample = _sampled(scene, techniques, hit, light, u)
    if not scene.emission_images:
        return sample
    with np.errstate(invalid="ignore"):  # rows that are not valid may hold anything
        p = hit.p + sample.wi * sample.dist
        return replace(
            sample,
            radiance=with_emission_images(scene, sample.radiance, scene.lights.primitive.take(light), p),
        )


def _sampled(
    scene: RenderScene, techniques: Sequence[DirectionSampler], hit: SurfaceHit, light: Index, u: Floats
) -> LightSample:
    if len(techniques) == 1:
        return techniques[0].sample_direction(light, hit.p, hit.ns, u)
    n = light.size
    wi, dist, facing, radiance = np.zeros((3, n)), np.zeros(n), np.zeros((3, n)), np.zeros((3, n))
    pdf, valid = np.ones(n), np.zeros(n, dtype=np.bool_)
    for first, rows, technique in _rows_by_kind(scene, techniques, light):
        p, normal = hit.p.take(rows, axis=1), hit.ns.take(rows, axis=1)
        part = technique.sample_direction(light[rows] - first, p, normal, u.take(rows, axis=1))
        wi[:, rows], dist[rows], facing[:, rows] = part.wi, part.dist, part.normal
        radiance[:, rows] = part.radiance
        pdf[rows], valid[rows] = part.pdf, part.valid
    return LightSample(wi, dist, facing, radiance, pdf, valid)


def light_pdf(
    scene: RenderScene, techniques: Sequence[DirectionSampler], hit: SurfaceHit, light: Index, wi: Floats
) -> Floats:
    """Density (n,) in 1/sr with which light sampling chooses the light (n,) and goes along wi (3, n); 0 where
    light is -1.
    """
    pdf = np.zeros(light.size)
    for first, rows, technique in _rows_by_kind(scene, techniques, light):
        p, normal = hit.p.take(rows, axis=1), hit.ns.take(rows, axis=1)
        own = technique.pdf_direction(light[rows] - first, p, normal, wi.take(rows, axis=1))
        pdf[rows] = own * scene.lights.pmf.take(light[rows])
    return pdf


def _rows_by_kind(
    scene: RenderScene, techniques: Sequence[DirectionSampler], light: Index
) -> Iterator[tuple[int, Index, DirectionSampler]]:
    """Each kind's first light, the rows that go to it, and its technique."""
    first = 0
    for kind, technique in zip(scene.lights.kinds, techniques, strict=True):
        count = kind.parts.source.size
        rows = np.flatnonzero((light >= first) & (light < first + count))
        if rows.size:
            yield first, rows, technique
        first += count


def light_pmf(scene: RenderScene, light: Index) -> Floats:
    """(n,) or (1,): the probability with which `choose_light` picks each light (n,)."""
    return gather(scene.lights.pmf, light)


def light_along(scene: RenderScene, hit: SurfaceHit, wi: Floats) -> tuple[Seen, Floats]:
    """The light (n,) that each point would see along wi (3, n) if lights alone were there, and its Le (3, n).

    The light is -1 and its distance inf where there is none. An environment lies behind all others.
    """
    everyone = scene.lights.primitive[(scene.lights.primitive >= 0) & ~scene.lights.delta]
    coincident, leaves = scene.lights.coincident, hit.primitive
    if coincident is not None and everyone.size:
        everyone, leaves = _one_each(scene, coincident, everyone, leaves)
    t, primitive = scene.analytic.closest(everyone, hit.p, wi, leaves)
    light = (
        np.where(primitive >= 0, scene.lights.of_primitive.take(primitive, mode="clip"), -1)
        if everyone.size
        else primitive.copy()
    )
    radiance, normal = np.zeros_like(wi), -wi
    met = np.flatnonzero(primitive >= 0)
    if met.size:
        own, along = primitive[met], wi.take(met, axis=1)
        _, normal[:, met] = scene.analytic.surface(own, hit.p.take(met, axis=1) + along * t[met])
    if scene.emissive_triangles is not None:
        far, triangle = scene.emissive_triangles.closest_from(hit.p, hit.normal_towards(wi), hit.triangle, wi)
        nearer = np.flatnonzero(far < t)
        t[nearer], light[nearer] = far[nearer], scene.lights.of_triangle[triangle[nearer]]
        primitive[nearer] = -1
        normal[:, nearer] = scene.emissive_triangles.normal.take(triangle[nearer], axis=1)
    rows = np.flatnonzero(light >= 0)
    if rows.size:
        along = wi.take(rows, axis=1)
        cosine = dot(along, normal.take(rows, axis=1))
        if coincident is None:
            le = _emitted(scene, light[rows], cosine)
        else:
            light[rows], le = coincident.seen(light[rows], cosine)
        radiance[:, rows] = with_emission_images(
            scene, le, primitive[rows], hit.p.take(rows, axis=1) + along * t[rows]
        )
    if scene.lights.environment is not None:
        kind, own = scene.lights.environment
        rows = np.flatnonzero(light < 0)
        light[rows] = own
        radiance[:, rows] = kind.radiance_along(
            np.zeros_like(rows), hit.p.take(rows, axis=1), wi.take(rows, axis=1)
        )
    return Seen(light, wi, t, normal), radiance


def _one_each(
    scene: RenderScene, coincident: Coincident, everyone: Index, leaves: Index
) -> tuple[Index, Index]:
    """The primitives among `everyone`, and those that rays leave (n,), with the first of each place for all
    that coincide.
    """
    lights = scene.lights
    of = np.where(leaves >= 0, lights.of_primitive[leaves], -1)
    first = np.where(of >= 0, lights.primitive[coincident.first[of]], leaves)
    own = lights.of_primitive[everyone]
    return everyone[coincident.first[own] == own], first


def _emitted(scene: RenderScene, light: Index, cosine: Floats) -> Floats:
    """Le (3, n) of area lights (n,) seen along directions that make `cosine` (n,) with their normals."""
    shape = scene.sources.shape[scene.lights.source[light]]
    return np.where((cosine < 0) | scene.two_sided[shape], scene.emission.take(shape, axis=1), 0.0)
