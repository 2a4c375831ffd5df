"""Regions that few large samples light: no false alarm where the truth is known, and what is still caught
there.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from pipeline.statistics.few_events import EVENTS, bounded_p
from pipeline.statistics.moments import Draws, Moments
from pipeline.statistics.welch import TestResult, compare_images

SHAPE = (12, 16, 3)
SPP = 64
Rng = np.random.Generator


def draws(largest: float = 1.0, least: float = 0.0, count: int = SPP) -> Draws:
    return Draws(count, np.full(3, least), np.full(3, largest))


def exact(mean: np.ndarray) -> Moments:
    return Moments(mean, np.zeros(SHAPE), np.inf, bound=np.zeros(SHAPE))


def rare(rng: Rng, chance: np.ndarray) -> Moments:
    """SPP samples a pixel that are 1 with this chance (h, w, 1) and else 0, gray; the variance that a film
    would have.
    """
    share = rng.binomial(SPP, chance) / SPP * np.ones(3)
    return Moments(share, share * (1 - share) / (SPP - 1), SPP - 1, SPP, draws=draws())


def named(results: list[TestResult]) -> dict[str, TestResult]:
    return {result.name: result for result in results}


def chances() -> np.ndarray:
    """The left half bright, the right one of rare finds: 0.01 to 5 in each of the grid's regions."""
    chance = np.full((*SHAPE[:2], 1), 0.5)
    chance[:, 8:] = np.repeat(np.geomspace(1e-5, 7e-3, 4), 3)[:, None, None]
    return chance


@pytest.mark.parametrize("alpha", [0.05, 0.001])
@pytest.mark.usefixtures("statistical")
def test_no_false_alarm_where_finds_are_rare(alpha: float) -> None:
    """200 true nulls.

    By variance alone, the regions without a find reject in every run (p = 0): that is what this test would
    catch.
    """
    rng, runs, truth = np.random.default_rng(71), 200, chances() * np.ones(3)
    alarms: dict[str, int] = {}
    plain = 0
    for _ in range(runs):
        side = rare(rng, chances())
        parts = {"rare": truth[..., 0] < 0.1}
        for name, one in named(compare_images(side, exact(truth), alpha=alpha, parts=parts)).items():
            alarms[name] = alarms.get(name, 0) + one.reject
        without = Moments(side.mean, side.variance, side.dof, SPP)
        plain += named(compare_images(without, exact(truth), alpha=alpha))["regions"].reject
    assert set(alarms) == {"image", "regions", "rare", "pixels"}
    assert max(alarms.values()) <= stats.binom.ppf(0.999, runs, alpha)
    assert plain == runs


@pytest.mark.parametrize("due", [EVENTS, 1.5 * EVENTS, 4 * EVENTS, 16 * EVENTS])
def test_a_region_s_own_variance_is_good_enough_beyond_the_limit(due: float) -> None:
    """Of samples that are either dark or as large as the largest, the worst case: P(p <= level) by the exact
    distribution of their number, level
    by level. Without the variance of the events that were due it is 6 times a level of 2e-5 and 17 times one
    of 1e-6 for 100 events; for 10 it is 136 and 2,700 times."""
    count = SPP * 192
    found = np.arange(int(3 * due))
    probability = stats.binom.pmf(found, count, due / count)
    mean = (found / count)[:, None, None] * np.ones(3)  # each outcome a region of its own
    truth = np.full_like(mean, due / count)
    a = Moments(mean, mean * (1 - mean) / (count - 1), np.inf, SPP, draws=draws(count=count))
    regions = named(compare_images(a, Moments(truth, np.zeros_like(truth), np.inf), regions=(found.size, 1)))[
        "regions"
    ]
    assert regions.p_map is not None
    p = regions.p_map[:, 0]
    for level in (1e-2, 1e-3, 2e-5, 1e-6):
        assert probability[p <= level].sum() <= 1.1 * level
    assert probability[p <= 1e-2].sum() > 2e-3, "and it is no test that never rejects"


def test_the_probability_is_never_too_small() -> None:
    """P(p <= level) <= level for binomial counts, exactly, over chances, sizes of sample and levels; and no p
    is wastefully large.
    """
    for count, chance in ((20, 0.01), (20, 0.5), (200, 0.002), (200, 0.3), (1000, 0.05)):
        found = np.arange(count + 1)
        mean = (found / count)[:, None, None] * np.ones(3)
        truth = np.full_like(mean, chance)
        reference = Moments(truth, np.zeros_like(truth), np.inf)
        p = bounded_p(draws(count=count), np.ones_like(mean), mean, reference, np.zeros_like(mean))[:, 0, 0]
        for level in (0.05, 1e-3, 1e-6):
            assert stats.binom.pmf(found, count, chance)[p <= level].sum() <= level
        least = stats.binom.cdf(np.minimum(found, count * chance), count, chance)
        assert np.all(p >= np.where(found < count * chance, least, 0.0))


