"""Tests whether an estimator is unbiased against a reference, and states the bias that they would catch.

First the guard: samples with a heavy tail (statistics/samples.py) have no standard error to test by, whatever
their p-values are. Then tests (statistics/welch.py) of the image mean, a grid, each region of the picture,
and each pixel, together held to one level: alpha at most, and less where families overlap or channels share
their samples, so that they reject together. Against an exact reference regions that few large
samples light, and all pixels, are tested by how large samples are (statistics/few_events.py). A verdict of
"unbiased" is only as good as the power behind it: it is "inconclusive" unless the image mean would have
shown a uniform bias of the trial's limit with a probability of 95 %.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.references.protocol import Progress, ReferenceImage
from pipeline.run.job import statistics
from pipeline.schema.record import SampleStatistics
from pipeline.statistics.welch import Correction, Moments, TestResult, allowance, compare_images, sidak_level
from pipeline.studies.moments import of_reference, of_render, of_replicates
from pipeline.studies.regions import find_regions
from renderer import RenderResult, RenderScene, render
from renderer.interfaces.estimator import ESTIMATORS
from renderer.interfaces.sampler import SAMPLERS
from scenes.arrays import Mask
from scenes.errors import PenumbraError

Outcome = Literal["unbiased", "biased", "untrustworthy", "inconclusive"]

REPLICATES = 32  # scrambles of a low-discrepancy sampler, from whose spread its variance comes
GRID = 4  # rows and columns at most


@dataclass(frozen=True)
class Trial:
    """A render to be judged, and the levels to judge it by.

    spp: samples a pixel, in each of 32 renders where samples are not independent. alpha: the chance that an
    unbiased estimator is called biased, all tests together. bias: the relative bias of the image mean that
    must have been caught for a verdict of "unbiased". correction: of the family of pixels.
    """

    estimator: str
    sampler: str = "independent"
    spp: int = 64
    seed: int = 1
    alpha: float = 1e-3
    bias: float = 0.01
    correction: Correction = "sidak"


@dataclass(frozen=True, eq=False)
class Side:
    """The moments of the estimator's image, and the statistics of its samples."""

    moments: Moments
    statistics: SampleStatistics


@dataclass(frozen=True, eq=False)
class Verification:
    """A verdict with its reason in a sentence. level: of each family. image: (h, w, 3), the estimator's."""

    verdict: Outcome
    reason: str
    level: float
    tests: tuple[TestResult, ...]
    image: NDArray[np.float64]


def verify(
    scene: RenderScene,
    trial: Trial,
    reference: ReferenceImage,
    parts: Mapping[str, Mask] | None = None,
    threads: int = 1,
    progress: Progress | None = None,
) -> Verification:
    """Render a scene by the trial's estimator, and test the image against a reference of that scene.

    parts: further regions to test, by name (`region_masks`). PenumbraError if the trial's numbers are out of
    range, or the estimator does not apply to the scene.
    """
    _check(trial)
    return judge(trial, _draw(scene, trial, threads, progress), of_reference(reference), parts)


def region_masks(scene: RenderScene, threads: int = 1) -> dict[str, Mask]:
    """Masks (h, w) of the picture's regions, "region umbra" and so on; none for a scene without lights."""
    found = find_regions(scene, threads=threads)
    return {f"region {name}": mask for name, mask in found.masks().items()} if found else {}


def judge(
    trial: Trial, side: Side, reference: Moments, parts: Mapping[str, Mask] | None = None
) -> Verification:
    """The verdict on an image, by a family of tests each for its mean, a grid, every part, and its pixels."""
    ours, named = side.moments, parts or {}
    height, width = ours.mean.shape[:2]
    grid = (min(GRID, height), min(GRID, width))
    level = sidak_level(trial.alpha, 3 + len(named))
    tests = tuple(compare_images(ours, reference, grid, level, named, trial.correction))
    if _found_nothing(ours, reference):
        verdict, reason = _black(trial)
    else:
        verdict, reason = _verdict(trial, side.statistics, tests)
    return Verification(verdict, reason, level, tests, ours.mean)


def _found_nothing(ours: Moments, reference: Moments) -> bool:
    """True if the estimator's image is black and the reference's is not."""
    light = reference.mean > allowance(ours, reference) + 6.0 * np.sqrt(reference.variance)
    return not np.any(ours.mean) and bool(np.any(light))


def _black(trial: Trial) -> tuple[Outcome, str]:
    """The verdict on a black image: untrustworthy where light is met by chance, else biased."""
    known = trial.estimator in ESTIMATORS.names()
    if known and ESTIMATORS[trial.estimator].meets_lights_by_chance:
        return (
            "untrustworthy",
            "none of its samples met the light that the reference has: nothing tells how rare it is",
        )
    return "biased", "its image is black, and the reference is not"


def _check(trial: Trial) -> None:
    if trial.spp < 2:
        raise PenumbraError(
            f"spp is {trial.spp}: one sample a pixel has no variance, and nothing can be tested; give "
            "at least 2"
        )
    if not 0 < trial.alpha < 1:
        raise PenumbraError(f"alpha is {trial.alpha:g}: the chance of a false alarm lies between 0 and 1")
    if not trial.bias > 0:
        raise PenumbraError(
            f"the bias to be caught is {trial.bias:g}: give a positive share, for example 0.01"
        )


def _draw(scene: RenderScene, trial: Trial, threads: int, progress: Progress | None) -> Side:
    """One render of independent samples, or replicates of others with the first one's statistics."""

    def once(seed: int, progress: Progress | None = None) -> RenderResult:
        return render(
            scene,
            estimator=trial.estimator,
            sampler=trial.sampler,
            spp=trial.spp,
            seed=seed,
            threads=threads,
            progress=progress,
        )

    if SAMPLERS[trial.sampler].independent:
        one = once(trial.seed, progress)
        return Side(of_render(one, trial.spp), statistics(one))
    first = once(trial.seed)
    images = [first.image]
    for number in range(1, REPLICATES):
        images.append(once(trial.seed + number).image)
        if progress:
            progress((number + 1) / REPLICATES)
    return Side(of_replicates(np.stack(images)), statistics(first))


def _verdict(trial: Trial, samples: SampleStatistics, tests: tuple[TestResult, ...]) -> tuple[Outcome, str]:
    """Untrustworthy first, as tests of such samples mean nothing; then biased, inconclusive, unbiased."""
    if samples.verdict != "ok":
        return "untrustworthy", f"its samples cannot tell their own error: {samples.reason}"
    rejected = [test for test in tests if test.reject]
    if rejected:
        worst = min(rejected, key=lambda test: test.p)
        return "biased", f"{len(rejected)} of {len(tests)} tests reject; {worst}"
    power = next(test for test in tests if test.name == "image").smallest_detectable
    caught = f"a bias of the image mean of {power:.3%} would have been caught with a probability of 95 %"
    if power > trial.bias:
        return (
            "inconclusive",
            f"no test rejects, but only {caught}, and {trial.bias:.3%} was asked for: take more samples",
        )
    return "unbiased", f"no test rejects; {caught}"
