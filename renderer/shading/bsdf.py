"""BSDFs of a scene's points, whatever their materials: values, sampled directions, densities.

Light that leaves along wo is the integral of f(wo, wi) Li(wi) |cos| over all wi. `bsdf_value` is 0 on a side
to which a surface scatters nothing, so that no estimator asks for the sign of the cosine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from renderer.build import RenderScene
from renderer.interfaces.material import DeltaLobeSampler, MaterialKind
from renderer.math.vectors import Floats, dot
from renderer.records import BSDFSample, SurfaceHit


def bsdf_value(scene: RenderScene, hit: SurfaceHit, wi: Floats) -> Floats:
    """f(wo, wi) (3, n) in 1/sr without delta lobes; 0 where nothing is scattered."""
    hit = hit.of_one_material()
    if len(scene.materials) == 1:
        return scene.materials[0].evaluate(hit, wi)
    out = np.zeros_like(wi)
    for kind, rows in scene.rows_of_materials(hit.shape):
        out[:, rows] = kind.evaluate(hit.take(rows), wi.take(rows, axis=1))
    return out


def abs_cosine(hit: SurfaceHit, wi: Floats) -> Floats:
    """|cos| (n,) of wi (3, n) with the shading normal, by which `bsdf_value` is multiplied."""
    return np.abs(dot(wi, hit.ns))


def sample_bsdf(scene: RenderScene, hit: SurfaceHit, u: Floats) -> BSDFSample:
    """Directions drawn by the material of each point; pdf 0 for those of delta lobes. u: (2, n) in [0, 1).

    `renderer.shading.delta_lobes` adds the light of delta lobes to every estimate.
    """
    sample = _sample(scene, hit, u, _all_lobes)
    if sample.specular is None:
        return sample
    return replace(sample, pdf=np.where(sample.specular, 0.0, sample.pdf))


def sample_delta_lobes(scene: RenderScene, hit: SurfaceHit, u: Floats) -> BSDFSample:
    """Directions of delta lobes, drawn as by `sample_bsdf`; pdf 0 for all others."""
    sample = _sample(scene, hit, u, _delta_lobes)
    specular = False if sample.specular is None else sample.specular
    return replace(sample, pdf=np.where(specular, sample.pdf, 0.0))


def _all_lobes(kind: MaterialKind, hit: SurfaceHit, u: Floats) -> BSDFSample:
    return kind.sample(hit, u)


def _delta_lobes(kind: MaterialKind, hit: SurfaceHit, u: Floats) -> BSDFSample:
    return kind.sample_delta_lobes(hit, u) if isinstance(kind, DeltaLobeSampler) else kind.sample(hit, u)


def _sample(
    scene: RenderScene,
    hit: SurfaceHit,
    u: Floats,
    draw: Callable[[MaterialKind, SurfaceHit, Floats], BSDFSample],
) -> BSDFSample:
    """Directions that `draw` takes from the kind of material of each point."""
    hit = hit.of_one_material()
    if len(scene.materials) == 1:
        return draw(scene.materials[0], hit, u)
    wi, value, pdf = np.zeros_like(hit.p), np.zeros_like(hit.p), np.zeros_like(u[0])
    specular = np.zeros_like(u[0], dtype=np.bool_) if scene.specular else None
    for kind, rows in scene.rows_of_materials(hit.shape):
        part = draw(kind, hit.take(rows), u.take(rows, axis=1))
        wi[:, rows], value[:, rows], pdf[rows] = part.wi, part.value, part.pdf
        if specular is not None and part.specular is not None:
            specular[rows] = part.specular
    return BSDFSample(wi, value, pdf, specular)


def bsdf_pdf(scene: RenderScene, hit: SurfaceHit, wi: Floats) -> Floats:
    """Density (n,) in 1/sr of `sample_bsdf` along wi (3, n)."""
    hit = hit.of_one_material()
    if len(scene.materials) == 1:
        return scene.materials[0].pdf(hit, wi)
    out = np.zeros(wi.shape[1])
    for kind, rows in scene.rows_of_materials(hit.shape):
        out[rows] = kind.pdf(hit.take(rows), wi.take(rows, axis=1))
    return out
