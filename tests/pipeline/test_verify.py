"""Verdicts of `verify`: nominal false alarms, what is inconclusive, what cannot be trusted, and its answer as JSON."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import scenes
from pipeline.record import SampleStatistics
from pipeline.references.protocol import ReferenceImage
from pipeline.statistics.welch import Moments
from pipeline.verify import Side, Trial, Verification, judge, moments, verify
from renderer import build, render
from scenes.description import SceneDescription
from scenes.errors import PenumbraError

SHAPE = (12, 16, 3)
SPP = 64
OK = SampleStatistics(noise=0.01, max_share=1e-4, hill=5.0, nonfinite=0, verdict="ok", reason="")
DARK = np.zeros(SHAPE[:2], dtype=np.bool_)
DARK[:, :2] = True
LIT = ~DARK


def small() -> SceneDescription:
    return scenes.load("soft-shadow", {"xresolution": 32.0, "yresolution": 24.0})


def truth() -> np.ndarray:
    image = np.broadcast_to(np.linspace(0.2, 1.0, 16)[None, :, None], SHAPE).copy()
    image[DARK] = 0.0
    return image


def side(rng: np.random.Generator, bias: float = 0.0, noise: float = 0.2) -> Side:
    """64 samples a pixel of 20 % noise each."""
    error = noise * truth() / SPP**0.5
    variance = error**2 * rng.chisquare(SPP - 1, SHAPE) / (SPP - 1)
    mean = truth() * (1 + bias) + error * rng.standard_normal(SHAPE)
    return Side(Moments(mean, variance, SPP - 1, SPP), OK, SPP, 2.0)


def reference(rng: np.random.Generator) -> Moments:
    error = 0.2 * truth() / (16 * SPP) ** 0.5
    variance = error**2 * rng.chisquare(63, SHAPE) / 63
    return Moments(truth() + error * rng.standard_normal(SHAPE), variance, 63, 16 * SPP)


def ask(rng: np.random.Generator, trial: Trial, bias: float = 0.0, noise: float = 0.2) -> Verification:
    return judge(trial, side(rng, bias, noise), reference(rng), {"region lit": LIT, "region umbra": DARK})


def test_false_alarms_are_no_more_than_alpha_of_all_tests_together() -> None:
    """150 true nulls at 10 %: Sidak over five families, which overlap, so that it may be less; and it is not far less."""
    rng, runs = np.random.default_rng(61), 150
    alarms = sum(ask(rng, Trial("any", alpha=0.1)).verdict == "biased" for _ in range(runs))
    assert alarms <= stats.binom.ppf(0.999, runs, 0.1)
    assert alarms >= stats.binom.ppf(0.001, runs, 0.03)


def test_a_bias_is_found_as_promised() -> None:
    """The image's own promise: 95 % of runs with that bias."""
    rng, trial, runs = np.random.default_rng(62), Trial("any", bias=0.02), 40
    power = ask(rng, trial).tests[0].smallest_detectable
    caught = sum(ask(rng, trial, bias=power).verdict == "biased" for _ in range(runs))
    assert power < trial.bias and caught >= stats.binom.ppf(0.001, runs, 0.95)


def test_a_verdict_without_power_is_inconclusive() -> None:
    rng = np.random.default_rng(63)
    found = ask(rng, Trial("any"), noise=4.0)
    assert found.verdict == "inconclusive" and "take more samples" in found.reason
    assert ask(rng, Trial("any", bias=0.5), noise=6.0).verdict == "unbiased"


def test_samples_that_cannot_be_trusted_come_before_any_test() -> None:
    """A render that missed its light agrees with itself: mean 0.5 too low, standard error tiny, and every test rejects."""
    heavy = replace(
        side(np.random.default_rng(64), bias=-0.5), statistics=OK.model_copy(update={"verdict": "untrustworthy"})
    )
    found = judge(Trial("any"), heavy, reference(np.random.default_rng(65)))
    assert found.verdict == "untrustworthy" and all(test.reject for test in found.tests)


def test_a_leak_into_the_umbra_is_a_bias() -> None:
    leaking = side(np.random.default_rng(66))
    leaking.moments.mean[3, 1] = 1e-3
    found = judge(Trial("any"), leaking, reference(np.random.default_rng(67)), {"region umbra": DARK})
    assert found.verdict == "biased" and next(t for t in found.tests if t.name == "region umbra").reject


def test_a_region_that_few_samples_light_is_no_proof_against_an_exact_reference() -> None:
    """Light that one sample in a million carries was not seen in 64: no bias. Against black any light is."""
    exact, ours = Moments(truth(), np.zeros(SHAPE), np.inf), side(np.random.default_rng(68))
    exact.mean[DARK] = 1e-6
    parts = {"region umbra": DARK, "region lit": LIT}
    assert [test.name for test in judge(Trial("any"), ours, exact, parts).tests] == ["image", "regions", "region lit"]
    exact.mean[DARK] = 0.0
    assert "region umbra" in [test.name for test in judge(Trial("any"), ours, exact, parts).tests]


def test_an_error_bound_is_no_sampled_variance() -> None:
    sampled = ReferenceImage(truth(), np.full(SHAPE, 1e-6), 64, 64, 0.0, {})
    assert (moments(sampled).dof, moments(sampled).samples) == (63, 64)
    assert (moments(replace(sampled, batches=0)).dof, moments(replace(sampled, batches=0)).samples) == (np.inf, None)


def test_sobol_is_judged_by_replicates() -> None:
    """Against itself with other seeds; by the film's own variance the smallest detectable bias would be several times as large."""
    built = build(small())
    images = np.stack([render(built, sampler="sobol", spp=16, seed=900 + k).image for k in range(64)])
    exact = ReferenceImage(images.mean(axis=0), images.var(axis=0, ddof=1) / 64, 1024, 64, 0.0, {})
    sobol = verify(built, Trial("area", sampler="sobol", spp=16), exact)
    plain = verify(built, Trial("area", spp=512), exact)
    assert sobol.verdict == plain.verdict == "unbiased"
    assert sobol.tests[0].smallest_detectable < 0.7 * plain.tests[0].smallest_detectable
    assert [test.name for test in sobol.tests] == ["image", "regions"]


@pytest.mark.parametrize(
    ("wrong", "told"),
    [({"spp": 1}, "no variance"), ({"alpha": 1.5}, "between 0 and 1"), ({"bias": 0.0}, "positive share")],
)
def test_numbers_out_of_range_are_told(wrong: dict[str, float], told: str) -> None:
    trial = replace(Trial("area"), **wrong)  # pyright: ignore[reportArgumentType]
    exact = ReferenceImage(truth(), truth(), 64, 64, 0.0, {})
    with pytest.raises(PenumbraError, match=told):
        verify(build(small()), trial, exact)
