"""What a metric is given and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.record import Score
from scenes.registry import Registry

Image = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Estimate:
    """An image under test. mean: (h, w, 3). variance: (h, w, 3) of the mean, None where only an image was given."""

    mean: Image
    variance: Image | None = None


@dataclass(frozen=True, eq=False)
class Reference:
    """The image it is measured against. mean, variance (of the mean): (h, w, 3); batches: what the variance was estimated from."""

    mean: Image
    variance: Image
    batches: int


@dataclass(frozen=True, eq=False)
class Measured:
    """A score and, where the metric is a mean over pixels, its map (h, w)."""

    score: Score
    map: Image | None = None


@runtime_checkable
class Metric(Protocol):
    """`better` says which way is good; `unit` is for axes and tables."""

    name: str
    title: str
    unit: str
    better: Literal["lower", "higher"]

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score `estimate` against `reference`; both (h, w, 3). Raises PenumbraError where their sizes differ."""
        ...


METRICS: Registry[Metric] = Registry("metric", "pipeline.metrics")
