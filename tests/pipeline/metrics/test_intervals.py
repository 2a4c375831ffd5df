"""Intervals of the other metrics: over regions, of means of absolute and signed errors, trimmed, and of the
noise.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from pipeline.scoring.metric import METRICS, Estimate, Image, Mask, Reference
from pipeline.scoring.spread import standard_error

HEIGHT, WIDTH = 32, 40
RUNS = 200
TRUTH = np.broadcast_to(np.linspace(0.2, 1.0, WIDTH)[None, :, None], (HEIGHT, WIDTH, 3)).copy()
SIGMA = 0.1 * TRUTH
REFERENCE = 1e-3  # standard error of the reference
LEAST = int(
    stats.binom.ppf(0.001, RUNS, 0.95)
)  # hits of a 95 % interval in so many runs, with a probability of 99.9 %


def checkerboard() -> Mask:
    """No two neighbours: every 2 x 2 block has two pixels."""
    return np.indices((HEIGHT, WIDTH)).sum(axis=0) % 2 == 0


def scattered() -> Mask:
    """Single pixels, in every second block of 2 x 2."""
    mask = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    mask[::2, ::4] = True
    return mask


def half() -> Mask:
    mask = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    mask[:, 5:21] = True
    return mask


@pytest.mark.parametrize("region", [checkerboard, scattered, half])
def test_the_standard_error_of_a_region_is_right(region: Callable[[], Mask]) -> None:
    """Its square is the variance of the region's mean, within 4 errors of 200 runs: 5 % to 10 % are
    caught.
    """
    rng, mask = np.random.default_rng(41), region()
    maps = [SIGMA[..., 0] * rng.standard_normal((HEIGHT, WIDTH)) for _ in range(RUNS)]
    found = np.array([standard_error(one, mask) ** 2 for one in maps])
    truth = float(np.sum(SIGMA[..., 0][mask] ** 2)) / np.count_nonzero(mask) ** 2
    assert np.mean(found) == pytest.approx(truth, abs=4 * np.std(found) / np.sqrt(RUNS))


def draw(rng: np.random.Generator, shift: float = 0.0) -> tuple[Estimate, Reference]:
    image = TRUTH + shift + SIGMA * rng.standard_normal((HEIGHT, WIDTH, 1))
    wrong = TRUTH + REFERENCE * rng.standard_normal(TRUTH.shape)
    return Estimate(image, SIGMA**2), Reference(wrong, np.full_like(TRUTH, REFERENCE**2), 64)


def expected(name: str) -> float:
    """In closed form: a normal deviate of unit variance has E|z| = sqrt(2/pi)."""
    half_normal = float(np.sqrt(2 / np.pi))
    weights: dict[str, Image] = {
        "mae": SIGMA * half_normal,
        "relmse": SIGMA**2 / (TRUTH**2 + 0.01),
        "relmse-imgtool": SIGMA**2 / (TRUTH + 0.01) ** 2,
        "noise": SIGMA**2,
    }
    mean = float(np.mean(weights[name]))
    return mean**0.5 if name == "noise" else mean


@pytest.mark.parametrize("name", ["mae", "relmse", "relmse-imgtool"])
def test_intervals_hold_the_truth(name: str) -> None:
    """At least LEAST of 200 intervals do, and they are not a quarter wider than need be."""
    rng, truth = np.random.default_rng(42), expected(name)
    found = [METRICS[name](*draw(rng)).score for _ in range(RUNS)]
    values, lows, highs = (np.array([getattr(one, end) for one in found]) for end in ("value", "low", "high"))
    assert np.count_nonzero((lows <= truth) & (truth <= highs)) >= LEAST
    assert np.mean(highs - lows) < 1.25 * 2 * 1.96 * np.std(values)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("shift", [0.0, 0.01])
def test_bias_is_found_with_its_sign_and_its_interval(known: bool, shift: float) -> None:
    """With the estimate's variance and without it; correlated channels, which independent ones' formula would
    make 1.7 times too sure.
    """
    rng = np.random.default_rng(43)
    found = []
    for _ in range(RUNS):
        estimate, reference = draw(rng, shift)
        found.append(METRICS["bias"](estimate if known else Estimate(estimate.mean), reference).score)
    lows, highs = (np.array([getattr(one, end) for one in found]) for end in ("low", "high"))
    assert np.count_nonzero((lows <= shift) & (shift <= highs)) >= LEAST
    assert np.mean([one.value for one in found]) == pytest.approx(shift, abs=4 * 2e-3 / np.sqrt(RUNS))
    assert np.mean(highs - lows) < 1.3 * 2 * 1.96 * np.std([one.value for one in found])


def test_a_firefly_is_trimmed_and_counted_elsewhere() -> None:
    """One pixel of 1,280 at 100 times its value: relMSE is made of it, the trimmed one is not, `firefly`
    tells its light.
    """
    rng = np.random.default_rng(44)
    estimate, reference = draw(rng)
    lit = estimate.mean.copy()
    lit[10, 30] *= 100
    plain, trimmed, firefly = (
        METRICS[n](Estimate(lit), reference).score for n in ("relmse", "relmse-trimmed", "firefly")
    )
    before = METRICS["relmse-trimmed"](estimate, reference).score
    assert plain.value is not None and trimmed.value is not None and before.value is not None
    assert plain.value > 100 * before.value and trimmed.value == pytest.approx(before.value, rel=0.02)
    assert "3 of 3,840 values" in trimmed.note
    expected_share = (lit[10, 30, 0] - 2 * TRUTH[0, 31, 0]) / TRUTH[..., 0].sum()
    assert firefly.value == pytest.approx(expected_share, rel=0.01)
    assert METRICS["firefly"](estimate, reference).score.value == 0


def test_rmse_of_an_unbiased_render_is_its_noise() -> None:
    estimate, reference = draw(np.random.default_rng(45))
    rmse, noise = (METRICS[name](estimate, reference).score for name in ("rmse", "noise"))
    assert noise.value == pytest.approx(expected("noise"))
    assert rmse.low is not None and rmse.high is not None and rmse.low <= noise.value <= rmse.high


@pytest.mark.parametrize("name", ["mae", "smape", "psnr", "ciede2000", "relmse-trimmed"])
def test_below_the_reference_noise_there_is_a_bound_only(name: str) -> None:
    """A reference with a third of the error's variance: no number may look measured."""
    rng = np.random.default_rng(46)
    estimate, _ = draw(rng)
    noise = SIGMA * 0.6
    loud = Reference(TRUTH + noise * rng.standard_normal(TRUTH.shape), noise**2, 64)
    found = METRICS[name](estimate, loud).score
    assert found.bound and "below reference noise" in found.note
    assert found.value == (found.low if METRICS[name].better == "higher" else found.high)


