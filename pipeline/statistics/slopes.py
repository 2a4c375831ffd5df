"""How an error falls with time: straight lines on log-log axes, and the cost of halving the error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.statistics.intervals import CONFIDENCE, NORMAL, Interval
from pipeline.statistics.numerics import student_tail
from scenes.arrays import Array


@dataclass(frozen=True)
class Slope:
    """The line log y = level + value * (log x - center), natural logarithms, through `points` points.

    se, low, high: standard error and 95 % interval of the slope `value`. center: the mean of log x.
    """

    value: float
    se: float
    low: float
    high: float
    center: float
    level: float
    points: int

    def __call__(self, x: float) -> float:
        """The height y of the line at x."""
        return math.exp(self.level + self.value * (math.log(x) - self.center))


def fit_slope(
    x: Sequence[float] | Array,
    y: Sequence[float] | Array,
    y_low: Sequence[float] | Array | None = None,
    y_high: Sequence[float] | Array | None = None,
) -> Slope:
    """A straight line through positive points on log-log axes, with the error of its slope.

    x, y: (n,), n >= 2. y_low, y_high: 95 % intervals of y; given both, a point weighs by the inverse square
    of their distance on the log scale, else all points weigh alike. The error is the greater of two: that of
    the intervals, and that of the scatter about the line (n - 2 degrees of freedom, Student's factor), which
    is larger if the relation is not quite a power law. Without intervals the error of two points is nan.
    """
    log_x, log_y = _logs(x, "x"), _logs(y, "y")
    if log_x.size < 2 or log_x.size != log_y.size:
        raise ValueError(
            f"a slope needs two points at least and a y for each x, not {log_x.size} and {log_y.size}"
        )
    sigma = _log_errors(y_low, y_high, log_y.size)
    weight = np.ones_like(log_y) if sigma is None else sigma**-2.0
    center, height = float(np.average(log_x, weights=weight)), float(np.average(log_y, weights=weight))
    spread = float(np.sum(weight * (log_x - center) ** 2))
    if spread == 0.0:
        raise ValueError("all points have the same x")
    slope = float(np.sum(weight * (log_x - center) * (log_y - height)) / spread)
    residual = log_y - height - slope * (log_x - center)
    unit, factor = _scale(float(np.sum(weight * residual**2)), log_y.size - 2, sigma is not None)
    se = unit / math.sqrt(spread)
    half = factor * se
    return Slope(slope, se, slope - half, slope + half, center, height, log_x.size)


def halving_cost(slope: Slope) -> Interval:
    """The factor in time that halves the error, 2^(-1/slope), with its 95 % interval; 4 for a slope of -1/2.

    Infinite where the slope, or the end of its interval, is not negative: no time is enough.
    """
    return Interval(_halving(slope.value), _halving(slope.low), _halving(slope.high))


def _scale(misfit: float, dof: int, weighted: bool) -> tuple[float, float]:
    """Standard error of a point of unit weight and its interval's factor, by the greater product."""
    implied = (1.0, NORMAL) if weighted else (math.nan, math.nan)
    if dof == 0:
        return implied
    scattered = (math.sqrt(misfit / dof), float(student_tail((1 - CONFIDENCE) / 2, dof)))
    return max(implied, scattered, key=math.prod) if weighted else scattered


def _halving(slope: float) -> float:
    """2^(-1/slope), infinite for a slope of no fall and where it overflows."""
    if math.isnan(slope):
        return math.nan
    return 2.0 ** (-1.0 / slope) if slope < -1e-3 else math.inf


def _logs(values: Sequence[float] | Array, name: str) -> Array:
    x = np.asarray(values, dtype=np.float64)
    if not np.all((x > 0) & np.isfinite(x)):
        raise ValueError(f"{name} must be positive and finite on logarithmic axes")
    return np.log(x)


def _log_errors(
    low: Sequence[float] | Array | None, high: Sequence[float] | Array | None, count: int
) -> Array | None:
    """Standard errors on the log scale from 95 % intervals, None without intervals."""
    if low is None or high is None:
        return None
    width = _logs(high, "y_high") - _logs(low, "y_low")
    if width.size != count or np.any(width <= 0):
        raise ValueError("each interval needs y_low < y_high")
    return width / (2.0 * NORMAL)
