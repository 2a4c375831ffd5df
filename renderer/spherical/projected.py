"""Projected solid angle of convex polygons: the irradiance per unit radiance, and directions with pdf cos /
irradiance.

The polygon is clipped at the surface's horizon and cut into sectors of azimuth (`fan`, `sectors`), whose
areas are exact and add up without cancelling. One of them is chosen by its area, then an azimuth in it by a
search [peters2021], and then the squared distance from the axis uniformly between the two edges there.
"""

from __future__ import annotations

import numpy as np

from renderer.math.vectors import Floats, combine, cross, dot
from renderer.spherical.fan import Table, table
from renderer.spherical.polygon import Polygon, seen_from
from scenes.arrays import Index

# Lambert's sum is off by a few 1e-16 sr: to 1e-12 of itself from here on, below which the sectors are added
# up instead.
LAMBERT = 1e-3


def projected_solid_angle(corner: Floats, others: Floats, ref_n: Floats) -> Floats:
    """The projected solid angle (n,) of polygons above the horizon of ref_n (3, n): the irradiance per unit
    radiance [lambert1760].

    corner: (3, n), others: (3, v - 1, n) or (3, v - 1, 1): see `polygon.seen_from`. Exactly 0 in the
    polygon's plane and where all of it is below the horizon; else of a relative error of some 1e-16 over the
    relative distance from the plane.
    """
    polygon = seen_from(corner, others, ref_n)
    seen = (polygon.volume > 0).any(axis=0)
    total = np.where(seen, _contour(polygon), 0.0)
    small = np.flatnonzero(seen & ~(total > LAMBERT))
    if small.size:
        total[small] = table(polygon.take(small)).total
    return total


def _contour(polygon: Polygon) -> Floats:
    """Half the sum over edges of the angle that each is seen under, times the cosine of its plane's
    normal.
    """
    v = polygon.base[:, None] + polygon.offset
    x, y, z = v[0], v[1], polygon.up
    total = np.zeros(z.shape[1])
    for i in range(len(z)):
        j = (i + 1) % len(z)
        a = np.stack([x[i], y[i], z[i]])
        k = cross(a, polygon.offset[:, j] - polygon.offset[:, i])
        sine = np.sqrt(dot(k, k))
        angle = np.arctan2(sine, x[i] * x[j] + y[i] * y[j] + z[i] * z[j])
        # An edge that is seen end-on adds nothing.
        total += angle * k[2] / np.where(sine > 0, sine, 1.0)
    return 0.5 * total


def sample(u: Floats, corner: Floats, others: Floats, ref_n: Floats) -> tuple[Floats, Floats, Floats]:
    """Directions wi (3, n) with pdf cos / E, the cosines (n,) and E, the projected solid angles (n,). u: (2,
    n) in [0, 1).

    Where E is 0 there is no direction: wi is NaN and the cosine 0.
    """
    polygon = seen_from(corner, others, ref_n)
    parts = table(polygon)
    rows = np.flatnonzero(parts.total > 0)
    number, rest = _choose(parts, u[0])
    sectors = parts.sectors.take(number[rows])
    local = np.full((3, u.shape[1]), np.nan)
    local[:, rows] = sectors.direction(sectors.solve(rest[rows]), u[1, rows])
    return combine(polygon.frame, *local), np.where(parts.total > 0, local[2], 0.0), parts.total


def invert(wi: Floats, corner: Floats, others: Floats, ref_n: Floats) -> Floats:
    """The u (2, n) that `sample` takes to wi (3, n), which must point to the polygon where it is above the
    horizon.
    """
    polygon = seen_from(corner, others, ref_n)
    parts = table(polygon)
    local = np.stack([dot(wi, axis) for axis in polygon.frame])
    u, best = np.full((2, wi.shape[1]), np.nan), np.full(wi.shape[1], -np.inf)
    before = np.zeros_like(best)
    for number, area in zip(parts.number, parts.area, strict=True):
        rows = np.flatnonzero(number >= 0)
        sectors = parts.sectors.take(number[rows])
        t, v, margin = sectors.locate(local[:, rows])
        # Rounding may put a direction outside of every sector: that which it is least outside of is its own.
        better = margin > best[rows]
        t, v, rows, sectors = t[better], v[better], rows[better], sectors.take(np.flatnonzero(better))
        u[:, rows] = (before[rows] + sectors.area(t)) / parts.total[rows], v
        best[rows] = margin[better]
        before += area
    return u


def _choose(parts: Table, u: Floats) -> tuple[Index, Floats]:
    """The sector that u (n,) falls into by the running sum of areas, and the area left in it."""
    target = u * parts.total
    number, rest, before = parts.number[0].copy(), target.copy(), np.zeros_like(target)
    for one, area in zip(parts.number, parts.area, strict=True):
        here = (area > 0) & (target >= before)
        np.copyto(number, one, where=here)
        np.copyto(rest, target - before, where=here)
        before += area
    return number, rest
