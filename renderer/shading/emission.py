"""Radiance of lights at a point of their surface, with the image that some carry."""

from __future__ import annotations

import numpy as np

from renderer.build import RenderScene
from renderer.math.vectors import Floats
from renderer.textures import bilinear
from scenes.arrays import Index


def with_emission_images(scene: RenderScene, radiance: Floats, primitive: Index, p: Floats) -> Floats:
    """Radiance (3, n) or (3, 1) times the images of primitives (n,), -1 for none, at points p (3, n).

    As in pbrt the look-up is bilinear and clamped at the edges, with the first row at v = 1 [pharr2023, sec.
    12.4].
    """
    coordinates = scene.coordinates
    if coordinates is None or not scene.emission_images:
        return radiance
    shape = np.where(primitive >= 0, scene.analytic.shape[primitive], -1)
    out = np.broadcast_to(radiance, p.shape).copy()
    for own, image in scene.emission_images:
        rows = np.flatnonzero(shape == own)
        if rows.size:
            u, v = coordinates.at(p.take(rows, axis=1), np.full_like(rows, -1), primitive[rows])
            out[:, rows] *= bilinear(image, np.stack([u, 1.0 - v]), "clamp")
    return out
