"""The spherical rectangle of Urena, Fajardo and King: its solid angle, and points uniform in it.

The published formulas take angles as acos of nearly parallel normals and the solid angle as a difference from
2 pi. Both lose every digit for small or edge-on lights. What is used here is the same map, rearranged:

- Solid angle: two triangles, tan(O/2) = |z| lx ly / denominator [vanoosterom1983, eq. 8]. The numerator is a
product,
  so a small solid angle keeps its relative accuracy: no branch, no threshold, exact 0 on the light's plane.
- With b(y) = y / sqrt(y^2 + z^2) and c(x) = x / sqrt(x^2 + z^2), the solid angle of [0, x] x [0, y] is asin(b
c), so
  the x that splits off a solid angle t obeys asin(b1 c) - asin(b0 c) = t, whence
  c = sin t / sqrt((b1 - b0)^2 + 4 b0 b1 sin^2(t/2)): [urena2013] without the 2 pi.
"""

from __future__ import annotations

import numpy as np

from renderer.math.vectors import Floats

# Where the closed form only starts a search: |x| / |z| beyond which it loses 1e-10, and the sr below which it
# loses 1e-8.
GRAZING, SMALL = 30.0, 1e-8


def solid_angle(x0: Floats, x1: Floats, y0: Floats, y1: Floats, z: Floats) -> Floats:
    """Solid angle (n,) in sr of the rectangle [x0, x1] x [y0, y1] at height z, from the origin
    [vanoosterom1983, eq. 8].

    Relative error below 1e-14 from 1e-17 sr up to a hemisphere, except right above an edge or the diagonal,
    where it is 1e-16 of the size over the distance (1e-8 at 1e-8 of the size); 0 at z = 0.
    """
    xx0, xx1, yy0, yy1, zz = x0 * x0, x1 * x1, y0 * y0, y1 * y1, z * z
    r00, r10 = np.sqrt(xx0 + yy0 + zz), np.sqrt(xx1 + yy0 + zz)
    r01, r11 = np.sqrt(xx0 + yy1 + zz), np.sqrt(xx1 + yy1 + zz)
    across = x0 * x1 + y0 * y1 + zz  # p00 . p11 and p10 . p01 are both this
    volume = np.abs(z) * (x1 - x0) * (y1 - y0)
    bottom, top = x0 * x1 + yy0 + zz, x0 * x1 + yy1 + zz
    left, right = xx0 + y0 * y1 + zz, xx1 + y0 * y1 + zz
    lower = r00 * r10 * r11 + bottom * r11 + right * r00 + across * r10
    upper = r00 * r11 * r01 + across * r01 + top * r00 + left * r11
    return 2.0 * (np.arctan2(volume, lower) + np.arctan2(volume, upper))


def invert(
    u: Floats, omega: Floats, x0: Floats, x1: Floats, y0: Floats, y1: Floats, z: Floats
) -> tuple[Floats, Floats]:
    """The point (x, y) that u (2, n) picks, uniform in solid angle. Rows with omega = 0 give NaN or an edge.

    1 - c^2 loses eps (x/z)^4 of x, and t loses eps / omega of its range: beyond GRAZING and below SMALL the
    closed form only starts a root search. Error of the solid angle left of x, relative to the whole: below
    1e-7 wherever tested.
    """
    zz = z * z
    b0, b1 = y0 / np.sqrt(y0 * y0 + zz), y1 / np.sqrt(y1 * y1 + zz)
    c0 = x0 / np.sqrt(x0 * x0 + zz)
    t = np.arcsin(b1 * c0) - np.arcsin(b0 * c0) + u[0] * omega
    half = np.sin(0.5 * t)
    sine = np.sin(t)
    gap = _difference(y0, y1, b0, b1, zz)
    square = gap * gap + 4.0 * b0 * b1 * half * half
    c = sine / np.sqrt(np.maximum(square, sine * sine))
    x = np.abs(z) * c / np.sqrt(np.maximum((1.0 - c) * (1.0 + c), 1e-300))
    x = np.minimum(np.maximum(x, x0), x1)
    grazing = np.flatnonzero(((np.abs(x) > GRAZING * np.abs(z)) | (omega < SMALL)) & (omega > 0))
    if grazing.size:
        x[grazing] = _search(x[grazing], (u[0] * omega)[grazing], *(v[grazing] for v in (x0, x1, y0, y1, z)))
    dd = x * x + zz
    h0, h1 = y0 / np.sqrt(dd + y0 * y0), y1 / np.sqrt(dd + y1 * y1)
    h = h0 + u[1] * _difference(y0, y1, h0, h1, dd)
    y = h * np.sqrt(dd) / np.sqrt(np.maximum((1.0 - h) * (1.0 + h), 1e-300))
    return x, np.minimum(np.maximum(y, y0), y1)


def _search(x: Floats, target: Floats, x0: Floats, x1: Floats, y0: Floats, y1: Floats, z: Floats) -> Floats:
    """The x (n,) to whose left lies a solid angle of `target` (n,): Newton's steps, halved where one leaves
    the bracket.

    A row stops when its own step no longer moves it, so that its bits do not depend on other rows.
    """
    x, low, high = x.copy(), x0.copy(), x1.copy()
    rows = np.arange(x.size)
    for _ in range(60):
        at, bottom, top, height = x[rows], y0[rows], y1[rows], z[rows]
        excess = solid_angle(x0[rows], at, bottom, top, height) - target[rows]
        low[rows], high[rows] = np.where(excess < 0, at, low[rows]), np.where(excess < 0, high[rows], at)
        dd = at * at + height * height
        h0, h1 = bottom / np.sqrt(dd + bottom * bottom), top / np.sqrt(dd + top * top)
        step = excess * dd / (np.abs(height) * _difference(bottom, top, h0, h1, dd))
        moved = at - step
        inside = (moved >= low[rows]) & (moved <= high[rows])
        x[rows] = np.where(inside, moved, 0.5 * (low[rows] + high[rows]))
        rows = rows[np.abs(x[rows] - at) > 1e-14 * (x1[rows] - x0[rows])]
        if not rows.size:
            break
    return x


def _difference(y0: Floats, y1: Floats, b0: Floats, b1: Floats, dd: Floats) -> Floats:
    """b1 - b0 for b = y / sqrt(y^2 + dd).

    Where the signs agree it is rationalised, since the difference would cancel.
    """
    # b1^2 - b0^2 = dd (y1^2 - y0^2) / ((y1^2 + dd)(y0^2 + dd))
    same = b0 * b1 > 0
    total = np.where(same, b0 + b1, 1.0)
    stable = dd * ((y1 - y0) * (y1 + y0)) / ((y1 * y1 + dd) * (y0 * y0 + dd) * total)
    return np.where(same, stable, b1 - b0)
