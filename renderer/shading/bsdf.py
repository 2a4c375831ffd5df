"""What estimators ask of the materials: BRDF values, directions as the BRDF would have them, and their
density.
"""

from __future__ import annotations

import numpy as np

from renderer.build import RenderScene
from renderer.math.vectors import Floats
from renderer.records import SurfaceHit


def scatter(scene: RenderScene, hit: SurfaceHit, wi: Floats) -> Floats:
    """BRDF values (3, n) or (3, 1), in 1/sr."""
    if len(scene.materials) == 1:
        return scene.materials[0].evaluate(hit, wi)
    out = np.zeros_like(wi)
    for kind, rows in scene.rows_of_materials(hit.shape):
        out[:, rows] = kind.evaluate(hit.take(rows), wi.take(rows, axis=1))
    return out


def sample_material(scene: RenderScene, hit: SurfaceHit, u: Floats) -> tuple[Floats, Floats]:
    """Directions wi (3, n) as the material of each point would have them, and their pdf (n,) in 1/sr. u: (2,
    n).
    """
    if len(scene.materials) == 1:
        return scene.materials[0].sample(hit, u)
    wi, pdf = np.zeros_like(hit.p), np.zeros(u.shape[1])
    for kind, rows in scene.rows_of_materials(hit.shape):
        wi[:, rows], pdf[rows] = kind.sample(hit.take(rows), u.take(rows, axis=1))
    return wi, pdf


def material_pdf(scene: RenderScene, hit: SurfaceHit, wi: Floats) -> Floats:
    """Density (n,) in 1/sr with which `sample_material` goes along wi (3, n)."""
    if len(scene.materials) == 1:
        return scene.materials[0].pdf(hit, wi)
    out = np.zeros(wi.shape[1])
    for kind, rows in scene.rows_of_materials(hit.shape):
        out[rows] = kind.pdf(hit.take(rows), wi.take(rows, axis=1))
    return out
