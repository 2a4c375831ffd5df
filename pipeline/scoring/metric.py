"""The protocol of a metric, its arguments and its answer."""

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
    """An image under test, and what is known of its samples: None where only an image was given.

    mean: (h, w, 3). variance: (h, w, 3) of the mean. count: (h, w), samples a pixel. maximum: (h, w, 3), the
    largest sample of reflected light of each pixel and channel.
    """

    mean: Image
    variance: Image | None = None
    count: Image | None = None
    maximum: Image | None = None


@dataclass(frozen=True, eq=False)
class Reference:
    """The image that an estimate is measured against.

    mean, variance (of the mean): (h, w, 3). batches: how many the variance comes from; 0: the reference is
    deterministic, and the variance is the square of its error bound. umbra: (h, w), the pixels that no light
    reaches; None without a visibility pass.
    """

    mean: Image
    variance: Image
    batches: int
    umbra: Mask | None = None


@dataclass(frozen=True, eq=False)
class Measured:
    """score: of the whole image. over: the score of the pixels of a mask (h, w) with at least one pixel.

    map: (h, w), where the metric has one; it is computed once, however many regions are asked for.
    """

    score: Score
    over: Callable[[Mask], Score]
    map: Image | None = None


@runtime_checkable
class Metric(Protocol):
    """A figure of merit. better: the good direction, "zero" if either sign is bad. source: who defines it.

    judges: "error" grows with any difference, noise or bias; "bias" is a mean of signed differences, in which
    noise averages out; "samples" asks the estimate's own samples and not the reference; "defects" counts
    artefacts. squares: whether the score is a mean of squares with the reference's noise subtracted.
    """

    name: str
    title: str
    unit: str
    better: Better
    judges: Judges
    squares: bool
    source: str

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score `estimate` against `reference`; both (h, w, 3).

        Raises PenumbraError where their sizes differ.
        """
        ...


METRICS: Registry[Metric] = Registry("metric", "pipeline.metrics")
