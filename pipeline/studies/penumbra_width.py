"""How wide the penumbra of a straight edge is in an image, held against the closed form.

The visible fraction of the light, V, is the image over what the same point would reflect without the sheet
(Lambert's formula). It runs from 0 to 1 across the shadow; the width is the distance on the floor from where
V is 5 % to where it is 95 %. An image gives V at each of its pixels on the floor, noisy; the rising curve
through them is the isotonic least-squares fit [barlow1972].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

from pipeline.references.closed_form.edge_image import floor_points, irradiance, unshadowed
from pipeline.references.closed_form.edge_scene import EdgeScene, analyse_edge
from pipeline.references.closed_form.film import film_plane
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError

Array = NDArray[np.float64]

LEVELS = (0.05, 0.95)
ROUND = 9  # digits: places that differ by less are one row
STEPS = 60  # halvings of an interval that holds a level: down to rounding


@dataclass(frozen=True)
class Width:
    """Scene units on the floor. measured: in the image; exact: of the closed form; similar_triangles: all of
    the penumbra.
    """

    measured: float
    exact: float
    similar_triangles: float
    pixel: float

    @property
    def error(self) -> float:
        """Of the measured width, relative to the exact one."""
        return self.measured / self.exact - 1.0


def width_of(image: Array, scene: SceneDescription) -> Width:
    """The width in an image (h, w, 3) of a scene that `closed-form-edge` takes; PenumbraError where the
    penumbra is not in view.

    `pixel` is how far apart neighbouring rows are on the floor: what is narrower than a few of them is
    measured too wide.
    """
    edge = analyse_edge(scene)
    film = film_plane(scene.camera, scene.film)
    pixels, points = floor_points(edge, film)
    away = -(edge.blocked - edge.blocked @ edge.floor_plane.normal * edge.floor_plane.normal)
    s = (points - edge.edge[0]) @ away
    bare = unshadowed(edge, points) * float((edge.floor.reflectance * edge.radiance).sum()) / np.pi
    visible = image.reshape(-1, 3).sum(axis=1)[pixels] / bare
    rows, curve = _profile(s, visible)
    low, high = (_crossing(rows, curve, level) for level in LEVELS)
    ends = [_exact(edge, points[int(np.argmin(np.abs(s)))], away, level) for level in LEVELS]
    spacing = np.diff(rows)[
        np.abs(rows[1:] - (low + high) / 2) <= max(high - low, float(np.diff(rows).max()))
    ]
    pixel = float(np.median(spacing))
    return Width(high - low, ends[1] - ends[0], _similar(edge, away), pixel)


def _profile(s: Array, visible: Array) -> tuple[Array, Array]:
    """The rising curve through the pixels' values: places (k,), ascending, and values (k,).

    Where the camera stands across the edge, all pixels of a row are at one place: they are averaged first, so
    that a level is not crossed within a row.
    """
    places, row, count = np.unique(np.round(s, ROUND), return_inverse=True, return_counts=True)
    mean = np.bincount(row.reshape(-1), visible, places.size) / count
    fit: Any = isotonic_regression(mean, weights=count.astype(np.float64))
    return places.astype(np.float64), np.asarray(fit.x, dtype=np.float64)


def _crossing(s: Array, curve: Array, level: float) -> float:
    """Where a rising curve first reaches a level, between two of its points."""
    if not curve[0] < level < curve[-1]:
        raise PenumbraError(
            f"the penumbra is not wholly in view: the light is nowhere {level:.0%} visible on the floor"
        )
    after = int(np.argmax(curve >= level))
    share = (level - curve[after - 1]) / (curve[after] - curve[after - 1])
    return float(s[after - 1] + share * (s[after] - s[after - 1]))


def _exact(edge: EdgeScene, point: Array, away: Array, level: float) -> float:
    """Where the closed form's visible fraction is `level` on the line through a point (3,) across the shadow,
    by bisection.
    """
    base = point - (point - edge.edge[0]) @ away * away
    low, high = (sign * _reach(edge, away) for sign in (-1.0, 1.0))
    for _ in range(STEPS):
        middle = (low + high) / 2
        p = (base + middle * away)[None]
        if irradiance(edge, edge.floor_plane, p)[0] < level * unshadowed(edge, p)[0]:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _ends(edge: EdgeScene, away: Array) -> Array:
    """Where on the floor, along `away` from below the edge, each corner of the light is seen right at the
    edge: (v,).
    """
    height = float(edge.floor_plane.height(edge.edge[0]))
    corners = edge.light.outline - edge.edge[0]
    return -(corners @ away) * height / (corners @ edge.floor_plane.normal)


def _similar(edge: EdgeScene, away: Array) -> float:
    return float(np.ptp(_ends(edge, away)))


def _reach(edge: EdgeScene, away: Array) -> float:
    """Beyond the penumbra on either side."""
    return 1.01 * float(np.abs(_ends(edge, away)).max())
