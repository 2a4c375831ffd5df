"""Latitude-longitude images of the sphere: the first row about +z, columns by the angle from +x towards +y.

Positions inside a texel are equal in area: x along the angle, y along sin^2(theta/2), which is the share of
the sphere that lies above. Beside it goes cos^2(theta/2), the share below, so that neither pole loses digits
and z is their difference.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats

Integers = NDArray[np.integer]


def share_above(row: Integers, height: Integers) -> Floats:
    """The share (n,) of the sphere above the upper edge of a row of images `height` texels high."""
    return np.sin((np.pi / 2) * row / height) ** 2


def texel_to_sphere(
    row: Integers, column: Integers, x: Floats, y: Floats, height: Integers, width: Integers
) -> Floats:
    """Unit vectors (3, n) of places in texels. row, column, height, width: (n,). x, y: (n,) in [0, 1], by
    area.
    """
    above = share_above(row, height)
    above = above + y * (share_above(row + 1, height) - above)
    # The share below is the share above seen from the other end.
    below = share_above(height - row - 1, height)
    below = below + (1.0 - y) * (share_above(height - row, height) - below)
    sine = 2.0 * np.sqrt(above * below)
    angle = (2 * np.pi) * (column + x) / width
    return np.stack([sine * np.cos(angle), sine * np.sin(angle), below - above])


def sphere_to_square(w: Floats) -> Floats:
    """The angle from +x over 2 pi and the angle from +z over pi, (2, n) in [0, 1], of unit vectors w (3,
    n).
    """
    x, y, z = w
    angle: Floats = np.arctan2(y, x) / (2 * np.pi)
    return np.stack([np.where(angle < 0, angle + 1.0, angle), np.arctan2(np.sqrt(x * x + y * y), z) / np.pi])


def share_of_row(w: Floats, row: Integers, height: Integers) -> Floats:
    """Where in its row a direction w (3, n) is, as the share (n,) of the row's area above it."""
    x, y, z = w
    # From the nearer pole: (1 - |z|)/2 without the difference, which would cancel.
    beyond: Floats = 0.5 * (x * x + y * y) / (1.0 + np.abs(z))
    south = z < 0
    near = np.where(south, height - 1 - row, row)
    start = share_above(near, height)
    part = (beyond - start) / (share_above(near + 1, height) - start)
    return np.where(south, 1.0 - part, part)
