"""Verdicts of `verify`: nominal false alarms, what is inconclusive, what cannot be trusted, and its answer as
JSON.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import scenes
from pipeline.references.protocol import BACKENDS, ReferenceImage, ReferenceRequest
from pipeline.schema.record import SampleStatistics
from pipeline.statistics.moments import Draws, Moments, over_grid
from pipeline.studies.moments import FLOAT32, of_reference, of_render, of_replicates
from pipeline.studies.verify import Side, Trial, Verification, judge, region_masks, verify
from renderer import build, render
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError

SHAPE = (12, 16, 3)
SPP = 64
SMALLER = {"xresolution": 24.0, "yresolution": 18.0}
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
    return Side(Moments(mean, variance, SPP - 1, SPP, draws=Draws(SPP, np.zeros(3), np.full(3, 2.0))), OK)


def reference(rng: np.random.Generator) -> Moments:
    error = 0.2 * truth() / (16 * SPP) ** 0.5
    variance = error**2 * rng.chisquare(63, SHAPE) / 63
    return Moments(truth() + error * rng.standard_normal(SHAPE), variance, 63, 16 * SPP)


def ask(rng: np.random.Generator, trial: Trial, bias: float = 0.0, noise: float = 0.2) -> Verification:
    return judge(trial, side(rng, bias, noise), reference(rng), {"region lit": LIT, "region umbra": DARK})


@pytest.mark.usefixtures("statistical")
def test_false_alarms_are_no_more_than_alpha_of_all_tests_together() -> None:
    """150 true nulls at 10 %: Sidak over five families, which overlap, so that it may be less; and it is not
    far less.
    """
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
    """A render that missed its light agrees with itself: mean 0.5 too low, standard error tiny, and every
    test rejects.
    """
    heavy = replace(
        side(np.random.default_rng(64), bias=-0.5),
        statistics=OK.model_copy(update={"verdict": "untrustworthy"}),
    )
    found = judge(Trial("any"), heavy, reference(np.random.default_rng(65)))
    assert found.verdict == "untrustworthy" and all(test.reject for test in found.tests)


def test_a_leak_into_the_umbra_is_a_bias() -> None:
    leaking = side(np.random.default_rng(66))
    leaking.moments.mean[3, 1] = 1e-3
    found = judge(Trial("any"), leaking, reference(np.random.default_rng(67)), {"region umbra": DARK})
    assert found.verdict == "biased" and next(t for t in found.tests if t.name == "region umbra").reject


def test_a_region_that_few_samples_light_is_no_proof_against_an_exact_reference() -> None:
    """Light that one sample in a million carries was not seen in 64: no bias, in no cell of the grid either.

    Against black any light is.
    """
    exact, ours = Moments(truth(), np.zeros(SHAPE), np.inf), side(np.random.default_rng(68))
    exact.mean[DARK] = 1e-6
    parts = {"region umbra": DARK, "region lit": LIT}
    found = judge(Trial("any"), ours, exact, parts)
    assert [test.name for test in found.tests] == ["image", "regions", "region umbra", "region lit", "pixels"]
    assert not any(test.reject for test in found.tests)
    exact.mean[DARK] = 0.0
    ours.moments.mean[5, 1], ours.moments.variance[5, 1] = 2 / SPP, (2 / SPP) ** 2
    found = judge(Trial("any"), ours, exact, parts)
    assert {test.name for test in found.tests if test.reject} == {"region umbra", "pixels"}


@pytest.mark.parametrize(("spp", "seed"), [(32, 1), (32, 2), (256, 2)])
def test_light_that_no_sample_met_is_no_bias(spp: int, seed: int) -> None:
    """The light's samples are of its area, and a thousandth above the floor: a part of the grid sees none at
    all, and none was due.
    """
    scene = scenes.load("touching-light", {**SMALLER, "gap": 0.001})
    built, exact = build(scene), BACKENDS["closed-form"].render(scene, ReferenceRequest())
    found = verify(built, Trial("area", spp=spp, seed=seed), exact, region_masks(built))
    assert found.verdict != "biased", found.reason
    regions = next(test for test in found.tests if test.name == "regions")
    assert regions.smallest_detectable > 0.005, "of a region that has no variance there is nothing to promise"


def test_an_error_bound_is_no_sampled_variance() -> None:
    sampled = ReferenceImage(truth(), np.full(SHAPE, 1e-6), 64, 64, 0.0, {})
    known, exact = of_reference(sampled), of_reference(replace(sampled, batches=0))
    assert (known.dof, known.samples, known.exact) == (63, 64, False)
    assert (exact.dof, exact.samples, exact.exact) == (np.inf, None, True)
    assert not np.any(exact.variance) and exact.slack == pytest.approx(1e-3)


def test_an_error_bound_adds_up_over_a_region() -> None:
    """0.1 % of unknown sign in every pixel may be 0.1 % of the image.

    Averaged like noise over 192 pixels it would be 0.007 %, and alarm.
    """
    bounded = ReferenceImage(truth(), (1e-3 * truth()) ** 2, 0, 0, 0.0, {})
    reference = of_reference(bounded)
    assert over_grid(reference, (1, 1)).slack == pytest.approx(
        1e-3 * reference.mean.mean(axis=(0, 1))[None, None]
    )
    within = replace(
        side(np.random.default_rng(69), noise=0.0), moments=Moments(0.9991 * truth(), 0 * truth(), np.inf)
    )
    found = judge(Trial("any"), within, reference, {"region lit": LIT})
    assert not any(test.reject for test in found.tests)
    assert 1e-3 <= found.tests[0].smallest_detectable < 1.1e-3
    beyond = replace(within, moments=replace(within.moments, mean=0.998 * truth()))
    assert all(test.reject for test in judge(Trial("any"), beyond, reference, {"region lit": LIT}).tests)


def test_dust_of_float32_in_an_umbra_is_no_bias() -> None:
    """Mitsuba leaves 2e-9 where the truth is 0; what is a thousand times as much is a leak."""
    mean, dark = truth(), np.zeros(SHAPE, dtype=np.bool_)
    mean[DARK], dark[DARK] = 2e-9, True
    sampled = ReferenceImage(mean, np.where(dark, 0.0, (0.2 * mean) ** 2 / 1024), 1024, 64, 0.0, {})
    ours = side(np.random.default_rng(70))
    parts = {"region umbra": DARK}
    assert judge(Trial("any"), ours, of_reference(sampled), parts).verdict != "biased"
    ours.moments.mean[DARK] = 1e4 * FLOAT32
    found = judge(Trial("any"), ours, of_reference(sampled), parts)
    assert next(test for test in found.tests if test.name == "region umbra").reject


def test_the_largest_draw_holds_light_that_is_seen_and_replicates_are_draws() -> None:
    """The lamp in view is 3, 2.6 and 2 and brighter than all that is reflected; of the replicates their
    images count.
    """
    built = build(scenes.load("touching-light", {**SMALLER, "gap": 1.0}))
    result = render(built, estimator="solid-angle", spp=16, seed=3)
    found = of_render(result, 16).draws
    assert found is not None and found.count == 16 and np.max(result.film.maximum) < 1
    assert found.largest == pytest.approx([3.0, 2.6, 2.0]) and not np.any(found.least)
    stacked = of_replicates(np.stack([result.image, 0.5 * result.image])).draws
    assert (
        stacked is not None
        and stacked.count == 2
        and stacked.largest == pytest.approx(result.image.max(axis=(0, 1)))
    )
    signed = render(
        build(scenes.load("knife-edge", SMALLER)), estimator="analytic-visibility-unbiased", spp=16, seed=1
    )
    assert signed.image.min() < 0
    both = of_render(signed, 16).draws
    assert both is not None and np.all(both.least == -both.largest)


@pytest.mark.usefixtures("statistical")
def test_sobol_is_judged_by_replicates() -> None:
    """Against itself with other seeds; by the film's own variance the smallest detectable bias would be
    several times as large.
    """
    built = build(small())
    images = np.stack([render(built, sampler="sobol", spp=16, seed=900 + k).image for k in range(64)])
    exact = ReferenceImage(images.mean(axis=0), images.var(axis=0, ddof=1) / 64, 1024, 64, 0.0, {})
    sobol = verify(built, Trial("area", sampler="sobol", spp=16), exact)
    plain = verify(built, Trial("area", spp=512), exact)
    assert sobol.verdict == plain.verdict == "unbiased"
    assert sobol.tests[0].smallest_detectable < 0.7 * plain.tests[0].smallest_detectable
    assert [test.name for test in sobol.tests] == ["image", "regions"]


def test_sobol_is_judged_against_a_closed_form_pixel_by_pixel() -> None:
    scene = scenes.load("touching-light", {"xresolution": 16.0, "yresolution": 12.0, "gap": 0.1})
    exact = BACKENDS["closed-form"].render(scene, ReferenceRequest())
    found = verify(build(scene), Trial("solid-angle", sampler="sobol", spp=16), exact)
    assert [test.name for test in found.tests] == [
        "image",
        "regions",
        "pixels",
    ] and found.verdict == "unbiased"


@pytest.mark.parametrize(
    ("wrong", "told"),
    [({"spp": 1}, "no variance"), ({"alpha": 1.5}, "between 0 and 1"), ({"bias": 0.0}, "positive share")],
)
def test_numbers_out_of_range_are_told(wrong: dict[str, float], told: str) -> None:
    trial = replace(Trial("area"), **wrong)  # pyright: ignore[reportArgumentType]
    exact = ReferenceImage(truth(), truth(), 64, 64, 0.0, {})
    with pytest.raises(PenumbraError, match=told):
        verify(build(small()), trial, exact)
