"""Batches of samples merged into one image with the variance of its mean, and how precise that image is.

A batch is an image of some samples a pixel from a seed of its own. Batches may differ in size: one of w
samples has the variance s^2 / w, so that weights w give the best mean. With W the sum of weights,

    s^2 = sum of w_i (x_i - mean)^2 / (B - 1),    variance of the mean = s^2 / W

is unbiased for any sizes; the update is West's [west1979]. A sum can be stored and continued later.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float64]

FLOOR = 0.1  # of the image's mean: a darker pixel's standard error is relative to this
TAIL = 10.0  # times the target: the limit of the 99th percentile of pixels


@dataclass(frozen=True, eq=False)
class Accumulator:
    """mean, m2 (sum of weighted squared deviations): (h, w, 3) float64. spp: samples a pixel in all."""

    mean: Image
    m2: Image
    spp: int = 0
    batches: int = 0
    seconds: float = 0.0

    def add(self, image: Image, spp: int, seconds: float) -> Accumulator:
        """Add one batch: `image` (h, w, 3) is the mean of `spp` samples a pixel."""
        total = self.spp + spp
        delta = image - self.mean
        mean = self.mean + delta * (spp / total)
        m2 = self.m2 + spp * delta * (image - mean)
        return Accumulator(mean, m2, total, self.batches + 1, self.seconds + seconds)

    @property
    def variance(self) -> Image:
        """Variance of the mean, (h, w, 3); infinite below two batches."""
        if self.batches < 2:
            return np.full_like(self.mean, np.inf)
        return self.m2 / (self.spp * (self.batches - 1))


@dataclass(frozen=True)
class Precision:
    """Median and 99th percentile over the image of the pixels' relative standard errors."""

    median: float
    p99: float

    def excess(self, target: float) -> float:
        """The factor by which the image misses `target`, at most 1 if it meets it.

        It meets it if the median is at most `target` and the 99th percentile at most TAIL times as much. The
        samples needed grow as the square of the factor.
        """
        return max(self.median / target, self.p99 / (TAIL * target))


def empty_accumulator(height: int, width: int) -> Accumulator:
    """An accumulator without batches, for images of this size in pixels."""
    return Accumulator(np.zeros((height, width, 3)), np.zeros((height, width, 3)))


def precision(mean: Image, variance: Image) -> Precision:
    """The precision of an image (h, w, 3) with the variance of its mean.

    A pixel's error is the root mean square over its channels, its value their mean. Values are raised to
    FLOOR times the image's mean: at the rim of an umbra, where the value tends to 0, no finite number of
    samples would suffice.
    """
    value = np.abs(mean).mean(axis=-1)
    floor = FLOOR * float(value.mean())
    error = np.sqrt(variance.mean(axis=-1))
    if floor == 0:
        worst = float(error.max(initial=0.0))
        return Precision(0.0 if worst == 0 else np.inf, 0.0 if worst == 0 else np.inf)
    median, p99 = np.quantile(error / np.maximum(value, floor), (0.5, 0.99))
    return Precision(float(median), float(p99))
