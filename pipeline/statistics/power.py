"""The power of a test: the smallest bias that it would have caught."""

from __future__ import annotations

import numpy as np

from pipeline.statistics.numerics import normal_cdf, root, student_tail
from scenes.arrays import Array

POWER = 0.95
SMALLEST, LARGEST = 1e-9, 1e6  # relative biases between which the answer is sought


def smallest_detectable(
    mean: Array, error: Array, dof: Array, level: float, slack: Array | float = 0.0, power: float = POWER
) -> float:
    """The smallest relative bias of every true value that a family of comparisons would reject, at `power`.

    mean, error (standard error of the difference), dof: (..., channels). An error of inf is a comparison
    without power. level: of each comparison, two-sided. slack: shaped as the means, the part of a difference
    that does not count. The family rejects if any comparison does. Channels of a pixel are not independent,
    so that the best single channel counts. Returns inf if nothing could be caught, as for a black reference.
    """
    critical = student_tail(level / 2, dof)
    finite = np.isfinite(mean) & np.isfinite(error)  # what is not finite rejects at once, or promises nothing
    value, lost = np.where(finite, np.abs(mean), 0.0), np.where(finite, slack, 0.0)

    def lacking(log_bias: float) -> float:
        beyond = np.maximum(np.exp(log_bias) * value - lost, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            shift = np.where(beyond == 0, 0.0, beyond / error)
        return power - _family_power(shift, critical, dof)

    if lacking(float(np.log(LARGEST))) > 0:
        return float("inf")
    if lacking(float(np.log(SMALLEST))) <= 0:
        return SMALLEST
    return float(np.exp(root(lacking, float(np.log(SMALLEST)), float(np.log(LARGEST)), tolerance=1e-4)))


def _family_power(shift: Array, critical: Array, dof: Array) -> float:
    """Probability that a comparison of the best channel rejects. shift: (..., channels), non-centralities."""
    with np.errstate(divide="ignore"):
        missed = np.log(beta(shift, critical, dof))
    return float(np.max(-np.expm1(np.sum(missed.reshape(-1, missed.shape[-1]), axis=0))))


def beta(shift: Array, critical: Array, dof: Array) -> Array:
    """Probability that Student's t with non-centrality `shift` stays below `critical`, elementwise.

    The normal approximation of [abramowitz1964] 26.7.10; at 7 degrees of freedom and more it is within 0.01
    of the exact distribution at the tails that matter here, and thousands of times faster. The other tail is
    not counted: the power is understated.
    """
    numerator = critical * (1.0 - 0.25 / dof) - shift
    return normal_cdf(numerator / np.sqrt(1.0 + critical**2 / (2.0 * dof)))