def test_the_largest_sample_of_a_region() -> None:
    """Ten samples of 1 in each pixel, and one of 90 in a single pixel: 90 of 90 + 10 x pixels of the
    region.
    """
    shape = (4, 5, 3)
    largest, mean = np.ones(shape), np.ones(shape)
    largest[2, 3], mean[2, 3] = 90.0, (90.0 + 9.0) / 10
    estimate = Estimate(mean, None, np.full(shape[:2], 10.0), largest)
    measured = METRICS["largest-share"](estimate, Reference(np.ones(shape), np.zeros(shape), 64))
    assert measured.score.value == pytest.approx(90 / (19 * 10 + 99))
    mask = np.zeros(shape[:2], dtype=np.bool_)
    mask[2, 3] = mask[0, 0] = True
    assert measured.over(mask).value == pytest.approx(90 / 109) and "carries 83%" in measured.over(mask).note


def test_a_leak_is_a_share_of_all_light() -> None:
    truth = np.ones((6, 8, 3))
    truth[:, :4] = 0.0
    leaking = truth.copy()
    leaking[1, 1] = 0.3
    for umbra, pixels in (
        (None, 18),
        (truth[..., 0] == 0, 24),
    ):  # what borders on lit pixels may itself be lit in part
        found = METRICS["umbra-leak"](Estimate(leaking), Reference(truth, 0 * truth, 64, umbra)).score
        assert found.value == pytest.approx(0.3 / 24) and found.note == f"{pixels} pixels, 1 of them lit"
    clean = METRICS["umbra-leak"](Estimate(truth), Reference(truth, 0 * truth, 64)).score
    assert (clean.value, clean.low, clean.high) == (0.0, 0.0, 0.0)
    lit = METRICS["umbra-leak"](Estimate(1 + truth), Reference(1 + truth, 0 * truth, 64)).score
    assert lit.value is None and "no pixel is in the umbra" in lit.note
