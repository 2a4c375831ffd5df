"""Answers that metrics share: a score over masks, or the reason why there is no score."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.metric import Estimate, Image, Mask, Measured, Reference
from scenes.errors import PenumbraError


def measured(shape: tuple[int, ...], over: Callable[[Mask], Score], map: Image | None = None) -> Measured:
    """A metric's answer. shape: of the image, (h, w) or (h, w, 3). over: its score over a mask (h, w)."""
    return Measured(over(np.ones(shape[:2], dtype=np.bool_)), over, map)


def undefined(metric: str, note: str) -> Measured:
    """The answer of a metric without a value, neither for the image nor for any region; `note` says why."""
    score = Score(metric=metric, value=None, note=note)

    def over(mask: Mask) -> Score:
        return score

    return Measured(score, over)


def nonfinite_pixels(image: Image) -> int:
    """The number of pixels with a channel that is not finite. image: (h, w, 3)."""
    return int(np.count_nonzero(~np.isfinite(image).all(axis=-1)))


def same_size(estimate: Estimate, reference: Reference) -> None:
    """Raise PenumbraError if the two differ in size."""
    if estimate.mean.shape != reference.mean.shape:
        raise PenumbraError(
            f"images of different sizes: {_size(estimate.mean)} against a reference of "
            f"{_size(reference.mean)}"
        )


def defect(estimate: Estimate, reference: Reference) -> str | None:
    """Say why the two cannot be compared; None if they can. PenumbraError if their sizes differ."""
    same_size(estimate, reference)
    for image, whose in ((estimate.mean, "the estimate"), (reference.mean, "the reference")):
        if count := nonfinite_pixels(image):
            return f"{count:,} of {image.shape[0] * image.shape[1]:,} pixels of {whose} are not finite"
    if count := nonfinite_pixels(np.where(reference.variance >= 0, reference.variance, np.nan)):
        return f"the reference's variance is undefined in {count:,} pixels"
    return None


def _size(image: Image) -> str:
    return f"{image.shape[1]} x {image.shape[0]}"
