"""The protocol of a metric, with the images that it compares and the scores that it returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.schema.record import Score
from scenes.arrays import Mask
from scenes.registry import Registry

Image = NDArray[np.float64]
Better = Literal["lower", "higher", "zero"]
Judges = Literal["error", "bias", "samples", "defects"]


@dataclass(frozen=True, eq=False)
class Estimate:
    """An image under test. Its statistics are None if only an image was given.

    mean: (h, w, 3). variance: (h, w, 3), of the mean. count: (h, w), samples a pixel. maximum: (h, w, 3), the
    largest sample of reflected light of each pixel and channel.
    """

    mean: Image
    variance: Image | None = None
    count: Image | None = None
    maximum: Image | None = None


@dataclass(frozen=True, eq=False)
class Reference:
    """The image that an estimate is measured against.

    mean, variance (of the mean): (h, w, 3). batches: the number behind the variance; with 0 the reference is
    deterministic, and its variance is the square of an error bound. umbra: (h, w), the pixels that no light
    reaches; None without a visibility pass.
    """

    mean: Image
    variance: Image
    batches: int
    umbra: Mask | None = None


@dataclass(frozen=True, eq=False)
class Measured:
    """The answer of a metric.

    score: of the whole image. over: gives the score over a mask (h, w) with at least one pixel. map: (h, w),
    the error of each pixel, or None; it is computed once, however many regions are scored.
    """

    score: Score
    over: Callable[[Mask], Score]
    map: Image | None = None


@runtime_checkable
class Metric(Protocol):
    """A figure of merit.

    better: the good direction; "zero" if either sign is bad. judges: "error" grows with any difference, noise
    or bias; "bias" is a mean of signed differences, in which noise averages out; "samples" judges the
    estimate's own samples without the reference; "defects" counts artefacts. squares: whether the score is a
    mean of squares with the reference's noise subtracted. source: the definition.
    """

    name: str
    title: str
    unit: str
    better: Better = "lower"
    judges: Judges = "error"
    squares: bool = False
    source: str

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score `estimate` against `reference`; PenumbraError if their sizes differ."""
        ...


METRICS: Registry[Metric] = Registry("metric", "pipeline.metrics")
