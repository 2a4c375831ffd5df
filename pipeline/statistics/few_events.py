"""The mean of few large samples against a known mean: a test that does not use the samples' own variance.

Where a few large samples of unknown rarity make up the light, the samples' variance is no help: a region that
met none has no variance at all, and a test that divides by it rejects the truth with certainty. Known is how
large samples get: n independent draws from [0, w] (or [v, w], measured
from v) of mean m come to a mean as far off as s with a probability of at most

    2 exp(-n [s/w ln(s/m) + (1 - s/w) ln((1 - s/w) / (1 - m/w))])

whatever their distribution is, and also if each has one of its own (Hoeffding [hoeffding1963], Theorem 1).
Where a region met no light it comes to (1 - m/w)^n: the chance of meeting none of the n m / w samples of the
largest kind that make up the region's light. Where the truth is black any light at all rejects; where no draw
of the whole image met any, nothing is known of w and nothing is tested; where it is nearly black, light that
would have to come from many more large samples than there can be.

The bound w is the largest draw of the whole image, which is the most that the samples can tell; light in
still larger samples that no pixel has met is the business of the heavy-tail guard (heavy_tail.py). Beyond
EVENTS such samples in a region its own variance is believed, as Welch's test is far sharper; with one
correction. Of K events where L were due, mean and variance go as K, so that a mean that is low by chance
comes with a variance that is too low: 65 events or fewer of 100 have a probability of 1.2e-4, and are 4.3 of
their own standard errors, 2e-5, off. The variance is taken for L events, which makes it Poisson's own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.statistics.moments import Draws, Moments
from pipeline.statistics.numerics import relative_entropy
from scenes.arrays import Array, Mask

EVENTS = 100.0  # of the largest draws in a region's light, which then has a relative error of a tenth at most
# standard errors that a sampled reference's mean may be off by: 2e-9, below every level that is asked for
DOUBT = 6.0


def few_events(draws: Draws, pixels: Array, reference: Moments) -> Mask:
    """True for each region whose light, by the reference, is fewer than EVENTS of the largest draws.

    pixels: (..., 3), of each region. reference: (..., 3), over the regions.
    """
    if not np.any(draws.largest > draws.least):
        return np.ones_like(reference.mean, dtype=np.bool_)
    least, largest = _range(draws, reference.mean)
    return reference.mean * pixels * draws.count < EVENTS * (largest - least)


def variance_as_expected(side: Moments, reference: Moments) -> Moments:
    """Raise `side`'s variance to that of the number of events that the reference expects, if fewer came."""
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(side.mean > 0, reference.mean / side.mean, 1.0)
    return replace(side, variance=side.variance * np.maximum(factor, 1.0))


def bounded_p(draws: Draws, pixels: Array, mean: Array, reference: Moments, slack: Array) -> Array:
    """Two-sided p, never too small, of the means of regions if no draw is beyond those of `draws`.

    mean, slack (differences that count as none): (..., 3). pixels, reference: as above. The reference's own
    noise is allowed for by taking the true mean where it fits best, within DOUBT standard errors.
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
