"""Tails of samples at a point: Hill's index, the largest share, the verdict."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from pipeline.statistics.heavy_tail import largest_share, tail_index
from pipeline.statistics.samples import sample_verdict

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
Draw = Callable[[np.random.Generator, int], Array]
RUNS = 200


def pareto(rng: np.random.Generator, alpha: float, n: int) -> Array:
    """P(W > w) = w^-alpha, w >= 1."""
    return rng.random(n) ** (-1.0 / alpha)


def flagged(alpha: float, n: int, seed: int = 0) -> float:
    """The share of runs of n samples that are called untrustworthy."""
    rng = np.random.default_rng(seed)
    return float(
        np.mean([sample_verdict(pareto(rng, alpha, n)).verdict == "untrustworthy" for _ in range(RUNS)])
    )


@pytest.mark.parametrize("alpha", [0.5, 1.0, 1.5, 3.0])
def test_the_index_of_a_power_law_and_its_interval(alpha: float) -> None:
    """Unbiased to a standard error over 200 runs of 10,000 (k = 100), 95 % of intervals hold the truth.

    Catches an index over k + 1 excesses, over logarithms to another base, and the reciprocal.
    """
    rng = np.random.default_rng(1)
    found = [tail_index(np.sort(pareto(rng, alpha, 10_000))[-4096:], 10_000) for _ in range(RUNS)]
    assert all(one is not None and one.top == 100 for one in found)
    inverse = np.array([1.0 / one.value for one in found if one])
    assert np.mean(inverse) == pytest.approx(1 / alpha, abs=4 * np.std(inverse) / np.sqrt(RUNS))
    hits = sum(one.low <= alpha <= one.high for one in found if one)
    assert stats.binom.ppf(1e-3, RUNS, 0.95) <= hits <= stats.binom.ppf(1 - 1e-3, RUNS, 0.95)


@pytest.mark.parametrize(("alpha", "n", "least"), [(1.0, 400, 0.95), (1.0, 10_000, 1.0), (1.5, 10_000, 0.99)])
def test_a_tail_without_variance_is_flagged(alpha: float, n: int, least: float) -> None:
    """1 and 1.5 are the tails of area sampling near a touching light (pointwise, over pixels).

    Catches a verdict from the share alone.
    """
    assert flagged(alpha, n) >= least


@pytest.mark.parametrize(("alpha", "n", "most"), [(3.0, 400, 0.1), (3.0, 10_000, 0.0)])
def test_a_tail_with_variance_is_not(alpha: float, n: int, most: float) -> None:
    """Catches a verdict that takes the lower end of the index's interval: it would flag three quarters of the
    short runs.
    """
    assert flagged(alpha, n) <= most


@pytest.mark.parametrize("n", [400, 1_000, 30_000])
@pytest.mark.parametrize(
    "draw",
    [
        lambda rng, n: rng.random(n),
        lambda rng, n: rng.lognormal(0.0, 0.5, n),
        lambda rng, n: np.where(rng.random(n) < 0.3, 2.0, 0.0),
        lambda rng, n: np.full(n, 0.7),
        lambda rng, n: rng.exponential(1.0, n),
    ],
    ids=["uniform", "lognormal 0.5", "lit or dark", "constant", "exponential"],
)
def test_healthy_samples_raise_no_alarm(draw: Draw, n: int) -> None:
    """Catches a division by the log-excess 0 of equal samples, and an index taken over the whole sample
    instead of its tail.
    """
    rng = np.random.default_rng(2)
    verdicts = [sample_verdict(draw(rng, n)) for _ in range(50)]
    assert [one.reason for one in verdicts if one.verdict != "ok"] == []


def test_confidently_wrong_is_caught_by_the_index_where_the_share_is_silent() -> None:
    """A light at height 1e-4 over the point, 1e5 area samples: mean and standard error agree, and the mean is
    a tenth of the truth or less.

    W = h^2 / (r^2 + h^2)^2 on a unit-area disk around; the truth is 1 - O(h^2) up to the factor pi. In runs
    that miss the peak the largest share is mostly below a tenth: a verdict by the share alone lets them pass.
    """
    rng, h = np.random.default_rng(3), 1e-4
    missed = []
    for _ in range(40):
        r2 = rng.random(100_000) / np.pi
        w = h**2 / (r2 + h**2) ** 2 / np.pi
        if np.mean(w) + 4 * np.std(w) / np.sqrt(w.size) < 1.0:
            missed.append(sample_verdict(w))
    assert len(missed) >= 10
    assert all(one.verdict == "untrustworthy" for one in missed)
    assert any(one.max_share < 0.5 for one in missed)
    assert all(one.hill is not None and one.hill < 1 for one in missed)


def test_one_sample_that_carries_a_tenth_is_flagged_and_named() -> None:
    values = np.ones(1000)
    values[7] = 200.0
    verdict = sample_verdict(values)
    assert verdict.verdict == "untrustworthy"
    assert verdict.max_share == pytest.approx(200 / 1199)
    assert "one sample of 1,000 carries 17% of the light" in verdict.reason


def test_samples_that_are_no_numbers_are_flagged() -> None:
    verdict = sample_verdict(np.array([1.0, np.nan, 2.0, np.inf] * 50))
    assert verdict.verdict == "untrustworthy"
    assert "100 samples are not finite" in verdict.reason


def test_few_samples_have_no_index() -> None:
    """With fewer than 100, or fewer than 11 lit, the index's own error exceeds a third."""
    rng = np.random.default_rng(4)
    assert tail_index(rng.random(99), 99) is None
    assert tail_index(np.r_[np.ones(10), np.zeros(990)], 1000) is None
    assert tail_index(np.ones(100), 100) is not None
    assert sample_verdict(rng.random(60)).hill is None


def test_dark_and_empty_samples_are_no_error() -> None:
    for values in (np.zeros(1000), np.zeros(0)):
        verdict = sample_verdict(values)
        assert (verdict.max_share, verdict.hill, verdict.verdict) == (0.0, None, "ok")
        assert "carries light" in verdict.reason
    assert largest_share(np.zeros(0), 0.0) == 0.0


def test_the_index_does_not_depend_on_order_or_on_more_of_the_sample() -> None:
    """The renderer keeps the 4096 largest only: nothing below the (k+1)-st may count."""
    values = pareto(np.random.default_rng(5), 1.5, 20_000)
    kept = np.sort(values)[::-1][:4096]
    assert tail_index(values, 20_000) == tail_index(kept, 20_000) == tail_index(kept[::-1].copy(), 20_000)
