"""Welch's tests between images: nominal false alarms, no alarm at a penumbra, and the bias that they promise
to catch.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pipeline.statistics.power import beta
from pipeline.statistics.welch import (
    Moments,
    TestResult,
    batch_moments,
    compare_images,
    sidak,
    sidak_level,
    welch,
)

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
Rng = np.random.Generator
FULL = (120, 160, 3)  # 19,200 pixels
SMALL = (12, 16, 3)


def normal_side(
    rng: Rng, shape: tuple[int, int, int], batches: int, error: float = 0.01, bias: float = 0.0
) -> Moments:
    """What `batches` normal batches give: mean 1 + bias with this standard error, variance by chi-square,
    exactly distributed.
    """
    mean = 1.0 + bias + error * rng.standard_normal(shape)
    variance = error**2 * rng.chisquare(batches - 1, shape) / (batches - 1)
    return Moments(mean, variance, batches - 1, 64 * batches)


def film_side(rng: Rng, lit: Array, samples: int) -> Moments:
    """A film's moments of `samples` lit-or-dark samples a pixel, visible with probability `lit` (h, w);
    channels are equal.
    """
    share = rng.binomial(samples, lit) / samples
    mean = np.repeat(share[..., None], 3, axis=-1)
    return Moments(mean, mean * (1 - mean) / (samples - 1), samples - 1, samples)


def named(results: list[TestResult]) -> dict[str, TestResult]:
    return {result.name: result for result in results}


def alarm_range(runs: int) -> tuple[float, float]:
    """What 5 % false alarms give in so many runs, with a probability of 99.8 %."""
    return float(stats.binom.ppf(0.001, runs, 0.05)), float(stats.binom.ppf(0.999, runs, 0.05))


def test_null_rate_of_the_pixel_test_is_nominal_at_64_batches_and_that_of_a_z_test_at_8_is_not() -> None:
    """The same Sidak family of 57,600 comparisons.

    Catches degrees of freedom that are lost on the way (dof = inf): 30 alarms of 30.
    """
    rng, runs = np.random.default_rng(1), 30
    alarms = {"welch 64": 0, "z 8": 0}
    for _ in range(runs):
        for name, batches in (("welch 64", 64), ("z 8", 8)):
            sides = [normal_side(rng, FULL, batches) for _ in range(2)]
            if name.startswith("z"):
                sides = [replace(side, dof=np.inf) for side in sides]
            p = welch(*sides)[0]
            alarms[name] += sidak(float(p.min()), p.size) < 0.05
    assert alarms["z 8"] == runs
    assert alarms["welch 64"] <= alarm_range(runs)[1]


@pytest.mark.usefixtures("statistical")
def test_null_rate_of_regions_and_image_is_nominal_and_that_of_pixels_at_most() -> None:
    """Both ways: too many alarms, and a test so loose (a variance summed instead of averaged) that it never
    fires.
    """
    rng, runs = np.random.default_rng(2), 200
    results = [named(compare_images(*(normal_side(rng, SMALL, 64) for _ in range(2)))) for _ in range(runs)]
    low, high = alarm_range(runs)
    for name in ("image", "regions"):
        assert low <= sum(one[name].reject for one in results) <= high
    assert sum(one["pixels"].reject for one in results) <= high


@pytest.mark.parametrize("samples", [16, 64, 1024])
@pytest.mark.usefixtures("statistical")
def test_a_penumbra_raises_no_alarm(samples: int) -> None:
    """Lit-or-dark samples against a reference of 4096: a plain Welch test rejects the true null, here in
    every run below 1024.

    Its cause: pixels that happen to show no event have no variance. Catches a pixel test without support for
    the variance.
    """
    rng, runs = np.random.default_rng(3), 12
    lit = np.broadcast_to(np.clip(np.linspace(-0.3, 1.3, 160), 0, 1) ** 3, FULL[:2])
    plain, alarms = 0, {"image": 0, "regions": 0, "pixels": 0}
    for _ in range(runs):
        a, b = film_side(rng, lit, samples), film_side(rng, lit, 4096)
        p = welch(a, b)[0]
        plain += sidak(float(p.min()), p.size) < 0.05
        for result in compare_images(a, b):
            alarms[result.name] += result.reject
    assert samples == 1024 or plain == runs
    assert max(alarms.values()) <= alarm_range(runs)[1]


@pytest.mark.parametrize("name", ["image", "regions", "pixels"])
@pytest.mark.usefixtures("statistical")
def test_the_smallest_detectable_bias_is_detected_and_half_of_it_often_not(name: str) -> None:
    """Promised power 95 %, uniform bias, known variances. Catches an optimistic promise and one that is safe
    by being large.

    The regions and pixels of one channel are counted in a promise, the other two channels come on top.
    """
    rng, runs = np.random.default_rng(4), 40
    promised = named(compare_images(*(normal_side(rng, SMALL, 512) for _ in range(2))))[
        name
    ].smallest_detectable
    caught = {}
    for part in (1.0, 0.5):
        pairs = (
            (normal_side(rng, SMALL, 512, bias=part * promised), normal_side(rng, SMALL, 512))
            for _ in range(runs)
        )
        caught[part] = sum(named(compare_images(a, b))[name].reject for a, b in pairs)
    assert caught[1.0] >= stats.binom.ppf(0.001, runs, 0.95)
    assert caught[0.5] < 0.9 * runs


def test_a_uniform_bias_of_half_a_percent_is_caught_on_the_image_mean() -> None:
    """64 spp with 20 % noise a pixel: no pixel shows 0.5 %, the mean does, and says what it would have
    caught.
    """
    rng = np.random.default_rng(5)
    a = replace(normal_side(rng, FULL, 64, error=0.2, bias=0.005), samples=64)
    b = normal_side(rng, FULL, 64, error=0.025)
    found = named(compare_images(a, b))
    assert found["image"].reject and not found["pixels"].reject
    assert found["image"].smallest_detectable < 0.007
    assert found["image"].effect == pytest.approx(0.005, abs=0.005)
    assert "smallest bias it would have caught" in str(found["image"])


def test_a_local_error_is_caught_where_the_means_hide_it() -> None:
    """A shadow displaced by one pixel: one column too bright, one too dark, by 10 %; image and most regions
    are right on average.
    """
    rng = np.random.default_rng(6)
    a, b = normal_side(rng, FULL, 64), normal_side(rng, FULL, 64)
    a.mean[:, 80] += 0.1
    a.mean[:, 81] -= 0.1
    found = named(compare_images(a, b))
    assert found["pixels"].reject and not found["image"].reject
    p_map = found["pixels"].p_map
    assert p_map is not None and p_map.shape == FULL[:2]
    assert set(np.argsort(p_map.min(axis=0))[:2]) == {80, 81}


def test_a_leak_into_the_umbra_is_caught_pixel_by_pixel() -> None:
    """The reference is exactly black there, without variance.

    Catches support for the variance that drowns the leak.
    """
    rng = np.random.default_rng(7)
    lit = np.broadcast_to(np.clip(np.linspace(-1.0, 1.0, 160), 0, 1), FULL[:2]).copy()
    b = film_side(rng, lit, 4096)
    lit[50:60, 10:20] = 0.5
    found = named(compare_images(film_side(rng, lit, 256), b))
    assert found["pixels"].reject
    assert found["pixels"].effect == np.inf


def test_equal_constants_agree_different_ones_do_not_and_rounding_is_no_difference() -> None:
    """A light seen directly has no variance.

    Its radiance passes through float32, as a running sum of up to 256 equal samples.
    """
    exact = Moments(np.full(SMALL, 20.1), np.zeros(SMALL), 63, 4096)
    running = np.cumsum(np.full(256, 20.1, np.float32), dtype=np.float32)[-1] / 256
    stored = replace(exact, mean=np.full(SMALL, float(running)))
    assert running != 20.1
    other = replace(exact, mean=exact.mean * (1 + 2e-5))
    assert [result.p for result in compare_images(stored, exact)] == [1.0, 1.0, 1.0]
    assert [result.reject for result in compare_images(other, exact)] == [True, True, True]


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_pixel_that_is_no_number_rejects_and_stays_alone_in_the_map(bad: float) -> None:
    rng = np.random.default_rng(8)
    a, b = normal_side(rng, SMALL, 64), normal_side(rng, SMALL, 64)
    a.mean[3, 5, 1], a.variance[3, 5, 1] = bad, bad
    found = named(compare_images(a, b))
    assert all(result.reject for result in found.values())
    p_map = found["pixels"].p_map
    assert p_map is not None and np.argwhere(p_map == 0).tolist() == [[3, 5]]
    assert np.isfinite(found["pixels"].smallest_detectable)


def test_pixels_are_left_out_where_nothing_holds_their_variance_up() -> None:
    rng = np.random.default_rng(9)
    exact = Moments(np.ones(SMALL), np.zeros(SMALL), np.inf)
    assert list(named(compare_images(normal_side(rng, SMALL, 64), exact))) == ["image", "regions"]


def test_regions_cover_the_image_and_are_tested_as_means() -> None:
    """Sizes that do not divide: 23 x 31 in 4 x 5 regions. A biased corner is found in its own region."""
    rng, shape = np.random.default_rng(10), (23, 31, 3)
    a, b = normal_side(rng, shape, 64), normal_side(rng, shape, 64)
    a.mean[-5:, :6] += 0.02
    regions = named(compare_images(a, b, regions=(4, 5)))["regions"]
    assert regions.comparisons == 60 and regions.reject
    assert regions.p_map is not None and np.unravel_index(np.argmin(regions.p_map), (4, 5)) == (3, 0)
    assert regions.effect == pytest.approx(0.02, rel=0.5)


def test_batch_moments_are_those_of_the_mean() -> None:
    batches = np.random.default_rng(11).random((16, 4, 5, 3))
    moments = batch_moments(batches, samples=256)
    assert moments.mean == pytest.approx(batches.mean(axis=0))
    assert moments.variance == pytest.approx(stats.sem(batches, axis=0) ** 2)
    assert (moments.dof, moments.samples) == (15, 256)


def test_welch_is_scipys() -> None:
    """The library tests two samples; ours takes moments.

    Catches degrees of freedom added instead of combined.
    """
    rng = np.random.default_rng(12)
    x, y = rng.normal(0, 1, (12, 2, 2, 3)), rng.normal(0.5, 3, (40, 2, 2, 3))
    p, _, dof = welch(batch_moments(x), batch_moments(y))
    expected = stats.ttest_ind(x, y, axis=0, equal_var=False)
    assert p == pytest.approx(np.asarray(expected.pvalue), rel=1e-3)  # the allowance for rounding is in ours
    assert dof == pytest.approx(np.asarray(expected.df))


def test_sidak_and_its_level_undo_each_other() -> None:
    assert sidak(sidak_level(0.05, 57_600), 57_600) == pytest.approx(0.05)
    assert sidak(1e-20, 10) == pytest.approx(1e-19)
    assert sidak(1.0, 5) == 1.0


def test_power_of_the_approximation_is_that_of_the_noncentral_t() -> None:
    for dof in (7.0, 15.0, 63.0, 1e4):
        for level in (0.05, 1e-3, 1e-6):
            critical = float(stats.t.isf(level / 2, dof))
            shift = np.linspace(0.5, 1.5, 9) * critical
            exact = stats.nct.cdf(critical, dof, shift)
            near = beta(shift, np.full(9, critical), np.full(9, dof))
            assert np.max(np.abs(near - exact)) < 0.02


def test_moments_without_a_variance_are_refused() -> None:
    """One sample has no variance; nan would otherwise reject, or agree, for no reason."""
    with pytest.raises(ValueError, match="2 samples or batches at least"):
        Moments(np.ones(SMALL), np.full(SMALL, np.nan), 0)
    with pytest.raises(ValueError, match="different shapes"):
        Moments(np.ones(SMALL), np.ones(FULL), 63)
    sides = (Moments(np.ones(shape), np.ones(shape), 63) for shape in (SMALL, FULL))
    with pytest.raises(ValueError, match="different shapes"):
        compare_images(*sides)
