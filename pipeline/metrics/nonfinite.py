"""Pixels that are no numbers, counted apart: every other metric is undefined as soon as there is one."""

from __future__ import annotations

from typing import Literal, final

import numpy as np

from pipeline.metrics.protocol import METRICS, Estimate, Image, Measured, Reference
from pipeline.record import Score


@final
class NonFinite:
    """How many pixels of the estimate have a channel that is infinite or no number."""

    name = "nonfinite"
    title = "Non-finite pixels"
    unit = "pixels"
    better: Literal["lower", "higher"] = "lower"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """The count, which is exact; map (h, w): 1 at such a pixel, 0 elsewhere."""
        bad: Image = np.where(np.isfinite(estimate.mean).all(axis=-1), 0.0, 1.0)
        count = float(np.sum(bad))
        return Measured(Score(metric=self.name, value=count, low=count, high=count), bad)


METRICS.add("nonfinite", NonFinite())
