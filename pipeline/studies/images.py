"""The verdict on images that were rendered elsewhere: do they show a reference's picture?

Replicates of other seeds tell their noise by their spread, whatever the sampler. A single image needs the
variance of its mean. From a single image without it nothing follows, and none is claimed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.scoring.metric import Estimate, Reference
from pipeline.statistics.moments import Moments
from pipeline.statistics.welch import TestResult, compare_images, sidak_level
from pipeline.studies.moments import FLOAT32, of_replicates
from scenes.errors import PenumbraError

GRID = 4  # rows and columns of regions at most
FAMILIES = 3  # the image, its regions and, where they can be tested, its pixels


@dataclass(frozen=True, eq=False)
class Judgement:
    """A verdict with its reason in a sentence. tests: one for each family of comparisons."""

    verdict: Literal["agrees", "differs", "inconclusive"]
    reason: str
    tests: tuple[TestResult, ...]


def judge_images(
    images: Sequence[Estimate], truth: Reference, alpha: float = 1e-3, bias: float = 0.01
) -> Judgement:
    """Whether images of one method show the reference's picture.

    images: replicates of other seeds, or a single image with its variance. alpha: chance of a false alarm,
    all tests together. bias: the relative bias of the image mean that must have been caught, with a
    probability of 95 %, for a verdict of "agrees". PenumbraError where nothing can be claimed.
    """
    if not 0 < alpha < 1 or not bias > 0:
        raise PenumbraError(f"alpha is {alpha:g}, bias {bias:g}: give a chance below 1, and a positive bias")
    for number, image in enumerate(images, start=1):
        if image.mean.shape != truth.mean.shape:
            sizes = (
                " x ".join(map(str, image.mean.shape[1::-1])),
                " x ".join(map(str, truth.mean.shape[1::-1])),
            )
            raise PenumbraError(f"image {number} has {sizes[0]} pixels, the reference {sizes[1]}")
    height, width = truth.mean.shape[:2]
    grid, level = (min(GRID, height), min(GRID, width)), sidak_level(alpha, FAMILIES)
    tests = tuple(compare_images(_moments(images), _truth(truth), grid, level))
    rejected = [test for test in tests if test.reject]
    if rejected:
        return Judgement("differs", str(min(rejected, key=lambda test: test.p)), tests)
    caught = tests[0].smallest_detectable
    told = f"a bias of the image mean of {caught:.3%} would have been caught with a probability of 95 %"
    if caught > bias:
        reason = (
            f"no test rejects, but only {told}, and {bias:.3%} was asked for: give more or longer renders"
        )
        return Judgement("inconclusive", reason, tests)
    return Judgement("agrees", f"no test rejects; {told}", tests)


def _moments(images: Sequence[Estimate]) -> Moments:
    if len(images) > 1:
        stack = np.stack([image.mean for image in images])
        if np.ptp(stack, axis=0).max() == 0:
            raise PenumbraError("the images are equal: replicates need other seeds")
        return of_replicates(stack)
    (image,) = images
    if image.variance is None or image.count is None or image.count.min() < 2:
        raise PenumbraError(
            "one image without the variance of its mean tells nothing of its noise: give replicates of other "
            "seeds, or channels variance.R, variance.G, variance.B and N, its samples"
        )
    return Moments(image.mean, image.variance, float(image.count.min()) - 1)


def _truth(truth: Reference) -> Moments:
    """The moments of a reference; the variance of a deterministic one is the square of its error bound."""
    if truth.batches == 0:
        return Moments(truth.mean, np.zeros_like(truth.mean), np.inf, bound=np.sqrt(truth.variance))
    bound = np.full_like(truth.mean, FLOAT32 * float(np.abs(truth.mean).mean()))
    return Moments(truth.mean, truth.variance, max(truth.batches - 1, 1), bound=bound)
