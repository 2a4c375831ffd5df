"""Adaptive quadrature over convex polygons in a plane, many owners (pixels) at once, with error bounds.

Polygons are cut along x into trapezoids, cells that stay trapezoids when halved in x or across. A cell's
value is Gauss's with 7 x 7 nodes (degree 13); its error is estimated, for each of the two directions, as the
difference to the degree-5 rule on five of the same nodes, which overstates it by far: where the estimate is
1e-6 the error is 1e-12.

Two rules that agree prove nothing about what both step over. So the caller's `resolved` is asked first, from
the known places where the integrand is singular, whether a cell is small enough for its estimate to be
believed; if it is not, the cell is halved without being evaluated, or, once even the largest possible
integrand could not matter there, taken as it is with that largest possible value as its error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.arrays import Array, Index

ROUNDS = 80  # halvings of a cell at most
CELLS = 400_000  # waiting at most; more are taken unresolved, with the bound that belongs to them
CHUNK = 512  # cells evaluated at a time


def _nested_rules() -> tuple[Array, Array, Array]:
    """Gauss's nodes and weights on [0, 1], (7,), and the weights of the degree-5 rule on five of them."""
    nodes, weights = np.polynomial.legendre.leggauss(7)
    kept, low = np.array([0, 1, 3, 5, 6]), np.zeros(7)
    low[kept] = np.linalg.solve(nodes[kept] ** np.arange(5)[:, None], [2, 0, 2 / 3, 0, 2 / 5])
    return (nodes + 1) / 2, weights / 2, low / 2


_X, _W, _LOW = _nested_rules()


@dataclass(frozen=True, eq=False)
class Cells:
    """Trapezoids, each part of a polygon: x from x0 to x1, s from the line l0-l1 to the line r0-r1.

    shape: (6, n), rows x0 x1 l0 l1 r0 r1. owner: (n,) the number of the owner, a pixel, that each belongs to.
    """

    shape: Array
    owner: Index

    @classmethod
    def joined(cls, *parts: Cells) -> Cells:
        """All cells of all parts; none of no parts."""
        shape, owner = np.zeros((6, 0)), np.zeros(0, dtype=np.int64)
        return cls(
            np.concatenate([shape, *(part.shape for part in parts)], axis=1),
            np.concatenate([owner, *(part.owner for part in parts)]),
        )

    def __getitem__(self, rows: Index | NDArray[np.bool_] | slice) -> Cells:
        return Cells(self.shape[:, rows], self.owner[rows])

    @property
    def area(self) -> Array:
        """Area (n,)."""
        x0, x1, l0, l1, r0, r1 = self.shape
        return (x1 - x0) * (r0 - l0 + r1 - l1) / 2

    def at(self, u: Array, v: Array) -> tuple[Array, Array]:
        """x and s, (n, k), at shares u along x and v across, (k,) each."""
        x0, x1, l0, l1, r0, r1 = self.shape[..., None]
        left, right = l0 + (l1 - l0) * u, r0 + (r1 - r0) * u
        return x0 + (x1 - x0) * u, left + (right - left) * v

    def halves(self, along: NDArray[np.bool_]) -> Cells:
        """Both halves, (2n,), cut in x where `along` is set and across elsewhere."""
        x0, x1, l0, l1, r0, r1 = self.shape
        x, left, right = (x0 + x1) / 2, (l0 + l1) / 2, (r0 + r1) / 2
        m0, m1 = (l0 + r0) / 2, (l1 + r1) / 2
        one = np.where(along, (x0, x, l0, left, r0, right), (x0, x1, l0, l1, m0, m1))
        two = np.where(along, (x, x1, left, l1, right, r1), (x0, x1, m0, m1, r0, r1))
        return Cells.joined(Cells(one, self.owner), Cells(two, self.owner))


