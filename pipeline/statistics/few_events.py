"""A test of a mean of few large samples against a known mean, without the samples' own variance.

A few large, rare samples may make up all the light of a region. If the region met none of them its variance
is 0, and a test that divides by it rejects the truth with certainty. But the size of samples is known: n
independent draws from [0, w] (or [v, w], measured from v) of mean m have a mean as far off as s with a
probability of at most

    2 exp(-n [s/w ln(s/m) + (1 - s/w) ln((1 - s/w) / (1 - m/w))])

for any distribution, and also if each draw has its own (Hoeffding [hoeffding1963], Theorem 1). For a region
that met no light this is (1 - m/w)^n: the chance of meeting none of the n m / w largest samples that would
make up its light. If the truth is black any light rejects. If no draw of the whole image met light, w is
unknown and nothing is tested.

The bound w is the largest draw of the whole image, the most that the samples can tell. Light in still larger
samples, which no pixel has met, is the matter of heavy_tail.py. A region of more than EVENTS such samples is
tested by its own variance, since Welch's test is far sharper, with one correction. With K events instead of
L, mean and variance both go as K: a mean that is low by chance comes with a variance that is too low. 65
events or fewer of 100 have a probability of 1.2e-4, but are 4.3 of their own standard errors (2e-5) off. So
the variance is scaled to L events, which makes it Poisson's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.statistics.moments import Draws, Moments
from pipeline.statistics.numerics import relative_entropy
from scenes.arrays import Array, Mask

EVENTS = 100.0  # of the largest draws in a region's light, which then has a relative error of a tenth at most
DOUBT = 6.0  # standard errors by which a reference's mean may be off: 2e-9, below every level in use


def few_events(draws: Draws, pixels: Array, reference: Moments) -> Mask:
    """True for each region whose light, by the reference, is less than EVENTS of the largest draws.

    pixels: (..., 3), their number in each region. reference: means over the regions, (..., 3).
    """
    if not np.any(draws.largest > draws.least):
        return np.ones_like(reference.mean, dtype=np.bool_)
    least, largest = _range(draws, reference.mean)
    return reference.mean * pixels * draws.count < EVENTS * (largest - least)


def variance_as_expected(side: Moments, reference: Moments) -> Moments:
    """Raise the variance of `side` to that of as many events as the reference expects, if fewer came."""
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(side.mean > 0, reference.mean / side.mean, 1.0)
    return replace(side, variance=side.variance * np.maximum(factor, 1.0))


def bounded_p(draws: Draws, pixels: Array, mean: Array, reference: Moments, slack: Array) -> Array:
    """Upper bounds of the two-sided p-values of regions, if no draw is outside the range of `draws`.

    pixels: (..., 3), their number in each region. mean: (..., 3), of the regions. slack: (..., 3),
    differences that count as none. The true mean is taken where it fits best, within DOUBT standard errors of
    `reference`.
    """
    finite = np.isfinite(mean) & np.isfinite(reference.mean)
    ours, theirs = np.where(finite, mean, 0.0), np.where(finite, reference.mean, 0.0)
    least, largest = _range(draws, ours, theirs)
    reach = np.where(finite, slack, 0.0) + DOUBT * np.sqrt(reference.variance)
    truth = np.clip(np.clip(ours, theirs - reach, theirs + reach), least, largest)
    wide = largest > least
    s, m = (
        np.divide(x - least, largest - least, out=np.zeros_like(least), where=wide) for x in (ours, truth)
    )
    exponent = draws.count * pixels * (relative_entropy(s, m) + relative_entropy(1.0 - s, 1.0 - m))
    # Draws that met no light do not say how large its samples are: such a region is no evidence of bias.
    unknown = (draws.largest <= draws.least) & (ours == draws.least) & (reference.mean > ours)
    return np.where(finite, np.where(unknown, 1.0, np.minimum(1.0, 2.0 * np.exp(-exponent))), 0.0)


def _range(draws: Draws, *means: Array) -> tuple[Array, Array]:
    """The range (..., 3) of draws, widened to hold every given mean."""
    least = np.minimum.reduce([np.broadcast_to(draws.least, means[0].shape), *means])
    return least, np.maximum.reduce([np.broadcast_to(draws.largest, means[0].shape), *means])
