"""The perspective camera, pbrt's: left-handed space, `fov` over the shorter side, pixel (0, 0) at the top left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.arrays import Floats, dot, normalize
from scenes.description import Film, PerspectiveCamera


@dataclass(frozen=True, eq=False)
class Camera:
    """origin: (3, 1). corner, du, dv: (3, 1), so that a film point (x, y) in pixels is looked at along corner + x du + y dv."""

    origin: Floats
    corner: Floats
    du: Floats
    dv: Floats
    width: int
    height: int

    def rays(self, pixel: NDArray[np.int64], u: Floats) -> Floats:
        """Unit directions (3, n) through points of pixels, uniform over each pixel (box filter).

        pixel: (n,) row-major indices. u: (2, n) in [0, 1).
        """
        x = pixel % self.width + u[0]
        y = pixel // self.width + u[1]
        d = self.du * x
        d += self.dv * y
        d += self.corner
        return normalize(d)

    def sees(self, points: Floats) -> bool:
        """Whether a convex hull of points (3, m) may be in view: False only if it lies wholly outside one side of the frustum."""
        v = points - self.origin
        a = self.corner
        b = a + self.du * self.width
        c = b + self.dv * self.height
        d = a + self.dv * self.height
        forward = (a + c) / 2
        sides = ((a, b), (b, c), (c, d), (d, a))
        for first, second in sides:
            inward = np.cross(first[:, 0], second[:, 0])[:, None]
            inward = inward if dot(inward, forward)[0] > 0 else -inward
            if np.all(dot(inward, v) < 0):
                return False
        return not bool(np.all(dot(forward, v) < 0))


def make_camera(description: PerspectiveCamera, film: Film) -> Camera:
    """The camera of a description; the film plane is at distance 1 and its shorter side spans 2 tan(fov / 2)."""
    half = np.tan(np.radians(description.fov) / 2)
    pixel = 2 * half / min(film.width, film.height)
    m = description.camera_to_world
    linear = m[:3, :3]
    right, up, forward = (linear[:, i : i + 1] for i in range(3))
    corner = forward - right * (pixel * film.width / 2) + up * (pixel * film.height / 2)
    return Camera(m[:3, 3:4].copy(), corner, right * pixel, -up * pixel, film.width, film.height)
