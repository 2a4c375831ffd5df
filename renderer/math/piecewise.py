"""Distributions over the texels of images: the row of a texel by the marginal, its column by the row's own
distribution.

Sampling inverts the two cumulative sums, so that strata of the unit square stay connected [pharr2023, sec.
A.5.6].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats
from scenes.arrays import Index, Mask

Integers = NDArray[np.integer]
BELOW_ONE = 1.0 - 2.0**-53


@dataclass(frozen=True, eq=False)
class Place:
    """Points in images. row, column: (n,) of the texel. x, y: (n,) in [0, 1), the place in the texel, along
    the row and down the column.
    """

    row: Integers
    column: Integers
    x: Floats
    y: Floats


@dataclass(frozen=True, eq=False)
class PiecewiseConstant2D:
    """k distributions, each over the texels of its own image and uniform inside a texel.

    marginal: (k, a) cumulative sums over rows: 0 first, and 1 from the image's height on; a - 1 is a power of
    two. conditional: (m, b) cumulative sums over the columns of every row of every image. first: (k,) the
    line of `conditional` where an image starts. empty: (k,) images without weight, whose samples are uniform
    and mean nothing.
    """

    marginal: Floats
    conditional: Floats
    first: Index
    empty: Mask

    @staticmethod
    def of(weights: Sequence[Floats]) -> PiecewiseConstant2D:
        """Distributions in proportion to weights: one (h, w) array an image, finite and not negative."""
        # By the largest first: sums of weights near the end of the range would overflow.
        scaled = [w / w.max() if w.max() > 0 else w for w in weights]
        columns = _stride(max(w.shape[1] for w in scaled))
        rows = _stride(max(w.shape[0] for w in scaled))
        heights = np.array([w.shape[0] for w in scaled], dtype=np.int64)
        return PiecewiseConstant2D(
            np.concatenate([_cumulative(w.sum(axis=1)[None, :], rows) for w in scaled]),
            np.concatenate([_cumulative(w, columns) for w in scaled]),
            np.cumsum(heights) - heights,
            np.array([not w.any() for w in scaled], dtype=np.bool_),
        )

    def probability(self, image: int, height: int, width: int) -> Floats:
        """(h, w): the probability of each texel of an image, exactly as `sample` chooses it; 0 for an empty
        image.

        A texel below 1e-16 of its row, or a row below 1e-16 of its image, may get 0, since its cumulative sum
        does not grow.
        """
        if self.empty[image]:
            return np.zeros((height, width))
        start = self.first[image]
        across = np.diff(self.conditional[start : start + height, : width + 1], axis=1)
        return across * np.diff(self.marginal[image, : height + 1])[:, None]

    def sample(self, index: Integers, u: Floats) -> Place:
        """One point a row. index: (n,) the image. u: (2, n) in [0, 1): u[1] picks the row, u[0] the
        column.
        """
        row, y = _search(self.marginal, index, u[1])
        column, x = _search(self.conditional, self.first.take(index) + row, u[0])
        return Place(row, column, x, y)

    def invert(self, index: Integers, place: Place) -> Floats:
        """The u (2, n) from which `sample` makes a place. For a texel of probability 0, the u at which it is
        skipped.
        """
        line = self.first.take(index) + place.row
        return np.stack(
            [
                _between(self.conditional, line, place.column, place.x),
                _between(self.marginal, index, place.row, place.y),
            ]
        )


def _stride(count: int) -> int:
    """The length of a cumulative sum over `count` cells, rounded up to a power of two plus one."""
    return (1 << (count - 1).bit_length()) + 1


def _cumulative(weights: Floats, stride: int) -> Floats:
    """Cumulative sums (m, stride) of weights (m, c): from 0 to exactly 1 at the last cell, and 1 after it. A
    line without weight is uniform.
    """
    lines, count = weights.shape
    out = np.ones((lines, stride))
    total = np.cumsum(weights, axis=1)
    end = total[:, -1:]
    out[:, 0] = 0.0
    # Cells of no weight at the end are end / end, which is 1 without rounding: no u below 1 reaches them.
    uniform = np.arange(1.0, count + 1.0) / count
    out[:, 1 : count + 1] = np.where(end > 0, total / np.where(end > 0, end, 1.0), uniform)
    return out


def _search(sums: Floats, line: Integers, u: Floats) -> tuple[Index, Floats]:
    """The cell (n,) with sums[cell] <= u < sums[cell + 1] in each row's line, and the place of u in it, in
    [0, 1).

    The number of halving steps is fixed, so that a row's bits do not depend on others. Cells of no width are
    never picked.
    """
    stride, flat = int(sums.shape[1]), sums.reshape(-1)
    start = line.astype(np.int64) * stride
    at = start.copy()
    step = (stride - 1) >> 1
    while step:
        # Multiplied, not chosen by np.where: half the time.
        at += (flat.take(at + step) <= u) * step
        step >>= 1
    low = flat.take(at)
    # u is below the upper sum, and rounding keeps the two differences and their quotient in that order: below
    # 1.
    return at - start, (u - low) / (flat.take(at + 1) - low)


def _between(sums: Floats, line: Integers, cell: Integers, fraction: Floats) -> Floats:
    """The u of a place in a cell: the inverse of `_search`."""
    stride, flat = int(sums.shape[1]), sums.reshape(-1)
    at = line.astype(np.int64) * stride + cell
    low = flat.take(at)
    return low + fraction * (flat.take(at + 1) - low)


@dataclass(frozen=True, eq=False)
class WindowedPiecewiseConstant2D:
    """k densities over the unit square, constant on the cells of square grids. Each sample cuts its grid to a
    window of its own.

    size: (k,) cells along a side. first: (k,) a grid's first cell. value: (m,) of all cells. corner: (k,) a
    grid's first sum. below: the integral from the origin to each of the (size + 1)^2 corners, row by row;
    bilinear interpolation of it is exact everywhere [pharr2023, sec. A.5.7].
    """

    size: Index
    first: Index
    value: Floats
    corner: Index
    below: Floats

    @staticmethod
    def of(values: Sequence[Floats]) -> WindowedPiecewiseConstant2D:
        """Densities in proportion to values: one (h, h) array a grid, finite and not negative."""
        size = np.array([len(v) for v in values], dtype=np.int64)
        sums = [np.pad(v.cumsum(axis=0).cumsum(axis=1) / v.size, ((1, 0), (1, 0))) for v in values]
        corners = (size + 1) ** 2
        return WindowedPiecewiseConstant2D(
            size,
            np.cumsum(size**2) - size**2,
            np.concatenate([v.ravel() for v in values]),
            np.cumsum(corners) - corners,
            np.concatenate([s.ravel() for s in sums]),
        )

    @property
    def total(self) -> Floats:
        """The integrals (k,) over the whole square."""
        return self.below[self.corner + (self.size + 1) ** 2 - 1]

    def sample(self, index: Integers, low: Floats, high: Floats, u: Floats) -> tuple[Floats, Floats]:
        """A point (2, n) in each row's window, and its density (n,), which is 0 in a window without weight.

        index: (n,) the grid. low, high: (2, n) ends of the windows in [0, 1]. u: (2, n) in [0, 1): u[0] picks
        the first coordinate, u[1] the second.
        """
        size = self.size.take(index)
        low, high = (np.broadcast_to(end, u.shape) for end in (low, high))

        def across(x: Floats) -> Floats:
            return self._integral(index, low[0], x, low[1], high[1])

        x = _invert(across, low[0], high[0], size, u[0])
        column = np.minimum((x * size).astype(np.int64), size - 1)
        left, right = column / size, (column + 1) / size

        def down(y: Floats) -> Floats:
            return self._integral(index, left, right, low[1], y)

        place = np.stack([x, _invert(down, low[1], high[1], size, u[1])])
        return place, self.density(index, low, high, place)

    def density(self, index: Integers, low: Floats, high: Floats, place: Floats) -> Floats:
        """The density (n,) of `sample` at places (2, n) in their windows."""
        size = self.size.take(index)
        column, row = np.minimum((place * size).astype(np.int64), size - 1)
        whole = self._integral(index, low[0], high[0], low[1], high[1])
        cell: Index = self.first.take(index) + row * size + column
        value = self.value.take(cell)
        return np.divide(value, whole, out=np.zeros_like(value), where=whole > 0)

    def _integral(self, index: Integers, x0: Floats, x1: Floats, y0: Floats, y1: Floats) -> Floats:
        """Integrals (n,) over rectangles; rounding takes none below 0."""
        upper = self._below(index, x1, y1) - self._below(index, x0, y1)
        return np.maximum(upper - (self._below(index, x1, y0) - self._below(index, x0, y0)), 0.0)

    def _below(self, index: Integers, x: Floats, y: Floats) -> Floats:
        size = self.size.take(index)
        (column, right), (row, down) = (_cell_of(v, size) for v in (x, y))
        at = self.corner.take(index) + row * (size + 1) + column
        top, bottom = (
            self.below.take(line) * (1.0 - right) + self.below.take(line + 1) * right
            for line in (at, at + size + 1)
        )
        return top * (1.0 - down) + bottom * down


def _cell_of(v: Floats, size: Integers) -> tuple[Index, Floats]:
    """The cell (n,) of coordinates in [0, 1], and their place in it, in [0, 1]."""
    cell = np.minimum((v * size).astype(np.int64), size - 1)
    return cell, v * size - cell


def _invert(
    integral: Callable[[Floats], Floats], low: Floats, high: Floats, size: Integers, u: Floats
) -> Floats:
    """The place in [low, high] where the integral reaches the share u (n,) of its value at `high`; it is
    linear in a cell.

    A bisection over the edges of cells takes the same number of steps in every row, so that a row's bits do
    not depend on others.
    """
    wanted = u * integral(high)
    first, last = np.floor(low * size).astype(np.int64), np.ceil(high * size).astype(np.int64)
    for _ in range(int(size.max(initial=1)).bit_length() + 1):
        middle = (first + last) >> 1
        before = (integral(np.clip(middle / size, low, high)) <= wanted) & (last - first > 1)
        first = np.where(before, middle, first)
        last = np.where(before | (last - first <= 1), last, middle)
    start, end = (np.clip(edge / size, low, high) for edge in (first, last))
    from_, to = integral(start), integral(end)
    share = np.divide(wanted - from_, to - from_, out=np.zeros_like(u), where=to > from_)
    # Not beyond the cell by rounding: the density of the next one may be another.
    inside = np.minimum(start + (end - start) * np.clip(share, 0.0, 1.0), np.nextafter(last / size, 0.0))
    return np.clip(np.maximum(inside, start), low, high)
