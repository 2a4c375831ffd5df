"""Surfaces that Mitsuba's shadow rays overlook: the rays end 9e-4 of their length before the light.

Measured: lights 0.001 above the roof of a closed box light its inside as if there were no roof.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenes.description.shapes import Array

EARLY = 9e-4  # of a shadow ray's length: Mitsuba's ShadowEpsilon, ten times its RayEpsilon
ROUNDING = 1e-6  # of the scene: what lies nearer to a plane than that lies in it


def overlooked(light: Array, faces: Sequence[Array], points: Array) -> float | None:
    """Distance from a light to a face that shades something and that shadow rays overlook; None without one.

    light: (m, 3) points of the light. faces: (t, 3, 3) of every other shape. points: (n, 3) of all other
    shapes. A face near the light shades nothing if all points lie on the side of its plane that the light is
    on, as a ceiling's do around a light on it.
    """
    reach = float(
        np.linalg.norm(points - light.mean(axis=0), axis=1).max(initial=0.0) + np.ptp(light, axis=0).max()
    )
    short = EARLY * reach
    low, high = light.min(axis=0) - short, light.max(axis=0) + short
    for shape in faces:
        near = shape[np.all((shape.min(axis=1) <= high) & (shape.max(axis=1) >= low), axis=1)]
        normal = np.cross(near[:, 1] - near[:, 0], near[:, 2] - near[:, 0])
        length = np.linalg.norm(normal, axis=1)
        for corner, n in zip(near[length > 0, 0], normal[length > 0] / length[length > 0, None], strict=True):
            height = np.einsum("mc,c->m", light - corner, n)
            distance = float(np.abs(height).min())
            side = np.sign(height[np.abs(height).argmax()])
            beyond = np.einsum("nc,c->n", points - corner, n) * side < -ROUNDING * reach
            if distance < short and beyond.any():
                return distance
    return None