def test_no_find_has_the_probability_of_no_find() -> None:
    zero, truth = np.zeros((1, 1, 3)), np.full((1, 1, 3), 0.01)
    p = bounded_p(draws(), np.full((1, 1, 3), 5.0), zero, Moments(truth, zero, np.inf), zero)
    np.testing.assert_allclose(p, min(1.0, 2 * 0.99 ** (5 * SPP)), rtol=1e-12)


def test_any_light_where_the_truth_is_black_rejects() -> None:
    """One sample in one pixel of the umbra: its region's own standard error is as large as the light itself,
    and Welch's t is 1.
    """
    rng, truth = np.random.default_rng(72), chances() * np.ones(3)
    truth[:, 8:] = 0.0
    side = rare(rng, truth[..., :1])
    assert not any(one.reject for one in compare_images(side, exact(truth), alpha=1e-3))
    side.mean[5, 12], side.variance[5, 12] = 1 / SPP, (1 / SPP) ** 2
    found = named(compare_images(side, exact(truth), alpha=1e-3))
    assert found["regions"].reject and found["pixels"].reject and not found["image"].reject
    assert found["regions"].p_map is not None and found["regions"].p_map[1, 3] == 0.0


def test_light_where_there_is_nearly_none_rejects_unless_one_sample_could_have_brought_it() -> None:
    """A truth of 1e-9 of the largest sample, as float32 leaves it in an umbra: it is no licence to leak."""
    rng, truth = np.random.default_rng(73), chances() * np.ones(3)
    truth[:, 8:] = 1e-9
    side = rare(rng, truth[..., :1])
    side.mean[5, 12] = 1 / SPP
    found = named(compare_images(side, exact(truth), alpha=1e-3))
    assert found["regions"].reject and found["pixels"].reject


def test_a_region_of_many_events_that_stays_black_rejects() -> None:
    """No light where a hundred of the largest samples were due."""
    truth = chances() * np.ones(3)
    side = rare(np.random.default_rng(74), chances())
    side.mean[:3, :4], side.variance[:3, :4] = 0.0, 0.0
    assert truth[:3, :4, 0].sum() * SPP > EVENTS
    found = named(compare_images(side, exact(truth), alpha=1e-3))
    assert found["regions"].reject and found["pixels"].reject


def test_what_is_promised_comes_from_regions_of_many_events() -> None:
    """A region without a find has no standard error, and used to promise to catch 0.002 %."""
    truth = chances() * np.ones(3)
    found = named(compare_images(rare(np.random.default_rng(75), chances()), exact(truth)))
    assert 0.005 < found["regions"].smallest_detectable < 1.0
    assert found["pixels"].smallest_detectable == np.inf


def test_a_noisy_reference_is_given_its_doubt() -> None:
    """A sampled mean of 0.02 with a standard error of 0.004 does not say that there is light; an exact one
    does.
    """
    zero, truth = np.zeros((1, 1, 3)), np.full((1, 1, 3), 0.02)
    pixels = np.full((1, 1, 3), 100.0)
    noisy = Moments(truth, np.full_like(truth, 0.004**2), 63, 1024)
    assert bounded_p(draws(), pixels, zero, noisy, zero).min() == 1.0
    assert bounded_p(draws(), pixels, zero, Moments(truth, zero, np.inf), zero).max() < 1e-50


def test_negative_samples_have_their_range() -> None:
    """A control variate: samples of -1 and 1 where the truth is 0.

    Taken for samples from 0 on, its negative means could not be.
    """
    rng, truth = np.random.default_rng(76), np.zeros(SHAPE)
    values = rng.choice([-1.0, 1.0], (SPP, *SHAPE))
    side = Moments(
        values.mean(axis=0), values.var(axis=0, ddof=1) / SPP, SPP - 1, SPP, draws=draws(1.0, -1.0)
    )
    assert not any(one.reject for one in compare_images(side, exact(truth), alpha=1e-3))
    side.mean[3, 4] = 0.9
    assert named(compare_images(side, exact(truth), alpha=1e-3))["pixels"].reject


def test_what_is_not_finite_rejects() -> None:
    truth = chances() * np.ones(3)
    side = rare(np.random.default_rng(77), chances())
    side.mean[0, 15, 1], side.variance[0, 15, 1] = np.nan, np.nan
    found = named(compare_images(side, exact(truth)))
    assert all(one.reject for one in found.values())
