"""Non-finite pixels, counted apart: a single one makes every other metric undefined."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import measured
from pipeline.scoring.metric import METRICS, Estimate, Image, Judges, Mask, Measured, Metric, Reference


@final
class NonFinite(Metric):
    """The number of the estimate's pixels with an infinite or undefined channel; the map is 1 there."""

    name = "nonfinite"
    title = "Non-finite pixels"
    unit = "pixels"
    judges: Judges = "defects"
    source = "IEEE 754"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        bad: Image = np.where(np.isfinite(estimate.mean).all(axis=-1), 0.0, 1.0)

        def over(mask: Mask) -> Score:
            count = float(np.sum(bad[mask]))
            return Score(metric=self.name, value=count, low=count, high=count)

        return measured(bad.shape, over, bad)


METRICS.add("nonfinite", NonFinite())
