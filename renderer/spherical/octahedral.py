"""The equal-area map between the unit square and the sphere, in the octahedral layout [clarberg2008].

Axes are pbrt-v4's: the middle of the square is +z, its four corners are -z; the first coordinate runs along
+x, the second along +y, so that an image's first row lies towards -y. Over a quadrant, with (s, t) its
first-quadrant coordinates and r = s + t, z = 1 - r^2 and the angle from x is (pi/2) t/r; the lower half of
the sphere is the upper one mirrored at s + t = 1.
"""

from __future__ import annotations

import numpy as np

from renderer.math.vectors import Floats
from scenes.arrays import Index


def square_to_sphere(u: Floats) -> Floats:
    """Unit vectors (3, n) of points u (2, n) in [0, 1]; every area of the square maps to 4 pi times as much
    solid angle.

    Where pbrt has (v - u)/r + 1 and 1 - |1 - u - v|, the mirrored coordinates are used: they keep their
    digits at both poles.
    """
    a: Floats = 2.0 * u[0] - 1.0
    b: Floats = 2.0 * u[1] - 1.0
    p, q = np.abs(a), np.abs(b)
    upper = p + q <= 1.0
    s, t = np.where(upper, p, 1.0 - q), np.where(upper, q, 1.0 - p)
    r = s + t
    # The poles have no angle: any will do, their r being 0.
    angle = (np.pi / 2) * np.divide(t, r, out=np.zeros_like(r), where=r > 0)
    rr = r * r
    sine = r * np.sqrt(np.maximum(2.0 - rr, 0.0))
    z = 1.0 - rr
    return np.stack(
        [np.copysign(np.cos(angle) * sine, a), np.copysign(np.sin(angle) * sine, b), np.where(upper, z, -z)]
    )


def sphere_to_square(w: Floats) -> Floats:
    """The points (2, n) in [0, 1] of unit vectors w (3, n): the inverse of `square_to_sphere`.

    r is sqrt((x^2 + y^2) / (1 + |z|)) and not pbrt's sqrt(1 - |z|), which has no digits left within 1e-8 of a
    pole. pbrt approximates the arc tangent by a polynomial; its texels' borders are off by some 1e-5 of the
    square from these.
    """
    x, y, z = w
    r = np.minimum(np.sqrt((x * x + y * y) / (1.0 + np.abs(z))), 1.0)
    t: Floats = r * np.arctan2(np.abs(y), np.abs(x)) * (2 / np.pi)
    s: Floats = r - t
    lower = z < 0
    p, q = np.where(lower, 1.0 - t, s), np.where(lower, 1.0 - s, t)
    return np.stack([0.5 * (np.copysign(p, x) + 1.0), 0.5 * (np.copysign(q, y) + 1.0)])


def around_edges(u: Floats) -> Floats:
    """Points (2, n) up to one size beyond the unit square, folded back to where the octahedron goes on."""
    x, y = _folded(u[0], u[1])
    y, x = _folded(y, x)
    return np.stack([x, y])


def _folded(along: Floats, other: Floats) -> tuple[Floats, Floats]:
    """The two coordinates (n,) of points beyond the ends of `along`."""
    out = (along < 0) | (along > 1)
    along = np.where(along < 0, -along, np.where(along > 1, 2.0 - along, along))
    return along, np.where(out, 1.0 - other, other)


def bilinear_on_sphere(image: Floats, w: Floats) -> Floats:
    """An image (h, h, 3) interpolated between texel middles towards unit vectors w (3, n): (3, n).

    Beyond an edge the octahedron goes on at the same edge, the other way round. Beyond the first row and
    column pbrt goes on one texel too far in, and so does this.
    """
    size = len(image)
    place = sphere_to_square(w) * size - 0.5
    low = np.floor(place).astype(np.int64)
    right, down = place - low
    out = np.zeros_like(w)
    for j, share_down in ((0, 1.0 - down), (1, down)):
        for i, share in ((0, 1.0 - right), (1, right)):
            column, row = wrapped_texels(low[0] + i, low[1] + j, size)
            out += (share * share_down) * image[row, column].T
    return out


def wrapped_texels(column: Index, row: Index, size: int) -> tuple[Index, Index]:
    """The texel that a column and a row stand for which lie one beyond the image at most."""
    if size == 1:
        return np.zeros_like(column), np.zeros_like(row)
    out = (column < 0) | (column >= size)
    column = np.where(column < 0, -column, np.where(column >= size, 2 * size - 1 - column, column))
    row = np.where(out, size - 1 - row, row)
    out = (row < 0) | (row >= size)
    row = np.where(row < 0, -row, np.where(row >= size, 2 * size - 1 - row, row))
    return np.where(out, size - 1 - column, column), row
