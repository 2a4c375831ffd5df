"""MSE, relMSE and RMSE: unbiased under a noisy reference, intervals that cover, honest bounds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from pipeline.scoring.metric import METRICS, Estimate, Image, Reference
from pipeline.scoring.spread import scale_interval, standard_error
from pipeline.scoring.squared_error import SquaredError, squared_error

HEIGHT, WIDTH = 48, 64
BATCHES = 64
RUNS = 250
Rng = np.random.Generator
X = np.broadcast_to(np.arange(WIDTH) / WIDTH, (HEIGHT, WIDTH))
LIT = np.clip((X - 0.3) / 0.4, 0.0, 1.0)  # visible part of a light across a penumbra


def gray(error: Image) -> Image:
    """Channels that share their samples: correlation 1."""
    return np.repeat(error[..., None], 3, axis=-1)


def smooth_noise(rng: Rng) -> Image:
    return gray(0.01 * 100**X * rng.standard_normal(X.shape))


def colored_noise(rng: Rng) -> Image:
    return 0.1 * rng.standard_normal((*X.shape, 3))


def penumbra(rng: Rng) -> Image:
    """One sample a pixel, which is lit or dark."""
    return gray((rng.random(X.shape) < LIT) - LIT)


def sparse_light(rng: Rng) -> Image:
    """One sample a pixel, one in fifty lit: fireflies all of one size."""
    return gray((rng.random(X.shape) < 0.02) - 0.02)


def biased(rng: Rng) -> Image:
    return gray(0.3 + 0.1 * rng.standard_normal(X.shape))


ERRORS: dict[Callable[[Rng], Image], float] = {
    smooth_noise: float(np.mean((0.01 * 100**X) ** 2)),
    colored_noise: 0.01,
    penumbra: float(np.mean(LIT * (1 - LIT))),
    sparse_light: 0.02 * 0.98,
    biased: 0.1,
}


def measure(error: Image, mse: float, noise_share: float, rng: Rng) -> SquaredError:
    """One run: an estimate with this error against a reference whose own variance is a share of the MSE,
    estimated from batches.
    """
    variance = noise_share * mse
    wrong = np.sqrt(variance) * rng.standard_normal((HEIGHT, WIDTH, 1))
    estimated = variance * rng.chisquare(BATCHES - 1, (HEIGHT, WIDTH, 1)) / (BATCHES - 1)
    same = np.ones((1, 1, 3))
    return squared_error(Estimate(1.0 + error), Reference(1.0 + wrong * same, estimated * same, BATCHES))


@pytest.mark.parametrize("error", ERRORS)
def test_the_reference_noise_is_subtracted_and_the_interval_covers(error: Callable[[Rng], Image]) -> None:
    """The expectation is the estimate's own MSE, and 95 % of the intervals hold it.

    Catches a reference variance that is not subtracted (5 % here, some 10 standard errors), channels counted
    as independent samples (coverage 73 %), 2/3 d^4 for fireflies (89 %), and intervals that are safe because
    they are wide. At 95 % coverage 250 runs give at least 224 hits with a probability of 99.9 %.
    """
    rng, truth = np.random.default_rng(20), ERRORS[error]
    found = [measure(error(rng), truth, 0.05, rng) for _ in range(RUNS)]
    means = np.array([np.mean(one.map) for one in found])
    assert abs(np.mean(means) - truth) < 4 * np.std(means) / np.sqrt(RUNS)
    hits = sum(one.low <= truth <= one.high for one in found if one.low is not None and one.high is not None)
    assert hits >= stats.binom.ppf(0.001, RUNS, 0.95)
    width = np.mean([(one.high or 0) - (one.low or 0) for one in found])
    assert width < 1.25 * 2 * 1.96 * np.std(means)


def test_structure_of_the_image_does_not_widen_the_interval() -> None:
    """Neighbours differ little where the whole image differs much; the image-wide spread would give an
    interval 1.2 times as wide.
    """
    rng = np.random.default_rng(21)
    pixels = [np.mean(smooth_noise(rng) ** 2, axis=-1) for _ in range(RUNS)]
    truth = 2 * np.mean((0.01 * 100**X) ** 4) / X.size  # Var d^2 = 2 sigma^4
    found = [standard_error(pixel) ** 2 for pixel in pixels]
    assert np.mean(found) == pytest.approx(truth, abs=4 * np.std(found) / np.sqrt(RUNS))
    assert np.mean([np.var(pixel) / pixel.size for pixel in pixels]) > 1.3 * truth


def test_below_reference_noise_the_value_is_an_upper_bound() -> None:
    """Reference variance of a third of the MSE: at least 97.5 % of the bounds are above the truth, and each
    is marked.

    Catches a point estimate given as a bound (it is below the truth half the time).
    """
    rng = np.random.default_rng(22)
    found = [measure(0.1 * gray(rng.standard_normal(X.shape)), 0.01, 0.33, rng) for _ in range(RUNS)]
    assert all(one.bound and one.note == "below reference noise" and one.value == one.high for one in found)
    above = sum(one.value is not None and one.value >= 0.01 for one in found)
    assert above >= stats.binom.ppf(0.001, RUNS, 0.975)
    assert np.mean([one.value or 0 for one in found]) < 1.2 * 0.01


def test_a_perfect_estimate_has_a_positive_bound_that_shrinks_with_the_noise() -> None:
    rng = np.random.default_rng(23)
    for noise in (1e-4, 1e-8):
        wrong = np.sqrt(noise) * rng.standard_normal((HEIGHT, WIDTH, 3))
        one = squared_error(
            Estimate(np.ones_like(wrong)), Reference(1 + wrong, np.full_like(wrong, noise), BATCHES)
        )
        assert one.bound and one.low == 0 and one.value is not None
        assert 0 < one.value < 0.2 * noise


def test_an_estimate_that_is_the_reference_is_told() -> None:
    """Without it, comparing a reference with itself gives a bound far below the noise, which looks like a
    triumph.
    """
    image = np.random.default_rng(24).random((HEIGHT, WIDTH, 3))
    score = METRICS["mse"](Estimate(image), Reference(image, np.full_like(image, 1e-4), BATCHES)).score
    assert score.value is None and "not independent" in score.note


def test_two_plain_images_have_their_plain_mse() -> None:
    image = np.random.default_rng(25).random((HEIGHT, WIDTH, 3))
    exact = Reference(image, np.zeros_like(image), BATCHES)
    same = METRICS["mse"](Estimate(image), exact).score
    assert (same.value, same.low, same.high, same.bound) == (0.0, 0.0, 0.0, False)
    shifted = METRICS["mse"](Estimate(image + 0.1), exact).score
    assert shifted.value == pytest.approx(0.01)


def test_a_deterministic_reference_gives_nothing_to_subtract() -> None:
    """An error bound has a sign that nobody knows: the truth is within +-b of the measured root mean square.

    Catches the bound's square subtracted as if it were a variance (MSE 0.0096 and an interval that excludes
    the truth).
    """
    truth = np.ones((HEIGHT, WIDTH, 3))
    error = 0.1 * np.random.default_rng(26).standard_normal(truth.shape)
    for sign in (1, -1):
        reference = Reference(truth + sign * 0.02, np.full_like(truth, 0.02**2), 0)
        one = squared_error(Estimate(truth + error + 0.05), reference)
        assert not one.bound and one.low is not None and one.high is not None
        assert one.low < 0.0125 < one.high
    loose = squared_error(Estimate(truth + error), Reference(truth, np.full_like(truth, 0.05**2), 0))
    assert loose.bound and loose.value is not None and np.sqrt(loose.value) == pytest.approx(0.15, rel=0.05)


def test_relmse_names_and_uses_its_denominator() -> None:
    """Catches r^2 + 1e-4 and (r + 0.01)^2: 100 and 99 times as much where the reference is 0."""
    metric = METRICS["relmse"]
    assert "r² + 0.01" in metric.title
    for r, expected in ((0.0, 1.0), (0.1, 0.5), (10.0, 0.01 / 100.01)):
        truth = np.full((HEIGHT, WIDTH, 3), r)
        score = metric(Estimate(truth + 0.1), Reference(truth, np.zeros_like(truth), BATCHES)).score
        assert score.value == pytest.approx(expected)


def test_rmse_is_the_root_of_mse_ends_included() -> None:
    rng = np.random.default_rng(27)
    truth = rng.random((HEIGHT, WIDTH, 3))
    estimate, reference = Estimate(truth + 0.1), Reference(truth, np.full_like(truth, 1e-6), BATCHES)
    mse, rmse = (METRICS[name](estimate, reference).score for name in ("mse", "rmse"))
    for squared, root in ((mse.value, rmse.value), (mse.low, rmse.low), (mse.high, rmse.high)):
        assert squared is not None and root == pytest.approx(np.sqrt(squared))


def test_an_undefined_reference_variance_is_told() -> None:
    image = np.ones((HEIGHT, WIDTH, 3))
    score = METRICS["mse"](Estimate(image), Reference(image, np.full_like(image, np.nan), 1)).score
    assert score.value is None and "variance is undefined" in score.note


def test_scale_interval_is_positive_and_normal_when_narrow() -> None:
    low, high = scale_interval(1.0, 0.001)
    assert (low, high) == pytest.approx((1 - 0.00196, 1 + 0.00196), abs=1e-5)
    assert scale_interval(1.0, 1.0)[0] > 0
    assert scale_interval(0.0, 0.0) == (0.0, 0.0)
