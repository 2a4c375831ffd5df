"""The mean squared error of an estimate against a reference that is noisy itself, with its 95 % interval.

With d = estimate - reference and v the variance of the reference's mean, E[d^2 - v] is the estimate's own squared error,
variance and squared bias, as the two are independent; so v is subtracted pixel by pixel, and the score is the mean of the
map q = mean over channels of (d^2 - v) * weight.

The interval. Pixels are independent (box filter), but each is drawn once and no two are alike, so that the variance of the
mean of q cannot be had from the spread of q over the image: that spread holds the image's own structure. It is had from
the spread within blocks of four neighbours, whose expectation is the variance sought plus the spread of four neighbouring
expectations, never less: the collapsed strata of survey sampling with one unit a stratum [cochran1977] section
5A.12. It asks for no distribution (2/3 of the sum of d^4, the estimate for normal errors, is a third too large across a
penumbra of one sample a pixel, and a third too small for fireflies) and takes the pixel, not the channel, as the unit, so that the channels
may be correlated as they like. Being a scale, the score has its interval on the logarithmic scale, always positive, unless
it drowns in the reference's noise. No interval from one image helps where the errors themselves are heavy-tailed (for lognormal
errors of parameter 1.5 it covers 80 %): the samples' own verdict tells (statistics/samples.py).

Reference noise. Where mean v exceeds a tenth of the measured error, the value is the interval's upper end and is marked as a
bound. Against a deterministic reference (0 batches) v is the square of an error bound b, of unknown sign: nothing is
subtracted, and by the triangle inequality the true root mean square lies within rms(b) of the measured one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.metrics.protocol import Estimate, Image, Reference
from pipeline.statistics.intervals import NORMAL

NOISE_SHARE = 0.1  # of the measured error; more of the reference's own variance makes the figure an upper bound
DEPENDENT = 5.0  # standard errors below zero: an independent estimate is never that close to a noisy reference
BELOW_NOISE = "below reference noise"


@dataclass(frozen=True, eq=False)
class SquaredError:
    """value with its 95 % interval; bound: value is the upper end. note: why it is a bound, or undefined (value None).

    map: (h, w), q of each pixel, negative where the estimate is closer to the reference than that one's own noise; its mean is the
    measured error, which `value` is unless it is a bound.
    """

    value: float | None
    low: float | None
    high: float | None
    bound: bool
    note: str
    map: Image


def squared_error(estimate: Estimate, reference: Reference, weight: Image | float = 1.0) -> SquaredError:
    """The mean over pixels and channels of weight * (d^2 - v), with its interval. weight: (h, w, 3) or one for all.

    All pixels must be finite (see `undefined.defect`).
    """
    raw: Image = np.mean((estimate.mean - reference.mean) ** 2 * weight, axis=-1)
    noise: Image = np.mean(reference.variance * weight, axis=-1)
    if reference.batches == 0:
        return _within_bound(raw, float(np.mean(noise)))
    return _debiased(raw, raw - noise, float(np.mean(noise)))


def standard_error(pixel: Image) -> float:
    """Of the mean of an image of independent pixels, from the spread within blocks of 2 x 2; too small by chance only.

    pixel: (h, w). A block of m pixels adds m times its sample variance to the estimated sum of the pixels' variances; an odd row or
    column joins the block before it. A single pixel stands for its own deviation from 0.
    """
    if pixel.size == 1:
        return float(np.abs(pixel[0, 0]))
    m = _in_blocks(np.ones_like(pixel))
    spread = np.maximum(_in_blocks(pixel**2) - _in_blocks(pixel) ** 2 / m, 0.0) * m / (m - 1)
    return float(np.sqrt(np.sum(spread))) / pixel.size


def _in_blocks(pixel: Image) -> Image:
    """Sums over blocks of 2 x 2 pixels, of 3 at the end of an odd side."""
    down = np.add.reduceat(pixel, _starts(pixel.shape[0]), axis=0)
    return np.add.reduceat(down, _starts(pixel.shape[1]), axis=1)


def _starts(side: int) -> NDArray[np.intp]:
    return np.arange(0, max(side - 1, 1), 2, dtype=np.intp)


def scale_interval(value: float, error: float) -> tuple[float, float]:
    """95 % interval of a positive scale on the logarithmic scale, by the delta method; (0, 0) for 0."""
    if value == 0.0:
        return 0.0, 0.0
    ratio = float(np.exp(NORMAL * error / value))
    return value / ratio, value * ratio


def _debiased(raw: Image, pixel: Image, noise: float) -> SquaredError:
    """Against a reference with a sampled variance. raw: (h, w), d^2. pixel: (h, w), d^2 - v. noise: the mean of v."""
    value, error = float(np.mean(pixel)), standard_error(pixel)
    if value + DEPENDENT * error < 0 and float(np.mean(raw)) < 0.5 * noise:
        note = "closer to the reference than the reference's own noise: the two are not independent"
        return SquaredError(None, None, None, False, note, pixel)
    if noise > NOISE_SHARE * value:
        upper = max(value, 0.0) + NORMAL * error
        return SquaredError(upper, max(value - NORMAL * error, 0.0), upper, True, BELOW_NOISE, pixel)
    return SquaredError(value, *scale_interval(value, error), False, "", pixel)


def _within_bound(raw: Image, squared_bound: float) -> SquaredError:
    """Against a deterministic reference whose error is bounded. raw: (h, w), d^2. squared_bound: the mean of b^2."""
    value = float(np.mean(raw))
    low, high = scale_interval(value, standard_error(raw))
    slack = np.sqrt(squared_bound)
    low, high = max(np.sqrt(low) - slack, 0.0) ** 2, (np.sqrt(high) + slack) ** 2
    bound = squared_bound > NOISE_SHARE * value
    return SquaredError(high if bound else value, low, high, bound, BELOW_NOISE if bound else "", raw)
