"""Can the variance of these samples be believed? Hill's tail index and the largest sample's share.

A sample mean comes with a standard error only if the samples have a variance, and a heavy tail hides itself:
until a sample falls into the peak, mean and standard error are both too small, and agree with each other. Two
signs show it from the samples alone.

Share: one sample that carries a tenth of the sum. Drawing it anew moves the mean by a tenth or more.

Tail index: among the k largest of n samples, P(W > w) ~ w^-alpha. Hill's estimator [hill1975] is the
reciprocal of the mean log-excess over the (k+1)-st largest; for an exact power law alpha / estimate is a mean
of k unit exponentials, which gives the interval. Below 2 the variance is infinite as far as the samples show.
Here k = floor(sqrt(n)), which grows while k/n falls, as consistency asks [mason1982]. With bounded weights
the largest samples crowd at the bound, the log-excesses shrink and the index goes to infinity, so that the
sign is silent; a power law that is cut off inside the range the samples have already reached (a light at some
distance) reads as a large index likewise, and rightly: there is no unseen peak.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.statistics.numerics import gamma_quantile
from scenes.arrays import Array

SHARE_LIMIT = 0.1  # a new draw of this one sample would move the mean by a tenth
INDEX_LIMIT = 2.0  # a power law with a smaller index has no variance
TOP_LEAST = 10  # k = 10 has a relative standard error of 1/sqrt(10) = 32 %; with fewer the index says nothing
SAMPLES_LEAST = TOP_LEAST**2  # as k is the root of n


@dataclass(frozen=True)
class TailIndex:
    """Hill's index of the `top` largest samples with its 95 % interval; infinite if they are all equal."""

    value: float
    low: float
    high: float
    top: int

    @property
    def heavy(self) -> bool:
        """True below 2; at a true index of 2 errors of either kind are equally likely."""
        return self.value < INDEX_LIMIT

    def __str__(self) -> str:
        return (
            f"the tail index of the {self.top:,} largest is {self.value:.3g} ({self.low:.3g} to "
            f"{self.high:.3g})"
        )


def tail_index(largest: Array, drawn: int) -> TailIndex | None:
    """Hill's estimator [hill1975] over the floor(sqrt(drawn)) largest samples, or over all given positive
    ones.

    largest: (k,), the largest of `drawn` samples, in any order; values that are not finite are left out. None
    for fewer than 100 samples drawn, or fewer than 11 positive ones. The interval is exact for a power law.
    """
    positive = np.sort(largest[(largest > 0) & np.isfinite(largest)])[::-1]
    top = min(int(np.sqrt(drawn)), positive.size - 1)
    if drawn < SAMPLES_LEAST or top < TOP_LEAST:
        return None
    excess = float(np.log(positive[:top] / positive[top]).mean())
    if excess == 0.0:
        return TailIndex(np.inf, np.inf, np.inf, top)
    low, high = (gamma_quantile(p, top) / top / excess for p in (0.025, 0.975))
    return TailIndex(1.0 / excess, low, high, top)


def largest_share(largest: Array, total: float) -> float:
    """The largest sample's share of the `total` of all samples; 0 if that is 0. largest: (k,)."""
    return float(np.max(largest, initial=0.0) / total) if total > 0 else 0.0
