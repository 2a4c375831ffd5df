# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""Typed wrappers of SciPy's distributions, root finder, box filters and bootstrap."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import ndimage, optimize, special, stats

from scenes.arrays import Array


def normal_cdf(x: Array) -> Array:
    """P(N <= x) for a standard normal N, elementwise."""
    return np.asarray(special.ndtr(x), dtype=np.float64)


def normal_tail(level: float) -> float:
    """The x with P(N > x) = level for a standard normal N."""
    return float(stats.norm.isf(level))


def student_survival(x: Array, dof: Array) -> Array:
    """P(T > x) for Student's t, elementwise; dof may be infinite."""
    return np.asarray(stats.t.sf(x, dof), dtype=np.float64)


def student_tail(level: float, dof: Array | float | int) -> Array:
    """The x with P(T > x) = level for Student's t, elementwise; dof may be infinite."""
    return np.asarray(stats.t.isf(level, dof), dtype=np.float64)


def relative_entropy(x: Array, y: Array) -> Array:
    """x ln(x / y) - x + y, elementwise: 0 at x = y, y at x = 0, infinite at y = 0 < x. x, y >= 0."""
    return np.asarray(special.kl_div(x, y), dtype=np.float64)


def gamma_quantile(probability: float, shape: int) -> float:
    """The x with P(G <= x) = probability, for a gamma variable of this shape and scale 1."""
    return float(stats.gamma.ppf(probability, shape))


def root(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """The zero of a function that has opposite signs at `low` and `high` (Brent's method)."""
    found: Any = optimize.brentq(function, low, high, xtol=tolerance)
    return float(found)


def box_mean(image: Array, size: int) -> Array:
    """Mean over the size x size pixels around each pixel, by channel; the border repeats.

    image: (h, w, 3), finite.
    """
    window: Any = (size, size, 1)
    return np.asarray(ndimage.uniform_filter(image, size=window, mode="nearest"), dtype=np.float64)


def box_maximum(image: Array, size: int) -> Array:
    """Maximum over the size x size pixels around each pixel; the border repeats. image: (h, w), finite."""
    return np.asarray(ndimage.maximum_filter(image, size=size, mode="nearest"), dtype=np.float64)


def bootstrap_ends(values: Array, confidence: float) -> tuple[float, float]:
    """The ends of the bias-corrected and accelerated bootstrap interval of the mean of values (n,).

    The seed is fixed: equal values have equal intervals.
    """
    rng = np.random.default_rng(0)
    found: Any = stats.bootstrap(
        (values,), np.mean, confidence_level=confidence, n_resamples=2000, method="BCa", rng=rng
    )
    return float(found.confidence_interval.low), float(found.confidence_interval.high)
