"""Distributions over the texels of images: one texel's row by the marginal, its column by the row's own
distribution.

Sampling inverts the two cumulative sums, so that strata of the unit square stay connected [pharr2023, sec.
A.5.6].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats

Integers = NDArray[np.integer]
BELOW_ONE = 1.0 - 2.0**-53


@dataclass(frozen=True, eq=False)
class Place:
    """Points in images. row, column: (n,) of the texel; x, y: (n,) in [0, 1), where in it, along the row and
    down the column.
    """

    row: Integers
    column: Integers
    x: Floats
    y: Floats


@dataclass(frozen=True, eq=False)
class PiecewiseConstant2D:
    """k distributions, each over the texels of its own image, uniform inside a texel.

    marginal: (k, a) cumulative sums over rows, marginal[i, 0] = 0, 1 from the image's height on; a - 1 is a
    power of two. conditional: (m, b) the same over the columns of every row of every image. first: (k,) where
    an image's rows start. empty: (k,) bool, images without any weight: their samples are uniform and mean
    nothing.
    """

    marginal: Floats
    conditional: Floats
    first: NDArray[np.int64]
    empty: NDArray[np.bool_]

    @staticmethod
    def of(weights: Sequence[Floats]) -> PiecewiseConstant2D:
        """Distributions in proportion to weights, one (h, w) array for each image, finite and not
        negative.
        """
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
        """(h, w): the chance of each texel of an image, exactly as `sample` deals it out; all 0 where it is
        empty.

        A texel below 1e-16 of its row, or a row below 1e-16 of its image, may have none: its cumulative sum
        does not grow.
        """
        if self.empty[image]:
            return np.zeros((height, width))
        start = self.first[image]
        across = np.diff(self.conditional[start : start + height, : width + 1], axis=1)
        return across * np.diff(self.marginal[image, : height + 1])[:, None]

    def sample(self, index: Integers, u: Floats) -> Place:
        """A point for each row. index: (n,) which image. u: (2, n) in [0, 1): u[1] picks the row, u[0] the
        column.
        """
        row, y = _search(self.marginal, index, u[1])
        column, x = _search(self.conditional, self.first.take(index) + row, u[0])
        return Place(row, column, x, y)

    def invert(self, index: Integers, place: Place) -> Floats:
        """The u (2, n) that `sample` takes to a place; within a texel of no chance, the one value that it is
        passed over at.
        """
        line = self.first.take(index) + place.row
        return np.stack(
            [
                _between(self.conditional, line, place.column, place.x),
                _between(self.marginal, index, place.row, place.y),
            ]
        )


def _stride(count: int) -> int:
    """Entries of a cumulative sum over `count` cells, made up to a power of two and one."""
    return (1 << (count - 1).bit_length()) + 1


def _cumulative(weights: Floats, stride: int) -> Floats:
    """(m, stride): from 0 up to exactly 1 at the last cell, 1 thereafter; lines without weight are uniform.
    weights: (m, c).
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


def _search(sums: Floats, line: Integers, u: Floats) -> tuple[NDArray[np.int64], Floats]:
    """The cell (n,) with sums[cell] <= u < sums[cell + 1] of each row's line, and how far into it u is, in
    [0, 1).

    Halving steps of a fixed number, all rows at once: a row's bits are its own. Cells of no width are never
    picked.
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
    """The inverse of `_search`."""
    stride, flat = int(sums.shape[1]), sums.reshape(-1)
    at = line.astype(np.int64) * stride + cell
    low = flat.take(at)
    return low + fraction * (flat.take(at + 1) - low)
