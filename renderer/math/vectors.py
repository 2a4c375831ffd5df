"""Vectors of a wavefront: component-major `(3, n)` float64, so that `x, y, z = v` gives contiguous columns.

Rows meet ufuncs only. BLAS and reductions over rows may change a row's bits when its neighbours change.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def dot(a: Floats, b: Floats) -> Floats:
    """Row-wise dot product of two (3, n) arrays (either may be (3, 1)), summed in the fixed order x, y, z."""
    out = a[0] * b[0]
    out += a[1] * b[1]
    out += a[2] * b[2]
    return out


def cross(a: Floats, b: Floats) -> Floats:
    """Row-wise cross product of two (3, n) arrays."""
    ax, ay, az = a
    bx, by, bz = b
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def normalize(v: Floats) -> Floats:
    """Unit vectors, row by row; a zero row becomes NaN without a warning."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return v / np.sqrt(dot(v, v))


def combine(frame: tuple[Floats, Floats, Floats], x: Floats, y: Floats, z: Floats) -> Floats:
    """World vectors `x X + y Y + z Z` of local coordinates. frame: the axes X, Y, Z, (3, n) or (3, 1) each.
    x, y, z: (n,).
    """
    ax, ay, az = frame
    out = ax * x
    out += ay * y
    out += az * z
    return out


def frame_about(z: Floats) -> tuple[Floats, Floats, Floats]:
    """An orthonormal frame about unit vectors z (3, n), continuous except at z.z = 0 [duff2017]."""
    sign = np.copysign(1.0, z[2])
    a = -1.0 / (sign + z[2])
    b = z[0] * z[1] * a
    x = np.stack([1.0 + sign * z[0] * z[0] * a, sign * b, -sign * z[0]])
    y = np.stack([b, sign + z[1] * z[1] * a, -z[1]])
    return x, y, z


def gather(parameters: Floats, index: NDArray[np.integer]) -> Floats:
    """Parameters of each row: `parameters[..., index]`, or the one column where there is a single entry.

    parameters: (..., k). index: (n,). Returns (..., n), or (..., 1) if k == 1, which broadcasts to the same
    numbers without a copy.
    """
    return parameters if parameters.shape[-1] == 1 else parameters.take(index, axis=-1)
