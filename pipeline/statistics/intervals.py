"""Intervals of means over replicates, of products and ratios, of efficiency, and of an MSE over seeds.

Each cell of a sweep is rendered with several seeds. These replicates are independent whatever the sampler.
The film's M2 is a variance for independent samples only; under Sobol it is up to thousands of times too
large.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.schema.record import Score
from pipeline.statistics.numerics import bootstrap_ends, normal_tail, student_tail
from scenes.arrays import Array

CONFIDENCE = 0.95
NORMAL = normal_tail((1 - CONFIDENCE) / 2)  # 1.96
BOOTSTRAP_LEAST = 10
ENOUGH_REPLICATES = 3  # with two, Student's factor is 12.7: the interval says nothing


@dataclass(frozen=True)
class Interval:
    """An estimate with the ends of its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class ReplicateMse:
    """An MSE over replicate seeds. value: None if undefined, for the reason in `note`.

    bound: whether `value` is an upper bound, since the error is below the reference's noise.
    """

    value: float | None
    low: float | None
    high: float | None
    bound: bool
    note: str = ""


def mean_interval(values: Array | Sequence[float], confidence: float = CONFIDENCE) -> Interval:
    """Mean of independent, equally distributed values (r,) with Student's interval.

    The ends are nan for a single value and where one is infinite.
    """
    x = np.asarray(values, dtype=np.float64)
    if x.size == 0:
        raise ValueError("no values")
    mean = float(np.mean(x))
    if x.size == 1 or not np.isfinite(x).all():
        return Interval(mean, math.nan, math.nan)
    half = float(student_tail((1 - confidence) / 2, x.size - 1) * np.std(x, ddof=1) / math.sqrt(x.size))
    return Interval(mean, mean - half, mean + half)


def replicate_interval(values: Array | Sequence[float]) -> Interval:
    """Mean over replicates, with Student's interval below ten of them, else the BCa bootstrap's [efron1987].

    A bootstrap of three values has ten outcomes and covers three quarters. Student's interval covers 95 %,
    since scores are means over an image and so nearly normal. Equal replicates have an interval of width 0.
    values: (r,), finite.
    """
    x = np.asarray(values, dtype=np.float64)
    if x.size < BOOTSTRAP_LEAST or np.ptp(x) == 0.0:
        return mean_interval(x)
    return Interval(float(np.mean(x)), *bootstrap_ends(x, CONFIDENCE))


def product(*factors: tuple[Interval, float]) -> Interval:
    """The product of independent positive quantities to powers. factors: (interval, power) each.

    The distances of the ends are added in quadrature on the logarithmic scale, each side by itself, so that
    intervals may be skewed: the MOVER method [zou2008]. A factor's end at or below 0 gives an end at 0 or
    infinity.
    """
    value, below, above = 0.0, 0.0, 0.0
    for factor, power in factors:
        if factor.value <= 0:
            raise ValueError(f"a product on the logarithmic scale needs positive values, not {factor.value}")
        center = math.log(factor.value)
        down, up = center - _log(factor.low), _log(factor.high) - center
        value += power * center
        below += (power * (down if power > 0 else up)) ** 2
        above += (power * (up if power > 0 else down)) ** 2
    return Interval(_exp(value), _exp(value - math.sqrt(below)), _exp(value + math.sqrt(above)))


def efficiency(mse: Interval, seconds: Interval) -> Interval:
    """1 / (MSE x seconds), the reciprocal of an error's cost, with its interval [pharr2023] chapter 2."""
    if mse.value == 0:
        worst = mse.high * seconds.high
        return Interval(math.inf, 1.0 / worst if worst > 0 else math.inf, math.inf)
    return product((mse, -1.0), (seconds, -1.0))


def replicate_mse(scores: Sequence[Score]) -> ReplicateMse:
    """The mean MSE of replicate seeds, with Student's interval over them.

    The interval of fewer than three replicates is pooled from their own instead. One undefined replicate
    makes the result undefined. One below the reference's noise makes it an upper bound: the mean of all upper
    ends.
    """
    if not scores:
        raise ValueError("no replicates")
    missing = [score for score in scores if score.value is None or score.low is None or score.high is None]
    if missing:
        return ReplicateMse(None, None, None, False, missing[0].note)
    values = np.array([[score.value, score.low, score.high] for score in scores], dtype=np.float64)
    if any(score.bound for score in scores):
        upper = float(np.mean(values[:, 2]))
        return ReplicateMse(upper, 0.0, upper, True, "below reference noise")
    over = mean_interval(values[:, 0]) if len(scores) >= ENOUGH_REPLICATES else _pooled(values)
    return ReplicateMse(over.value, max(over.low, 0.0), over.high, False)


def _pooled(values: Array) -> Interval:
    """The mean of independent estimates, each with its own ends. values: (r, 3), value, low and high."""
    center = float(np.mean(values[:, 0]))
    below, above = values[:, 0] - values[:, 1], values[:, 2] - values[:, 0]
    count = values.shape[0]
    return Interval(
        center, center - float(np.linalg.norm(below)) / count, center + float(np.linalg.norm(above)) / count
    )


def _exp(x: float) -> float:
    """exp(x), infinity where it overflows."""
    return math.exp(x) if x < 709 else math.inf


def _log(x: float) -> float:
    """log(x), minus infinity at or below 0."""
    return math.log(x) if x > 0 else -math.inf
