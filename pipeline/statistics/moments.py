"""One side of a comparison of images: its mean and the error of that mean, per pixel and over regions.

Two kinds of error are kept apart. A variance is that of independent noise: over a region of n pixels it falls
as 1/n. A bound limits the error of a quadrature or of a float32 sum, whose sign is unknown and may be the
same in all pixels: the bound of a region's mean is the mean of its pixels' bounds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.statistics.numerics import box_mean
from scenes.arrays import Array, Mask

WIDE = (9, 27)


@dataclass(frozen=True, eq=False)
class Draws:
    """The independent draws behind each pixel.

    count: draws a pixel. least, largest: (3,), of the whole image by channel; least is 0 if none is negative.
    """

    count: int
    least: Array
    largest: Array


@dataclass(frozen=True, eq=False)
class Moments:
    """One side of a comparison of images.

    mean, variance (of the mean): (h, w, 3) float64. dof: degrees of freedom behind the variance; inf if the
    variance is known or the mean exact. samples: independent samples a pixel; None if unknown or if the mean
    is exact. bound: (h, w, 3), the largest systematic error of the mean, or None. draws: the extremes of
    single draws, or None if unknown (few_events.py).
    """

    mean: Array
    variance: Array
    dof: float | int
    samples: float | int | None = None
    bound: Array | None = None
    draws: Draws | None = None

    def __post_init__(self) -> None:
        if self.mean.shape != self.variance.shape:
            raise ValueError(
                f"mean and variance of different shapes: {self.mean.shape} and {self.variance.shape}"
            )
        if np.any(np.isfinite(self.mean) & ~(self.variance >= 0)):
            raise ValueError("a variance is negative or undefined: it takes 2 samples or batches at least")
        if self.bound is not None and (self.bound.shape != self.mean.shape or not np.all(self.bound >= 0)):
            raise ValueError("an error bound is negative, undefined or of another shape than the mean")

    @property
    def exact(self) -> bool:
        """Whether the mean has no random error."""
        return self.samples is None and not np.any(self.variance)

    @property
    def slack(self) -> Array:
        """The bound (h, w, 3) of the systematic error; 0 if there is none."""
        return np.zeros_like(self.mean) if self.bound is None else self.bound


def batch_moments(batches: Array, samples: float | int | None = None) -> Moments:
    """The moments of independent batches (b, h, w, 3) of equal size, b >= 2. samples: a pixel, in all."""
    count = batches.shape[0]
    return Moments(np.mean(batches, axis=0), np.var(batches, axis=0, ddof=1) / count, count - 1, samples)


def floor_by_other(side: Moments, other: Moments) -> Moments:
    """Raise the variance of `side` to the other side's, scaled to the number of samples of `side`."""
    if side.samples is None or other.samples is None:
        return side
    known = np.where(np.isfinite(other.variance), other.variance, 0.0)
    return replace(side, variance=np.maximum(side.variance, known * (other.samples / side.samples)))


def floor_by_neighbours(side: Moments) -> Moments:
    """Raise the variance of `side` to its mean over the 3 x 3 pixels around, by channel."""
    # The filter's running sum would carry a nan along.
    finite = np.where(np.isfinite(side.variance), side.variance, 0.0)
    around = box_mean(finite, 3)
    return replace(side, variance=np.maximum(side.variance, around))


def finite_variances(side: Moments, other: Moments) -> tuple[Array, Array]:
    """Both variances (h, w, 3), with 0 for values that are not finite, ready to be summed.

    The first is also 0 in pixels where the other side is exactly black.
    """
    black = (other.mean == 0) & (other.variance == 0)
    own, known = (np.where(np.isfinite(v), v, 0.0) for v in (side.variance, other.variance))
    return np.where(black, 0.0, own), known


def floor_by_excess(side: Moments, other: Moments) -> Moments:
    """Raise the variance of `side` to the other side's, scaled to its samples, plus its own excess nearby.

    The excess is the greatest difference of means over WIDE pixels square, 0 if both sides sample alike.
    """
    if side.samples is None or other.samples is None:
        return side
    own, known = finite_variances(side, other)
    known = known * (other.samples / side.samples)
    excess = np.maximum.reduce([box_mean(own, size) - box_mean(known, size) for size in WIDE])
    return replace(side, variance=np.maximum(side.variance, known + np.maximum(excess, 0.0)))


def over_grid(side: Moments, grid: tuple[int, int]) -> Moments:
    """Means over a grid of regions (rows, columns), with Satterthwaite's degrees of freedom [welch1947].

    A sum over independent pixels has the variance sum v and (sum v)^2 / sum(v^2 / dof) degrees of freedom.
    The least over regions and channels is used, which is always in the hundreds. Bounds are averaged.
    """
    variance = grid_sums(side.variance, grid)
    with np.errstate(invalid="ignore", divide="ignore"):
        dof = variance**2 / grid_sums(side.variance**2 / side.dof, grid)
    pixels = grid_sums(np.ones_like(side.mean), grid)
    least = float(np.min(np.where(np.isfinite(dof), dof, np.inf)))
    bound = None if side.bound is None else grid_sums(side.bound, grid) / pixels
    return Moments(grid_sums(side.mean, grid) / pixels, variance / pixels**2, least, side.samples, bound)


def over_mask(side: Moments, mask: Mask) -> Moments:
    """The moments of the pixels of a mask (h, w), as one row (1, n, 3)."""
    bound = None if side.bound is None else side.bound[mask][None]
    return replace(side, mean=side.mean[mask][None], variance=side.variance[mask][None], bound=bound)


def grid_sums(image: Array, grid: tuple[int, int]) -> Array:
    """Sums (rows, columns, 3) of an image (h, w, 3) over a grid of regions, equal to a row and a column."""
    rows, columns = (np.arange(n) * size // n for n, size in zip(grid, image.shape[:2], strict=True))
    return np.add.reduceat(np.add.reduceat(image, rows, axis=0), columns, axis=1)
