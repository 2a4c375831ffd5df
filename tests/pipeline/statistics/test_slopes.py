"""Slopes on log-log axes, their errors, and what they say of the cost of halving an error."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from pipeline.statistics.slopes import fit_slope, halving_cost

RUNS = 600
NOMINAL = (float(stats.binom.ppf(0.001, RUNS, 0.95)), float(stats.binom.ppf(0.999, RUNS, 0.95)))
SECONDS = np.array([0.1, 0.4, 1.6, 6.4, 25.6])
TRUE = 0.3 * SECONDS**-0.5


def noisy(rng: np.random.Generator, size: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors with a relative error of `size`, and their 95 % ends."""
    y = TRUE * np.exp(size * rng.standard_normal(5))
    return y, y * np.exp(-1.96 * size), y * np.exp(1.96 * size)


def test_an_exact_power_law() -> None:
    fit = fit_slope(SECONDS, TRUE)
    assert fit.value == pytest.approx(-0.5) and fit.se == pytest.approx(0.0, abs=1e-12)
    assert fit(1.0) == pytest.approx(0.3)
    assert fit(4.0) == pytest.approx(0.15)
    assert (fit.points, halving_cost(fit).value) == (5, pytest.approx(4.0))


@pytest.mark.parametrize("weighted", [False, True])
def test_the_slope_s_interval_covers(weighted: bool) -> None:
    """Catches 1.96 standard errors from three degrees of freedom (85 %), and an error of one point taken for
    that of the slope.
    """
    rng, hits = np.random.default_rng(1), 0
    for _ in range(RUNS):
        y, low, high = noisy(rng, 0.05)
        fit = fit_slope(SECONDS, y, low, high) if weighted else fit_slope(SECONDS, y)
        hits += fit.low <= -0.5 <= fit.high
    assert hits >= NOMINAL[0]
    assert weighted or hits <= NOMINAL[1]  # with intervals the greater of two errors counts: it covers more


def test_weights_follow_the_intervals() -> None:
    """A point that is hardly known must not bend the line."""
    y = TRUE.copy()
    y[0] *= 3.0
    fit = fit_slope(
        SECONDS, y, y * np.array([0.01, 0.99, 0.99, 0.99, 0.99]), y * np.array([100, 1.01, 1.01, 1.01, 1.01])
    )
    assert fit.value == pytest.approx(-0.5, abs=0.01)
    assert abs(fit_slope(SECONDS, y).value + 0.5) > 0.1


def test_a_bent_curve_widens_the_interval_beyond_what_its_points_imply() -> None:
    """A fixed cost flattens the first points; tight intervals of single points must not make the slope look
    certain.
    """
    overhead = SECONDS + 0.5
    tight = (TRUE * 0.999, TRUE * 1.001)
    assert fit_slope(overhead, TRUE, *tight).se > 20 * fit_slope(SECONDS, TRUE, *tight).se


def test_two_points_have_an_error_only_with_intervals() -> None:
    plain = fit_slope([1.0, 4.0], [1.0, 0.5])
    assert (
        plain.value == pytest.approx(-0.5) and math.isnan(plain.se) and math.isnan(halving_cost(plain).high)
    )
    known = fit_slope([1.0, 4.0], [1.0, 0.5], [0.9, 0.45], [1.1, 0.55])
    sigma = math.log(1.1 / 0.9) / (2 * 1.96)
    assert known.se == pytest.approx(sigma * math.sqrt(2) / math.log(4), rel=1e-3)


def test_halving_cost_follows_the_slope_and_its_ends() -> None:
    """-1/2 costs 4 times, -1 twice. Catches 2^(1/slope), and ends that are swapped."""
    fit = fit_slope([1.0, 4.0], [1.0, 0.25], [0.9, 0.2], [1.1, 0.3])
    cost = halving_cost(fit)
    assert cost.value == pytest.approx(2.0)
    assert cost.low == pytest.approx(2 ** (-1 / fit.low)) and cost.high == pytest.approx(2 ** (-1 / fit.high))
    assert cost.low < cost.value < cost.high


def test_an_error_that_does_not_fall_costs_infinitely_much() -> None:
    flat = fit_slope(SECONDS, np.ones(5), np.full(5, 0.9), np.full(5, 1.1))
    assert halving_cost(flat).value == halving_cost(flat).high == math.inf
    assert halving_cost(flat).low > 2


def test_what_cannot_be_fitted_is_refused() -> None:
    for x, y, said in (
        ([1.0], [1.0], "two points"),
        ([1.0, 2.0], [1.0], "two points"),
        ([1.0, 1.0], [1.0, 2.0], "same x"),
        ([1.0, 2.0], [1.0, 0.0], "y must be positive"),
        ([1.0, math.nan], [1.0, 2.0], "x must be positive"),
    ):
        with pytest.raises(ValueError, match=said):
            fit_slope(x, y)
    with pytest.raises(ValueError, match="y_low < y_high"):
        fit_slope([1.0, 2.0], [1.0, 2.0], [1.0, 2.0], [1.0, 2.0])
