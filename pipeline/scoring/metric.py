"""What a metric is given and what it answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.schema.record import Score
from scenes.registry import Registry

Image = NDArray[np.float64]
Mask = NDArray[np.bool_]
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
    """The image it is measured against. mean, variance (of the mean): (h, w, 3); batches: what the variance
    was estimated from.

    umbra: (h, w), the pixels that no light reaches, None where no visibility pass told them.
    """

    mean: Image
    variance: Image
    batches: int
    umbra: Mask | None = None


@dataclass(frozen=True, eq=False)
class Measured:
    """over: the score of the pixels of a mask (h, w), which holds one pixel at least. map: (h, w), where the
    metric has one.

    score: that of the whole image. The map is computed once, however many regions are asked for.
    """

    score: Score
    over: Callable[[Mask], Score]
    map: Image | None = None


@runtime_checkable
class Metric(Protocol):
    """`better` says which way is good, "zero" that either sign is bad; `unit` is for axes and tables;
    `source`: who defines it.

    judges: "error" grows with any difference, noise or bias; "bias" is a mean of signed differences, in which
    noise averages out; "samples" asks the estimate's own samples and not the reference; "defects" counts what
    should not be there at all.
    """

    name: str
    title: str
    unit: str
    better: Better
    judges: Judges
    source: str

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score `estimate` against `reference`; both (h, w, 3).

        Raises PenumbraError where their sizes differ.
        """
        ...


METRICS: Registry[Metric] = Registry("metric", "pipeline.metrics")


def measured(shape: tuple[int, ...], over: Callable[[Mask], Score], map: Image | None = None) -> Measured:
    """A metric's answer from its score over a mask. shape: of the image, (h, w) or (h, w, 3)."""
    return Measured(over(np.ones(shape[:2], dtype=np.bool_)), over, map)
