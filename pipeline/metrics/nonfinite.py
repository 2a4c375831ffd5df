"""Pixels that are no numbers, counted apart: every other metric is undefined as soon as there is one."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.metric import (
    METRICS,
    Better,
    Estimate,
    Image,
    Judges,
    Mask,
    Measured,
    Reference,
    measured,
)


@final
class NonFinite:
    """How many pixels of the estimate have a channel that is infinite or no number."""

    name = "nonfinite"
    title = "Non-finite pixels"
    unit = "pixels"
    better: Better = "lower"
    judges: Judges = "defects"
    source = "IEEE 754"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """The count, which is exact; map (h, w): 1 at such a pixel, 0 elsewhere.

        Looks at the estimate alone.
        """
        bad: Image = np.where(np.isfinite(estimate.mean).all(axis=-1), 0.0, 1.0)

        def over(mask: Mask) -> Score:
            count = float(np.sum(bad[mask]))
            return Score(metric=self.name, value=count, low=count, high=count)

        return measured(bad.shape, over, bad)


METRICS.add("nonfinite", NonFinite())
