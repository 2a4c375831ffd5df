"""Intervals over replicates, of products, of efficiency; what becomes of bounds and undefined scores."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from pipeline.schema.record import Score
from pipeline.statistics.intervals import (
    Interval,
    efficiency,
    mean_interval,
    product,
    replicate_interval,
    replicate_mse,
)

RUNS = 1000
NOMINAL = (float(stats.binom.ppf(0.001, RUNS, 0.95)), float(stats.binom.ppf(0.999, RUNS, 0.95)))


def score(
    value: float | None, low: float | None = None, high: float | None = None, bound: bool = False
) -> Score:
    return Score(
        metric="mse", value=value, low=low, high=high, bound=bound, note="" if value is not None else "why"
    )


@pytest.mark.parametrize("replicates", [2, 3, 8])
def test_interval_of_a_mean_covers_with_few_replicates(replicates: int) -> None:
    """Catches 1.96 instead of Student's factor: three replicates would cover 81 %."""
    rng = np.random.default_rng(1)
    found = [mean_interval(rng.normal(5.0, 2.0, replicates)) for _ in range(RUNS)]
    assert NOMINAL[0] <= sum(one.low <= 5.0 <= one.high for one in found) <= NOMINAL[1]


def test_one_value_has_no_interval_and_none_no_mean() -> None:
    one = mean_interval([2.0])
    assert one.value == 2.0 and math.isnan(one.low) and math.isnan(one.high)
    with pytest.raises(ValueError, match="no values"):
        mean_interval([])


def test_interval_of_a_ratio_covers() -> None:
    """Two means of five replicates each, 10 % noise.

    Catches errors that are added instead of added in quadrature (99 %), or left out (81 %).
    """
    rng = np.random.default_rng(2)
    hits = 0
    for _ in range(RUNS):
        a, b = (mean_interval(rng.normal(center, 0.1 * center, 5)) for center in (8.0, 2.0))
        ratio = product((a, 1.0), (b, -1.0))
        hits += ratio.low <= 4.0 <= ratio.high
    assert NOMINAL[0] <= hits
    assert hits <= 0.985 * RUNS


def test_a_power_turns_the_ends_round() -> None:
    inverse = product((Interval(2.0, 1.0, 8.0), -1.0))
    assert (inverse.value, inverse.low, inverse.high) == pytest.approx((0.5, 0.125, 1.0))
    square = product((Interval(2.0, 1.0, 8.0), 2.0))
    assert (square.value, square.low, square.high) == pytest.approx((4.0, 1.0, 64.0))


def test_an_end_at_zero_gives_an_end_at_infinity() -> None:
    assert product((Interval(2.0, 0.0, 3.0), -1.0)).high == math.inf
    assert product((Interval(2.0, -1.0, 3.0), 1.0)).low == 0.0
    with pytest.raises(ValueError, match="positive values, not 0"):
        product((Interval(0.0, 0.0, 1.0), 1.0))


def test_efficiency_is_the_reciprocal_of_error_times_time() -> None:
    found = efficiency(Interval(0.01, 0.008, 0.0125), Interval(4.0, 4.0, 4.0))
    assert (found.value, found.low, found.high) == pytest.approx((25.0, 20.0, 31.25))
    exact = efficiency(Interval(0.0, 0.0, 0.0), Interval(4.0, 3.0, 5.0))
    assert exact.value == exact.low == exact.high == math.inf


def test_replicates_give_students_interval_over_their_values() -> None:
    values = [1.0, 1.2, 1.4]
    found = replicate_mse([score(v, 0.9 * v, 1.1 * v) for v in values])
    expected = mean_interval(values)
    assert (found.value, found.low, found.high) == pytest.approx(
        (expected.value, expected.low, expected.high)
    )
    assert found.bound is False


def test_two_replicates_pool_their_own_intervals() -> None:
    """Student's factor for two is 12.7: the interval would say nothing. The ends never fall below 0."""
    found = replicate_mse([score(1.0, 0.7, 1.3), score(2.0, 1.6, 2.4)])
    assert (found.value, found.low, found.high) == pytest.approx((1.5, 1.25, 1.75))
    wild = replicate_mse([score(0.1, 0.05, 0.2), score(5.0, 4.0, 6.0), score(0.1, 0.05, 0.2)])
    assert wild.low == 0.0


def test_one_replicate_below_the_reference_noise_makes_the_whole_a_bound() -> None:
    """Catches the mean of numbers and bounds passed off as a number."""
    found = replicate_mse([score(1.0, 0.9, 1.1), score(1.3, 0.7, 1.3, bound=True), score(1.0, 0.9, 1.2)])
    assert found.bound and found.value == found.high == pytest.approx(1.2)
    assert found.note == "below reference noise"


def test_one_undefined_replicate_makes_the_whole_undefined() -> None:
    found = replicate_mse([score(1.0, 0.9, 1.1), score(None)])
    assert (found.value, found.note) == (None, "why")
    with pytest.raises(ValueError, match="no replicates"):
        replicate_mse([])


@pytest.mark.parametrize("count", [3, 12])
def test_intervals_over_replicates_cover(count: int) -> None:
    """Skewed scores (of an image's worst pixels, say): three replicates by Student, twelve by bootstrap; at
    least 88 % of 300 intervals.

    The bootstrap of three values would cover about three quarters.
    """
    rng, runs = np.random.default_rng(31), 300
    draws = [rng.gamma(9.0, 1 / 9.0, count) for _ in range(runs)]
    found = [replicate_interval(values) for values in draws]
    assert sum(one.low <= 1.0 <= one.high for one in found) >= 0.88 * runs
    assert replicate_interval(draws[0]) == found[0]


def test_replicates_that_are_all_alike_have_no_width() -> None:
    assert replicate_interval([2.0] * 12) == Interval(2.0, 2.0, 2.0)


def test_a_value_without_bound_has_a_mean_and_no_interval() -> None:
    found = mean_interval([1.0, float("inf"), 2.0])
    assert found.value == float("inf") and np.isnan(found.low) and np.isnan(found.high)
