"""The film: count, mean, M2 and maximum of each pixel, with the same bits however the work is cut.

Samples of a pixel are reduced in sample order in blocks of 16, and blocks are merged in order by the pairwise
update of [chan1983]. A pixel's numbers depend on its own samples and on nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.math.vectors import Floats
from scenes.arrays import Index

BLOCK = 16
TAIL = 4096
LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear sRGB [iec61966]


def luminance(rgb: Floats) -> Floats:
    """Luminance of linear sRGB. rgb: (3, ...). Returns (...)."""
    return LUMINANCE[0] * rgb[0] + LUMINANCE[1] * rgb[1] + LUMINANCE[2] * rgb[2]


@dataclass(frozen=True, eq=False)
class Film:
    """Statistics of the samples of each pixel and channel.

    count: (h, w) int64. mean, m2: (h, w, 3); m2 is the sum of squared deviations from the mean. maximum: (h,
    w, 3) the largest reflected sample, without light seen directly.
    """

    count: Index
    mean: Floats
    m2: Floats
    maximum: Floats

    def variance_of_mean(self) -> Floats:
        """(h, w, 3) variance of the mean, for independent samples; NaN below two samples.

        The mean of low-discrepancy samples varies far less than this figure says. Its variance takes
        replicates.
        """
        n = self.count[..., None].astype(np.float64)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(n > 1, self.m2 / (n * (n - 1)), np.nan)


class PixelSums:
    """Running statistics of whole pixels, fed a block of samples at a time.

    mean, m2, maximum: (3, p) as in `Film`. reflected: (p,) the sum of the luminances of reflected samples.
    """

    def __init__(self, pixels: int) -> None:
        self.count = 0
        self.mean = np.zeros((3, pixels))
        self.m2 = np.zeros((3, pixels))
        self.maximum = np.zeros((3, pixels))
        self.reflected = np.zeros(pixels)

    def add(self, radiance: Floats, reflected: Floats) -> None:
        """Merge one block. radiance, reflected: (3, b, p), sample-major, b at most BLOCK."""
        self.reflected += _sum_samples(luminance(reflected)[None])[0]
        b = radiance.shape[1]
        total = _sum_samples(radiance)
        mean = total / b
        deviation = radiance - mean[:, None, :]
        deviation *= deviation
        m2 = _sum_samples(deviation)
        np.maximum(self.maximum, reflected.max(axis=1), out=self.maximum)
        n = self.count + b
        delta = mean - self.mean
        self.m2 += m2
        self.m2 += delta * delta * (self.count * b / n)
        self.mean += delta * (b / n)
        self.count = n


class RatioSums:
    """Running statistics for estimators whose pixel is D + A S/U: light seen directly, and three means of
    samples.

    The variance and m2 are those of the linearised ratio (the delta method) [owen2013, sec. 2.7], from the
    covariance of the four.
    """

    def __init__(self, pixels: int) -> None:
        self.count = 0
        self.maximum = np.zeros((3, pixels))
        self.reflected = np.zeros(pixels)
        self._mean = np.zeros((4, 3, pixels))
        self._products = np.zeros((4, 4, 3, pixels))

    def add(self, direct: Floats, shadowed: Floats, closed: Floats, unshadowed: Floats) -> None:
        """Merge one block: D, S, A and U, each (3, b, p), sample-major, b at most BLOCK."""
        self.reflected += _sum_samples(luminance(shadowed)[None])[0]
        np.maximum(self.maximum, shadowed.max(axis=1), out=self.maximum)
        block = np.stack([direct, shadowed, closed, unshadowed])  # (4, 3, b, p)
        b = block.shape[2]
        mean = np.stack([_sum_samples(part) for part in block]) / b
        deviation = block - mean[:, :, None, :]
        n = self.count + b
        delta = mean - self._mean
        for i in range(4):
            for j in range(4):
                self._products[i, j] += _sum_samples(deviation[i] * deviation[j])
                self._products[i, j] += delta[i] * delta[j] * (self.count * b / n)
        self._mean += delta * (b / n)
        self.count = n

    @property
    def mean(self) -> Floats:
        """(3, p): D + A S/U, or D alone where no sample could have found light."""
        direct, _, closed, _ = self._mean
        return direct + closed * self._share

    @property
    def m2(self) -> Floats:
        """(3, p): g' C g for the gradient g of the pixel in D, S, A and U."""
        _, _, closed, unshadowed = self._mean
        slope = _quotient(closed, unshadowed)
        gradient = (np.ones_like(closed), slope, self._share, -slope * self._share)
        out = np.zeros_like(closed)
        for i in range(4):
            for j in range(4):
                out += gradient[i] * gradient[j] * self._products[i, j]
        return np.maximum(out, 0.0)

    @property
    def _share(self) -> Floats:
        return _quotient(self._mean[1], self._mean[3])


def _quotient(a: Floats, b: Floats) -> Floats:
    """a / b, 0 where b is 0."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0)


def _sum_samples(block: Floats) -> Floats:
    """Sum over samples in their order by one ufunc a sample. The order of `np.sum` depends on strides and
    shape.
    """
    out = block[:, 0].copy()
    for sample in range(1, block.shape[1]):
        out += block[:, sample]
    return out


def keep_largest(values: Floats, keep: int = TAIL) -> Floats:
    """The `keep` largest of values (n,), descending. The set does not depend on how the values were cut."""
    if values.size > keep:
        values = np.partition(values, values.size - keep)[values.size - keep :]
    return np.sort(values)[::-1]
