"""Area-preserving maps from the unit square to disks, triangles, spheres and hemispheres."""

from __future__ import annotations

import numpy as np

from renderer.math.vectors import Floats


def concentric_disk(u: Floats) -> Floats:
    """Uniform points on the unit disk, keeping strata compact [shirley1997].

    u: (2, n) in [0, 1). Returns (2, n).
    """
    a: Floats = 2.0 * u[0] - 1.0
    b: Floats = 2.0 * u[1] - 1.0
    first = np.abs(a) > np.abs(b)
    radius = np.where(first, a, b)
    other = np.where(first, b, a)
    # The centre of the square has no direction: any angle will do, its radius being 0.
    ratio = np.divide(other, radius, out=np.zeros_like(radius), where=radius != 0)
    angle = (np.pi / 4) * ratio
    angle = np.where(first, angle, np.pi / 2 - angle)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)])


def uniform_triangle(u: Floats) -> tuple[Floats, Floats]:
    """Uniform barycentric weights (n,), (n,) of a triangle's second and third corner: the square folded in
    place [heitz2019].

    u: (2, n) in [0, 1).
    """
    less = np.minimum(u[0], u[1])
    return u[0] - 0.5 * less, u[1] - 0.5 * less


def uniform_sphere(u: Floats) -> Floats:
    """Uniform unit vectors, pdf 1/(4 pi). u: (2, n). Returns (3, n)."""
    z = 1.0 - 2.0 * u[0]
    # 1 - z^2 = 4 u (1 - u) without the cancellation near the poles
    sine = 2.0 * np.sqrt(u[0] * (1.0 - u[0]))
    phi = (2 * np.pi) * u[1]
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), z])


def cosine_hemisphere(u: Floats) -> Floats:
    """Unit vectors about +z with pdf cos(theta)/pi: the disk lifted to the hemisphere [pharr2023, sec.
    A.5.3].

    u: (2, n). Returns (3, n). z is bounded away from 0, where the pdf would vanish.
    """
    x, y = concentric_disk(u)
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 1e-32))
    return np.stack([x, y, z])


def uniform_hemisphere(u: Floats) -> Floats:
    """Uniform unit vectors about +z, pdf 1/(2 pi). u: (2, n). Returns (3, n)."""
    z = 1.0 - u[0]
    sine = np.sqrt(u[0] * (1.0 + z))
    phi = (2 * np.pi) * u[1]
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), z])
