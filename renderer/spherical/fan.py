"""A polygon's projected solid angle as a table of sectors: the fan of triangles at its first corner, each cut
by azimuth.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from renderer.math.vectors import Floats
from renderer.spherical.polygon import Polygon
from renderer.spherical.sectors import NARROW, Sectors
from scenes.arrays import Index, Mask

NEXT, LAST = [1, 2, 0], [2, 0, 1]


@dataclass(frozen=True, eq=False)
class Table:
    """The sectors of n polygons. number: (slots, n) the sector of `sectors` in each slot, -1 for none. area:
    (slots, n) of the sectors. total: (n,) the projected solid angles of the polygons, their irradiances per
    unit of radiance.
    """

    sectors: Sectors
    number: Index
    area: Floats
    total: Floats


@dataclass(frozen=True, eq=False)
class _Triangles:
    """q triangles above the horizon, counter-clockwise about the zenith. x, y, up, k: (3, q). edge: (3, 3,
    q), corner to next.

    k: cross products of the horizontal parts, each corner with the next. around: (q,), whether the zenith is
    inside. Where it is not, edge 2 alone spans all azimuths, and k of the others has the sign of `turn` (q,).
    """

    x: Floats
    y: Floats
    up: Floats
    k: Floats
    edge: Floats
    volume: Floats
    around: Mask
    turn: Floats

    def take(self, rows: Index) -> _Triangles:
        """Some of them."""
        return _Triangles(*(getattr(self, f.name).take(rows, axis=-1) for f in fields(self)))


def table(polygon: Polygon) -> Table:
    """All sectors of polygons. A triangle that holds the zenith has three, which meet there; any other has
    two, which share corner 1.
    """
    n = polygon.base.shape[1]
    number = np.full((3 * len(polygon.volume), n), -1, dtype=np.int64)
    parts: list[Sectors] = []
    filled = 0
    for i, volume in enumerate(polygon.volume):
        rows = np.flatnonzero(volume > 0)
        if not rows.size and parts:
            continue
        t = _triangles(polygon, i, rows)
        for j in range(3):
            use = np.flatnonzero((t.k[j] != 0) & (t.around if j == 2 else t.around | (t.k[2] != 0)))
            parts.append(_sectors(t if use.size == rows.size else t.take(use), j))
            number[3 * i + j, rows[use]] = np.arange(filled, filled + use.size)
            filled += use.size
    return _measured(parts, number)


def _measured(parts: list[Sectors], number: Index) -> Table:
    sectors = Sectors(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Sectors)))
    areas = np.append(np.maximum(sectors.area(sectors.width), 0.0), 0.0)
    area = areas[number]
    total = np.zeros(area.shape[1])
    for one in area:
        total += one
    return Table(sectors, number, area, total)


def _triangles(polygon: Polygon, i: int, rows: Index) -> _Triangles:
    """The i-th triangles of the fans of those rows."""
    base, offset, up, volume = polygon.base, polygon.offset, polygon.up, polygon.volume[i]
    if rows.size < volume.size:
        base, offset, up, volume = (v.take(rows, axis=-1) for v in (base, offset, up, volume))
    own = [0, i + 1, i + 2]
    offset, up = offset[:, own], up[own]
    edge = offset[:, NEXT] - offset
    x, y = base[0] + offset[0], base[1] + offset[1]
    # p x q = p x e = q x e: by the end that is nearer to the axis, whose azimuth is the easier lost.
    rho = x * x + y * y
    nearer = rho <= rho[NEXT]
    k = _either(nearer, x, x[NEXT]) * edge[1] - _either(nearer, y, y[NEXT]) * edge[0]
    # A corner on the axis makes k = 0 on both sides of it: counted as rising, the zenith is `around`, as it
    # should be.
    rising = k >= 0
    count = rising[0].astype(np.int64) + rising[1] + rising[2]
    around, inner = count == 3, count == 2
    # The odd one out is to be the last.
    first, second = (~around & (rising[j] != inner) for j in (0, 1))
    x, y, up, k = (_rolled(v, first, second) for v in (x, y, up, k))
    turn = np.where(inner | around, 1.0, -1.0)
    return _Triangles(x, y, up, k, _rolled(edge, first, second), volume, around, turn)


def _rolled(v: Floats, once: Mask, twice: Mask) -> Floats:
    """v (..., 3, q) with corner 1 (where `once`) or 2 (where `twice`) in front."""
    return np.where(once, v[..., NEXT, :], np.where(twice, v[..., LAST, :], v))


def _either(first: Mask, a: Floats, b: Floats) -> Floats:
    return np.where(first, a, b)


def _sectors(t: _Triangles, j: int) -> Sectors:
    """The sectors along edge j; beside the zenith they start from where edge 2 starts or ends."""
    near, far = j, (j + 1) % 3
    x, y, up, edge, turn = t.x[near], t.y[near], t.up[near], t.edge[:, j], t.turn
    width = np.arctan2(np.abs(t.k[j]), x * t.x[far] + y * t.y[far])
    if j == 1:
        x, y, up = (_either(t.around, v[near], v[far]) for v in (t.x, t.y, t.up))
        edge, turn = _either(t.around, edge, -edge), _either(t.around, turn, -turn)
    rho, k, across = np.sqrt(x * x + y * y), np.abs(t.k[j]), np.abs(t.k[2])
    x, y, a = x / rho, y / rho, up / rho
    slope = _slope(edge, x, y, a) * (rho / k)
    across = np.where(t.around, 1.0, across)
    other = _slope(t.edge[:, 2] if j == 1 else -t.edge[:, 2], x, y, a) * (rho / across)
    # Where azimuth grows along the short edges these are the outer ones.
    outer = np.where(t.turn > 0, slope, other)
    excess = np.where(t.around, 0.0, t.volume * rho / (k * across))
    steep = np.maximum(np.abs(outer), np.abs(outer + excess)) / np.sqrt(1.0 + a * a)
    narrow = ~t.around & (width < NARROW) & (width * steep < NARROW)
    return Sectors(x, y, turn, width, a, outer, excess, t.around, narrow)


def _slope(edge: Floats, x: Floats, y: Floats, a: Floats) -> Floats:
    """The rise of an edge above the tangent of its start's elevation, kept up along the start's azimuth (x,
    y).
    """
    return edge[2] - a * (edge[0] * x + edge[1] * y)
