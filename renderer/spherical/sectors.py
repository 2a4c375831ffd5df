"""Projected solid angle, all of it in sectors of azimuth: areas that keep their digits, and the azimuth that
cuts one.

The triangles of a polygon above the horizon are projected to the unit disk of the surface; edges, being parts
of great circles, become arcs of ellipses about the zenith [peters2021]. Between two azimuths lies one sector:
a triangle that does not hold the zenith is two, one from either end of its azimuths to its middle corner, and
one that does is three. In a sector at the angle t from its start, the corner at azimuth t = 0 where both
edges meet, the tangent of an edge's elevation is z(t) = a cos t + s sin t: the same a for both edges, and
slopes s whose difference is a quotient, d = V rho / (k k'), V the triple product of the triangle, rho the
corner's distance from the axis and k, k' the cross products of the horizontal parts along the edges. The area
up to t is

  G(t) = 1/2 int_0^t 1/(1 + zo^2) - 1/(1 + zi^2) = 1/2 (atan2(To sin t, co) / To - atan2(Ti sin t, ci) / Ti)

of the outer (lower) and the inner edge, T^2 = 1 + a^2 + s^2 and c = cos t + a z(t): Lambert's sum over edges
[lambert1760], as everywhere. It cancels. With Ti - To = d q, q = (si + so) / (Ti + To), both differences have
the factor d:

  2 G = d q theta_o / (Ti To) + atan2(d sin t (a sin t (To - q so) - q (1 + a^2) cos t), co ci + Ti To sin^2
  t) / Ti,

so that thin, far, edge-on and low triangles keep their relative accuracy. What still cancels are the two
terms of a sector that is narrow as an angle, t and t s / sqrt(1 + a^2) below NARROW: there they cost
NARROW^-2 roundings, and below that the integral, smooth with poles no nearer than 10 lengths, is taken by 5
Gauss nodes instead, to 38^-10.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats
from scenes.arrays import Mask

NARROW, STEPS = 0.1, 60
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
NODES, WEIGHTS = tuple((_NODES + 1.0) / 2.0), tuple(_WEIGHTS / 2.0)


@dataclass(frozen=True, eq=False)
class Sectors:
    """Sectors of azimuth, each field (q,).

    x, y: the unit direction of the start. turn: 1 where azimuth grows from there, -1 where it falls. width:
    the angle. start: a, the tangent of the elevation at the start. outer: the outer edge's slope. excess: d,
    the slope of the inner edge less that of the outer. to_zenith: 1 without an inner edge, else 0. narrow:
    whether Gauss is used.
    """

    x: Floats
    y: Floats
    turn: Floats
    width: Floats
    start: Floats
    outer: Floats
    excess: Floats
    to_zenith: Mask
    narrow: Mask

    def take(self, rows: NDArray[np.integer]) -> Sectors:
        """Some of them."""
        return Sectors(*(getattr(self, f.name)[rows] for f in fields(self)))

    def tangents(self, t: Floats) -> tuple[Floats, Floats]:
        """The tangents of the elevations of the outer and the inner edge at the angles t (q,) from the
        start.
        """
        sine = np.sin(t)
        outer = np.maximum(self.start * np.cos(t) + self.outer * sine, 0.0)
        return outer, outer + self.excess * sine

    def rate(self, t: Floats) -> Floats:
        """dG/dt (q,)."""
        sine = np.sin(t)
        zo = self.start * np.cos(t) + self.outer * sine
        gap = self.excess * sine
        zi = zo + gap
        return 0.5 / (1.0 + zo * zo) * np.where(self.to_zenith, 1.0, gap * (zo + zi) / (1.0 + zi * zi))

    def solve(self, target: Floats) -> Floats:
        """The angles t (q,) at which G reaches `target` (q,): Newton's steps, halved where one leaves the
        bracket.

        The start is a power law with the right area and rate at the far end. A row stops by its own numbers,
        so that its bits do not depend on other rows: where G was off by at most 1e-9 of the target before its
        last step, or where the step was lost in the rounding of t. (Steps of 1e-8 would not do: a sliver
        through the zenith has all its area in the last 1e-8 of its azimuths.)
        """
        whole = self.area(self.width)
        with np.errstate(invalid="ignore", divide="ignore"):
            power = np.minimum(np.maximum(self.rate(self.width) * self.width / whole, 1.0), 4.0)
            t = self.width * np.minimum(np.maximum(target / whole, 0.0), 1.0) ** (1.0 / power)
        low, high = np.zeros_like(t), self.width.copy()
        rows = np.flatnonzero((t > 0) & (t < self.width))
        for _ in range(STEPS):
            if not rows.size:
                break
            own, at = self if rows.size == t.size else self.take(rows), t[rows]
            excess = own.area(at) - target[rows]
            low[rows], high[rows] = np.where(excess < 0, at, low[rows]), np.where(excess < 0, high[rows], at)
            with np.errstate(invalid="ignore", divide="ignore"):
                moved = at - excess / own.rate(at)
            inside = (moved >= low[rows]) & (moved <= high[rows])
            t[rows] = np.where(inside, moved, 0.5 * (low[rows] + high[rows]))
            rows = rows[(np.abs(excess) > 1e-9 * target[rows]) & (np.abs(t[rows] - at) > 1e-15 * at)]
        return t

    def area(self, t: Floats) -> Floats:
        """G (q,), the projected solid angle from the start to the angles t (q,)."""
        out = np.zeros_like(t)
        for rows, formula in (
            (np.flatnonzero(self.to_zenith), _to_zenith),
            (np.flatnonzero(self.narrow & ~self.to_zenith), _narrow),
            (np.flatnonzero(~self.narrow & ~self.to_zenith), _wide),
        ):
            if rows.size:
                out[rows] = formula(self if rows.size == t.size else self.take(rows), t[rows])
        return out

    def direction(self, t: Floats, u: Floats) -> Floats:
        """Unit directions (3, q) at the angles t (q,); u (q,) is the share of the squared distance from the
        axis between inner and outer edge.
        """
        outer, inner = self._squares(t)
        rho, up = (np.sqrt((1.0 - u) * b + u * a) for a, b in zip(outer, inner, strict=True))
        sine, cosine = self.turn * np.sin(t), np.cos(t)
        return np.stack(
            [rho * (self.x * cosine - self.y * sine), rho * (self.y * cosine + self.x * sine), up]
        )

    def locate(self, wi: Floats) -> tuple[Floats, Floats, Floats]:
        """The t and u (q,) of directions wi (3, q), and their distance (q,) inside the sector, negative
        outside.
        """
        along, across = self.x * wi[0] + self.y * wi[1], self.turn * (self.x * wi[1] - self.y * wi[0])
        t = np.arctan2(across, along)
        outer, inner = self.tangents(t)
        square = wi[2] * wi[2] / (wi[0] * wi[0] + wi[1] * wi[1])
        with np.errstate(invalid="ignore", divide="ignore"):
            beside = (inner * inner - square) / (self.excess * np.sin(t) * (inner + outer))
            u = (1.0 + outer * outer) / (1.0 + square) * np.where(self.to_zenith, 1.0, beside)
            margin = np.minimum(np.minimum(t, self.width - t) / self.width, np.minimum(u, 1.0 - u))
        return np.minimum(np.maximum(t, 0.0), self.width), u, np.where(np.isnan(margin), -np.inf, margin)

    def _squares(self, t: Floats) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
        """Squared distance from the axis, and height, of the outer and of the inner edge at the angles t."""
        zo, zi = self.tangents(t)
        so, si = zo * zo, zi * zi
        inner, high = (
            np.where(self.to_zenith, 0.0, 1.0 / (1.0 + si)),
            np.where(self.to_zenith, 1.0, si / (1.0 + si)),
        )
        return (1.0 / (1.0 + so), so / (1.0 + so)), (inner, high)


def _to_zenith(s: Sectors, t: Floats) -> Floats:
    length = np.sqrt(1.0 + s.start * s.start + s.outer * s.outer)
    sine, cosine = np.sin(t), np.cos(t)
    return 0.5 * np.arctan2(length * sine, cosine + s.start * (s.start * cosine + s.outer * sine)) / length


def _narrow(s: Sectors, t: Floats) -> Floats:
    total = np.zeros_like(t)
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        total += weight * s.rate(node * t)
    return total * t


def _wide(s: Sectors, t: Floats) -> Floats:
    inner, square = s.outer + s.excess, 1.0 + s.start * s.start
    to, ti = np.sqrt(square + s.outer * s.outer), np.sqrt(square + inner * inner)
    sine, cosine = np.sin(t), np.cos(t)
    q = (inner + s.outer) / (ti + to)
    co, ci = (square * cosine + s.start * slope * sine for slope in (s.outer, inner))
    upper = s.excess * sine * (s.start * sine * (to - q * s.outer) - q * square * cosine)
    first = s.excess * q * np.arctan2(to * sine, co) / to
    return 0.5 * (first + np.arctan2(upper, co * ci + ti * to * sine * sine)) / ti
