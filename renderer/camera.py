"""The perspective camera, pbrt's: left-handed space, `fov` over the shorter side, pixel (0, 0) at the top
left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats, dot, normalize
from renderer.pixel_filter import offsets
from scenes.description.scene import Film, PerspectiveCamera


@dataclass(frozen=True, eq=False)
class Camera:
    """origin: (3, 1). offsets: from u (2, n) to places (2, n) about a pixel, see `pixel_filter`. corner, du,
    dv: (3, 1), so that a film point (x, y) in pixels is looked at along corner + x du + y dv.
    """

    origin: Floats
    corner: Floats
    du: Floats
    dv: Floats
    width: int
    height: int
    offsets: Callable[[Floats], Floats]

    def rays(self, pixel: NDArray[np.int64], u: Floats) -> Floats:
        """Unit directions (3, n) through points of pixels, as the pixel filter has them.

        pixel: (n,) row-major indices. u: (2, n) in [0, 1).
        """
        dx, dy = self.offsets(u)
        x = pixel % self.width + dx
        y = pixel // self.width + dy
        d = self.du * x
        d += self.dv * y
        d += self.corner
        return normalize(d)

    def sees(self, points: Floats) -> bool:
        """Whether a convex hull of points (3, m) may be in view: False only if it lies wholly outside one
        side of the frustum.
        """
        v = points - self.origin
        low, high = self.offsets(np.zeros((2, 1))), self.offsets(np.ones((2, 1)))
        left, top = float(low[0, 0]), float(low[1, 0])
        right, bottom = self.width - 1 + float(high[0, 0]), self.height - 1 + float(high[1, 0])
        a, b = (self.corner + self.du * x + self.dv * top for x in (left, right))
        d, c = (self.corner + self.du * x + self.dv * bottom for x in (left, right))
        forward = (a + c) / 2
        sides = ((a, b), (b, c), (c, d), (d, a))
        for first, second in sides:
            inward = np.cross(first[:, 0], second[:, 0])[:, None]
            inward = inward if dot(inward, forward)[0] > 0 else -inward
            if np.all(dot(inward, v) < 0):
                return False
        return not bool(np.all(dot(forward, v) < 0))


def make_camera(description: PerspectiveCamera, film: Film) -> Camera:
    """The camera of a description, its film plane at distance 1."""
    left, top, dx, dy = description.film_plane(film)
    m = description.camera_to_world
    right, up, forward = (m[:3, i : i + 1] for i in range(3))
    return Camera(
        m[:3, 3:4].copy(),
        forward + right * left + up * top,
        right * dx,
        -up * dy,
        film.width,
        film.height,
        offsets(film.pixel_filter),
    )