@dataclass(frozen=True, eq=False)
class Integrand:
    """A function to integrate, smooth in each cell.

    value: f(x, s), all (...). most: upper bound (n,) of f in each cell. resolved: for each cell its extent
    along x (n,) and across (n,), in units of the largest that the singularities allow.
    """

    value: Callable[[Array, Array], Array]
    most: Callable[[Cells], Array]
    resolved: Callable[[Cells], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Totals:
    """Integral and error bound of each owner, (owners,). cells: the number evaluated."""

    value: Array
    bound: Array
    cells: int


def trapezoids(polygons: Array, owner: Index) -> Cells:
    """Cut convex polygons (n, v, 2) in (x, s) into trapezoids at the x of their vertices. owner: (n,) of each
    polygon.

    Either orientation and repeated vertices are allowed.
    """
    p, q = polygons, np.roll(polygons, -1, axis=1)
    xs = np.sort(p[..., 0], axis=1)
    lo, hi = xs[:, :-1, None], xs[:, 1:, None]
    ascending = p[..., :1] <= q[..., :1]
    a, b = np.where(ascending, p, q)[:, None], np.where(ascending, q, p)[:, None]
    width = b[..., 0] - a[..., 0]
    spans = (a[..., 0] <= lo) & (b[..., 0] >= hi) & (width > 0)
    slope = (b[..., 1] - a[..., 1]) / np.where(spans, width, 1.0)
    s_lo, s_hi = a[..., 1] + slope * (lo - a[..., 0]), b[..., 1] + slope * (hi - b[..., 0])
    middle = s_lo + s_hi
    left = np.argmin(np.where(spans, middle, np.inf), axis=2)[..., None]
    right = np.argmax(np.where(spans, middle, -np.inf), axis=2)[..., None]
    sides = [np.take_along_axis(s, side, axis=2)[..., 0] for side in (left, right) for s in (s_lo, s_hi)]
    cells = Cells(np.stack((xs[:, :-1], xs[:, 1:], *sides)).reshape(6, -1), np.repeat(owner, xs.shape[1] - 1))
    return cells[np.flatnonzero((spans.any(axis=2) & (xs[:, 1:] > xs[:, :-1])).ravel() & (cells.area > 0))]


def sums(owner: Index, values: Array, owners: int) -> Array:
    """Sums (owners,) of the values (n,) of each owner."""
    return np.bincount(owner, values, owners).astype(np.float64)


def integrate(cells: Cells, f: Integrand, rough: Array, tolerance: float) -> Totals:
    """Integrate f over each owner's cells until the error bound is about `tolerance` of the integral.

    rough: (owners,), estimates of the integrals. Those below a hundredth of the mean of the positive ones are
    integrated to `tolerance` times that hundredth. A cell is accepted below 1/16 of its owner's tolerance.
    """
    lit = rough[rough > 0]
    scale = np.maximum(rough, 0.01 * lit.mean() if lit.size else 1.0)
    value, bound, evaluated = np.zeros_like(scale), np.zeros_like(scale), 0
    budget = tolerance * scale / 16
    for turn in range(ROUNDS):
        if cells.owner.size == 0:
            break
        along, across = f.resolved(cells)
        worst = f.most(cells) * cells.area
        coarse, last = np.maximum(along, across) > 1, turn == ROUNDS - 1 or cells.owner.size > CELLS
        halve = coarse & (worst > budget[cells.owner]) & (not last)
        rows = np.flatnonzero(~halve)
        q, e_along, e_across = _evaluate(cells[rows], f)
        error = np.where(coarse[rows], np.maximum(worst[rows], e_along + e_across), e_along + e_across)
        done = coarse[rows] | (error <= budget[cells.owner[rows]]) | last
        evaluated += rows.size
        value += sums(cells.owner[rows[done]], q[done], scale.size)
        bound += sums(cells.owner[rows[done]], error[done], scale.size)
        again = rows[~done]
        cells = Cells.joined(
            cells[halve].halves((along > across)[halve]),
            cells[again].halves((e_along > e_across)[~done]),
        )
    return Totals(value, bound, evaluated)


def _evaluate(cells: Cells, f: Integrand) -> tuple[Array, Array, Array]:
    """Integrals (n,) and their estimated errors along x and across."""
    u, v = (grid.ravel() for grid in np.meshgrid(_X, _X, indexing="ij"))
    results = [np.zeros((3, 0))]
    for start in range(0, cells.owner.size, CHUNK):
        part = cells[start : start + CHUNK]
        x, s = part.at(u, v)
        x0, x1, l0, l1, r0, r1 = part.shape[..., None]
        weighted = f.value(x, s) * (x1 - x0) * ((r0 - l0) * (1 - u) + (r1 - l1) * u)
        grid = weighted.reshape(-1, 7, 7)
        q, low_along, low_across = (
            np.einsum("nij,i,j->n", grid, a, b) for a, b in ((_W, _W), (_LOW, _W), (_W, _LOW))
        )
        results.append(np.stack((q, np.abs(q - low_along), np.abs(q - low_across))))
    q, along, across = np.concatenate(results, axis=1)
    return q, along, across
