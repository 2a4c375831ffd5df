"""Batches of samples merged into one image with the variance of its mean, and how precise that image is.

A batch is an image of some samples a pixel from a seed of its own. Batches may differ in size: one of w
samples has the variance s^2 / w, so that weights w give the best mean, and with W the sum of weights

    s^2 = sum of w_i (x_i - mean)^2 / (B - 1),    variance of the mean = s^2 / W

is unbiased whatever the sizes are; the update is West's [west1979]. Being a sum, it can be put away and gone
on with.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float64]

FLOOR = 0.1  # of the image's mean: what a darker pixel's standard error is relative to
TAIL = 10.0  # times the target: where the 99th percentile of pixels may lie


@dataclass(frozen=True, eq=False)
class Tally:
    """mean, m2 (sum of weighted squared deviations): (h, w, 3) float64; spp: samples a pixel in all; seconds:
    spent on them.
    """

    mean: Image
    m2: Image
    spp: int = 0
    batches: int = 0
    seconds: float = 0.0

    def add(self, image: Image, spp: int, seconds: float) -> Tally:
        """With one more batch: `image` (h, w, 3), the mean of `spp` samples a pixel."""
        total = self.spp + spp
        delta = image - self.mean
        mean = self.mean + delta * (spp / total)
        m2 = self.m2 + spp * delta * (image - mean)
        return Tally(mean, m2, total, self.batches + 1, self.seconds + seconds)

    @property
    def variance(self) -> Image:
        """Of the mean, (h, w, 3); infinite below two batches, which say nothing of it."""
        if self.batches < 2:
            return np.full_like(self.mean, np.inf)
        return self.m2 / (self.spp * (self.batches - 1))


@dataclass(frozen=True)
class Precision:
    """Standard errors of pixels relative to their values: the median and the 99th percentile over the
    image.
    """

    median: float
    p99: float

    def excess(self, target: float) -> float:
        """By what factor the image is less precise than `target`; at most 1 if it is met.

        Met: the median is at most `target` and the 99th percentile at most TAIL times as much. Samples needed
        go as its square.
        """
        return max(self.median / target, self.p99 / (TAIL * target))


def empty_tally(height: int, width: int) -> Tally:
    """No batches yet."""
    return Tally(np.zeros((height, width, 3)), np.zeros((height, width, 3)))


def precision(mean: Image, variance: Image) -> Precision:
    """Of an image (h, w, 3) with the variance of its mean.

    A pixel's error is the root mean square over its channels, its value their mean; values below FLOOR times
    the image's mean count as that: no finite number of samples would do for the rim of an umbra, where the
    value tends to 0.
    """
    value = np.abs(mean).mean(axis=-1)
    floor = FLOOR * float(value.mean())
    error = np.sqrt(variance.mean(axis=-1))
    if floor == 0:
        worst = float(error.max(initial=0.0))
        return Precision(0.0 if worst == 0 else np.inf, 0.0 if worst == 0 else np.inf)
    median, p99 = np.quantile(error / np.maximum(value, floor), (0.5, 0.99))
    return Precision(float(median), float(p99))
