"""Whose variance may stand for whose: rare finds beside a lamp in view, and finds that come on top of what
all samples see.
"""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.schema.record import SampleStatistics
from pipeline.statistics.few_events import bounded_p, few_events
from pipeline.statistics.moments import Draws, Moments, floor_by_excess
from pipeline.statistics.welch import TestResult, compare_images, vary_alike, welch
from pipeline.studies.verify import Side, Trial, judge

SHAPE = (24, 32, 3)
OK = SampleStatistics(noise=0.01, max_share=1e-4, hill=5.0, nonfinite=0, verdict="ok", reason="")
Rng = np.random.Generator


def named(results: list[TestResult]) -> dict[str, TestResult]:
    return {result.name: result for result in results}


def lamp(rng: Rng, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of the light's edge in view: a column of pixels that see it, 50 of radiance, half of
    the time.
    """
    share = rng.binomial(samples, 0.5, (SHAPE[0], 1, 1)) / samples
    return 50 * share, 2500 * share * (1 - share) / (samples - 1)


def reference(rng: Rng, samples: int = 4096, noise: float = 0.02) -> Moments:
    """A floor of 1 whose samples vary by 2 %, under a lamp."""
    mean = 1 + noise / samples**0.5 * rng.standard_normal(SHAPE)
    variance = np.full(SHAPE, noise**2 / samples)
    mean[:, :1], variance[:, :1] = lamp(rng, samples)
    return Moments(mean, variance, 63, samples)


def by_chance(rng: Rng, samples: int, chance: float, share: float) -> Moments:
    """As `reference`, but that `share` of the floor's light comes in finds of that chance."""
    found = rng.binomial(samples, chance, (*SHAPE[:2], 1)) / (samples * chance) * np.ones(3)
    mean = 1 - share + share * found + 0.02 / samples**0.5 * rng.standard_normal(SHAPE)
    variance = 0.02**2 / samples + share**2 * found / (chance * (samples - 1))
    mean[:, :1], variance[:, :1] = lamp(rng, samples)
    draws = Draws(samples, np.zeros(3), np.full(3, max(50.0, share / chance)))
    return Moments(mean, variance, samples - 1, samples, draws=draws)


def test_finds_by_chance_are_seen_beside_a_lamp_in_view() -> None:
    """Summed over the image, the lamp's edge drowns them: 24 x 625 / 64 on both sides, where the floor of
    finds adds 768 x 1000 / 64.
    """
    rng = np.random.default_rng(1)
    ours, theirs = by_chance(rng, 64, 1e-3, 1.0), reference(rng)
    assert vary_alike(reference(rng, 64), theirs)
    assert not vary_alike(ours, theirs)


def test_rare_finds_beside_a_lamp_raise_no_alarm() -> None:
    """200 true nulls at 1e-3: none of the image, the regions and the pixels; plain tests of the pixels would
    reject in nearly every one.
    """
    rng, alarms = np.random.default_rng(2), 0
    for _ in range(200):
        results = compare_images(by_chance(rng, 64, 1e-3, 1.0), reference(rng), alpha=1e-3)
        alarms += any(result.reject for result in results)
    assert alarms <= 3  # 3 families of 1e-3 each: 0.6 on average, 4 and more in 0.3 % of all cases


@pytest.mark.usefixtures("statistical")
def test_finds_on_top_of_what_all_samples_see_raise_no_alarm() -> None:
    """As balance MIS in an open scene: 2 % of the light comes in finds of a chance of 1/200.

    A pixel without any, and most have none around either, reads 2 % low with an error of 0.35 % by its own
    samples.
    """
    rng, alarms, plain = np.random.default_rng(3), 0, 0
    for _ in range(100):
        ours, theirs = by_chance(rng, 32, 1 / 200, 0.02), reference(rng, 2048, 0.2)
        results = named(compare_images(ours, theirs, alpha=1e-3))
        alarms += any(result.reject for result in results.values())
        plain += float(welch(ours, theirs)[0].min()) < 1e-3 / ours.mean.size
    assert alarms <= 2
    assert plain > 50


def test_the_excess_is_that_of_the_surroundings_and_none_where_both_vary_alike() -> None:
    same = Moments(np.ones(SHAPE), np.full(SHAPE, 0.01), 63, 64)
    assert np.array_equal(floor_by_excess(same, same).variance, same.variance)
    more = np.full(SHAPE, 0.01)
    more[12, 16] += 8.1
    held = floor_by_excess(Moments(np.ones(SHAPE), more, 63, 64), same).variance
    np.testing.assert_allclose(held[12, 18], 0.01 + 8.1 / 81)  # within 9 x 9
    np.testing.assert_allclose(held[12, 24], 0.01 + 8.1 / 729)  # within 27 x 27
    np.testing.assert_allclose(held[12, 16], more[12, 16])


def test_a_bound_of_either_side_is_no_difference() -> None:
    one = Moments(np.full(SHAPE, 1.1), np.full(SHAPE, 1e-12), 63, 64)
    other = Moments(np.ones(SHAPE), np.full(SHAPE, 1e-12), 63, 64)
    bound = np.full(SHAPE, 0.11)
    for a, b in ((one, other), (other, one)):
        assert np.all(welch(a, b)[0] == 0)
        assert np.all(welch(Moments(a.mean, a.variance, 63, 64, bound), b)[0] == 1)
        assert np.all(welch(a, Moments(b.mean, b.variance, 63, 64, bound))[0] == 1)


def black(draws: Draws | None = None) -> Moments:
    nothing = draws or Draws(64, np.zeros(3), np.zeros(3))
    return Moments(np.zeros(SHAPE), np.zeros(SHAPE), 63, 64, draws=nothing)


def test_draws_that_met_no_light_at_all_say_nothing_of_how_large_it_comes() -> None:
    exact = Moments(np.full(SHAPE, 1e-4), np.zeros(SHAPE), np.inf, bound=np.zeros(SHAPE))
    side, pixels = black(), np.ones(SHAPE)
    assert side.draws is not None
    assert np.all(few_events(side.draws, pixels, exact))
    assert np.all(bounded_p(side.draws, pixels, side.mean, exact, np.zeros(SHAPE)) == 1)
    assert not any(result.reject for result in compare_images(side, exact))
    known = Draws(64, np.zeros(3), np.full(3, 0.01))  # of a size that would have come often enough
    assert compare_images(black(known), exact)[0].reject


def test_a_black_image_is_no_sign_of_bias_only_where_light_is_met_by_chance() -> None:
    lit = Moments(np.full(SHAPE, 1e-4), np.full(SHAPE, 1e-12), 63, 4096)
    for estimator, verdict in (
        ("hemisphere", "untrustworthy"),
        ("bsdf", "untrustworthy"),
        ("solid-angle", "biased"),
    ):
        assert judge(Trial(estimator), Side(black(), OK), lit).verdict == verdict
    dark = Moments(np.zeros(SHAPE), np.zeros(SHAPE), 63, 4096)
    assert judge(Trial("hemisphere"), Side(black(), OK), dark).verdict == "inconclusive"


@pytest.mark.usefixtures("statistical")
def test_the_image_mean_of_few_finds_is_tested_by_what_they_may_be() -> None:
    """Some 20 finds in the whole image: by its own variance, it rejects a true null up to 15 times as often
    as asked for.
    """
    rng, alarms, runs = np.random.default_rng(5), 0, 600
    count, chance = SHAPE[0] * SHAPE[1] * 64, 20 / (SHAPE[0] * SHAPE[1] * 64)
    exact = Moments(np.full((1, 1, 3), chance), np.zeros((1, 1, 3)), np.inf, bound=np.zeros((1, 1, 3)))
    for share in rng.binomial(count, chance, runs) / count:
        spread = share * (1 - share) / (count - 1)
        side = Moments(np.full((1, 1, 3), share), np.full((1, 1, 3), spread), count - 1, count)
        side = Moments(side.mean, side.variance, side.dof, count, draws=Draws(count, np.zeros(3), np.ones(3)))
        alarms += compare_images(side, exact, (1, 1), alpha=1e-3)[0].reject
    assert alarms <= 4  # 0.6 on average if nominal, 5 and more in 0.04 % of all cases; 6 by its own variance
