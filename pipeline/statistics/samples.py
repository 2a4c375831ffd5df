"""The verdict on samples without a reference: their noise, their largest share, their tail index."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.schema.record import SampleStatistics, Verdict
from pipeline.statistics.heavy_tail import SHARE_LIMIT, TailIndex, largest_share, tail_index
from scenes.arrays import Array

SPIKE_LIMIT = 0.5  # above it the variance rests on fewer than two samples a pixel
SPIKE_SAMPLES = 16  # of fewer samples the largest makes up much of the spread even where all is well


class SampleVerdict(NamedTuple):
    """A verdict, its reason in a sentence, and the figures behind it."""

    max_share: float
    hill: float | None
    verdict: Verdict
    reason: str


def sample_verdict(values: Array) -> SampleVerdict:
    """Judge whether the samples of one integral have a standard error that can be believed.

    values: (n,), non-negative, zeros included. "untrustworthy" if a value is not finite, if one sample
    carries a tenth of the sum, or if Hill's index is below 2.
    """
    finite = values[np.isfinite(values)]
    share = largest_share(finite, float(np.sum(finite)))
    index = tail_index(finite, finite.size)
    return _judge(share, index, int(values.size - finite.size), int(finite.size), spike=None)


def sample_statistics(
    *,
    mean: Array,
    m2: Array,
    count: NDArray[np.int64] | Array,
    tail: Array,
    reflected: int,
    reflected_sum: float,
    nonfinite: int,
    maximum: Array | None = None,
) -> SampleStatistics:
    """Noise, shares and verdict of a render, from the arrays of its film and the counts of its result.

    mean, m2: (h, w, 3), mean and sum of squared deviations of each pixel's samples. count: (h, w). tail:
    (k,), the largest luminances among the `reflected` samples of reflected light of the whole image, whose
    sum is `reflected_sum`. nonfinite: samples that were not finite. maximum: (h, w, 3), the largest reflected
    sample of each pixel and channel.

    Pooled over an image, the tail index of a perfectly sampled small light close to a floor is small too,
    because the image itself has that range. With `maximum`, from 16 samples a pixel on, a small index counts
    only if single samples make up most of the measured variance (`spike_share`).
    """
    share = largest_share(tail, reflected_sum)
    index = tail_index(tail, reflected)
    spike = spike_share(mean, m2, count, maximum) if maximum is not None else None
    verdict = _judge(share, index, nonfinite, reflected, spike)
    return SampleStatistics(
        noise=image_noise(m2, count),
        max_share=share,
        hill=verdict.hill,
        nonfinite=nonfinite,
        verdict=verdict.verdict,
        reason=verdict.reason,
    )


def image_noise(m2: Array, count: NDArray[np.int64] | Array) -> float:
    """Root mean square over pixels and channels of the standard error of independent samples.

    m2: (h, w, 3) float64, sums of squared deviations. count: (h, w). nan below 2 samples.
    """
    n = np.asarray(count, dtype=np.float64)[..., None]
    if np.min(n) < 2:
        return float("nan")
    return float(np.sqrt(np.mean(m2 / (n * (n - 1)))))


def spike_share(mean: Array, m2: Array, count: NDArray[np.int64] | Array, maximum: Array) -> float | None:
    """The share of each pixel's largest sample in the squared deviations of all samples, 0 to 1.

    mean, m2, maximum: (h, w, 3). count: (h, w). The measured variance rests on the reciprocal of the share,
    in samples a pixel. n samples give 3/n if uniform, about 2 ln(n)/n if normal, and 2/n over a penumbra; a
    peak that few samples have found gives nearly 1. Channels whose mean exceeds the largest reflected sample
    see a light directly and are left out. None below 16 samples a pixel, or without any spread.
    """
    if np.min(count) < SPIKE_SAMPLES:
        return None
    reflected = (mean <= maximum) & np.isfinite(m2) & np.isfinite(maximum)
    spread = float(np.sum(m2, where=reflected))
    if spread <= 0.0:
        return None
    excess = np.where(reflected, maximum, 0.0) - np.where(reflected, mean, 0.0)
    return min(1.0, float(np.sum(excess**2)) / spread)


def _judge(
    share: float, index: TailIndex | None, nonfinite: int, drawn: int, spike: float | None
) -> SampleVerdict:
    """Collect the alarms, one sentence each."""
    alarms = [
        text for text in (_of_nonfinite(nonfinite), _of_share(share, drawn), _of_index(index, spike)) if text
    ]
    hill = index.value if index else None
    if alarms:
        return SampleVerdict(share, hill, "untrustworthy", "; ".join(alarms))
    return SampleVerdict(share, hill, "ok", _all_well(share, index, drawn, spike))


def _of_nonfinite(nonfinite: int) -> str | None:
    return f"{nonfinite:,} samples are not finite" if nonfinite else None


def _of_share(share: float, drawn: int) -> str | None:
    if share <= SHARE_LIMIT:
        return None
    return f"one sample of {drawn:,} carries {share:.0%} of the light"


def _of_index(index: TailIndex | None, spike: float | None) -> str | None:
    if index is None or not index.heavy or (spike is not None and spike <= SPIKE_LIMIT):
        return None
    found = f"{index}: below 2, so the samples bound no variance and a larger one may be still to come"
    return found if spike is None else f"{found}; single samples make up {spike:.0%} of the measured variance"


def _all_well(share: float, index: TailIndex | None, drawn: int, spike: float | None) -> str:
    if share == 0.0:
        return f"none of the {drawn:,} samples carries light"
    largest = f"the largest of {drawn:,} samples carries {share:.2g} of the light"
    if index is None:
        return f"{largest}; too few of them are lit for a tail index"
    if index.heavy:
        return (
            f"{largest}; {index}, but it is the image's own range: single samples make up {spike:.0%} "
            "of the variance"
        )
    return f"{largest}; {index}"
