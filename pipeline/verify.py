"""Is an estimator unbiased? One render against a reference, by tests that say what they would have caught.

First the guard: samples whose own tail is heavy (statistics/samples.py) have no standard error to test by, whatever p-values
come out. Then Welch's tests (statistics/welch.py) of the image mean, a grid, each region of the picture, and each pixel, together held to
one level. A verdict of "unbiased" is only as good as the power behind it: where a uniform bias of the limit that was asked for
would not have been caught on the image mean with a probability of 95 %, the verdict is "inconclusive".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.job import statistics
from pipeline.record import SampleStatistics
from pipeline.references.protocol import Progress, ReferenceImage
from pipeline.regions import find_regions
from pipeline.statistics.welch import (
    Correction,
    Moments,
    TestResult,
    batch_moments,
    compare_images,
    sidak_level,
    vary_alike,
)
from renderer import RenderResult, RenderScene, render
from renderer.samplers.protocol import SAMPLERS
from scenes.errors import PenumbraError

Mask = NDArray[np.bool_]
Outcome = Literal["unbiased", "biased", "untrustworthy", "inconclusive"]

REPLICATES = 32  # scrambles of a low-discrepancy sampler, from whose spread its variance comes
GRID = 4  # rows and columns at most
EVENTS = 100.0  # samples as large as the largest that must make up a region's light for its mean to be tested by itself


@dataclass(frozen=True)
class Trial:
    """What is rendered and how it is judged.

    spp: samples a pixel, in each of 32 renders where samples are not independent. alpha: the chance that an unbiased estimator is called
    biased, all tests together. bias: the relative bias of the image mean that must have been caught for a verdict of "unbiased".
    correction: of the family of pixels.
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
    """The estimator's side. statistics: what its samples say of themselves. drawn: samples a pixel; largest: the luminance of the largest."""

    moments: Moments
    statistics: SampleStatistics
    drawn: int
    largest: float


@dataclass(frozen=True, eq=False)
class Verification:
    """verdict with its reason, a sentence. level: what each family's p is held against. image: (h, w, 3), the estimator's."""

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
    """Render the scene by the trial's estimator and test it against the reference, which must be of the same scene.

    parts: regions to test besides, by name (see `region_masks`). PenumbraError where the trial's numbers are out of range,
    and where the estimator does not apply to the scene.
    """
    _check(trial)
    return judge(trial, _draw(scene, trial, threads, progress), moments(reference), parts)


def region_masks(scene: RenderScene, threads: int = 1) -> dict[str, Mask]:
    """The regions of the scene's picture, "region umbra" and so on, to masks (h, w); none for a scene without lights."""
    found = find_regions(scene, threads=threads)
    return {f"region {name}": mask for name, mask in found.masks().items()} if found else {}


def moments(reference: ReferenceImage) -> Moments:
    """A reference as one side of a test. One that was not sampled has the square of its error bound for a variance."""
    if reference.batches == 0:
        return Moments(reference.mean, reference.variance, np.inf)
    return Moments(reference.mean, reference.variance, reference.batches - 1, samples=reference.spp)


def judge(trial: Trial, side: Side, reference: Moments, parts: Mapping[str, Mask] | None = None) -> Verification:
    """The verdict on one side of a comparison with its reference.

    A region that only a few large samples can light is left out where nothing that the reference knows tells how rare they are
    (`vary_alike`): no sample seen is then no sign of bias. A region that is black in the reference always stays.
    """
    ours = side.moments
    height, width = ours.mean.shape[:2]
    grid = (min(GRID, height), min(GRID, width))
    alike = vary_alike(ours, reference)
    named = {name: mask for name, mask in (parts or {}).items() if alike or _told(side, reference, mask)}
    level = sidak_level(trial.alpha, 3 + len(named))
    tests = tuple(compare_images(ours, reference, grid, level, named, trial.correction))
    verdict, reason = _verdict(trial, side.statistics, tests)
    return Verification(verdict, reason, level, tests, ours.mean)


def _told(side: Side, reference: Moments, mask: Mask) -> bool:
    """Whether EVENTS of the largest samples would make up no more than the region's light, or it has none."""
    light = float(np.sum(np.mean(reference.mean[mask], axis=-1))) * side.drawn
    return light == 0.0 or light >= EVENTS * side.largest


def _check(trial: Trial) -> None:
    if trial.spp < 2:
        raise PenumbraError(
            f"spp is {trial.spp}: one sample a pixel has no variance, and nothing can be tested; give at least 2"
        )
    if not 0 < trial.alpha < 1:
        raise PenumbraError(f"alpha is {trial.alpha:g}: the chance of a false alarm lies between 0 and 1")
    if not trial.bias > 0:
        raise PenumbraError(f"the bias to be caught is {trial.bias:g}: give a positive share, for example 0.01")


def _draw(scene: RenderScene, trial: Trial, threads: int, progress: Progress | None) -> Side:
    """One render of independent samples, or replicates of others, whose first one's samples are asked about themselves."""

    def once(seed: int, told: Progress | None = None) -> RenderResult:
        return render(
            scene,
            estimator=trial.estimator,
            sampler=trial.sampler,
            spp=trial.spp,
            seed=seed,
            threads=threads,
            progress=told,
        )

    if SAMPLERS[trial.sampler].independent:
        one = once(trial.seed, progress)
        side = Moments(one.image, one.variance, trial.spp - 1, samples=trial.spp)
        return Side(side, statistics(one), trial.spp, float(np.max(one.tail, initial=0.0)))
    first = once(trial.seed)
    images = [first.image]
    for number in range(1, REPLICATES):
        images.append(once(trial.seed + number).image)
        if progress:
            progress((number + 1) / REPLICATES)
    largest = float(np.max(first.tail, initial=0.0))
    return Side(batch_moments(np.stack(images)), statistics(first), REPLICATES * trial.spp, largest)


def _verdict(trial: Trial, samples: SampleStatistics, tests: tuple[TestResult, ...]) -> tuple[Outcome, str]:
    """untrustworthy before biased, as the tests of such samples mean nothing; biased before inconclusive, as what was caught was caught."""
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
