"""Root of the mean squared error, the reference's variance subtracted before the root. How and why: squared_error.py."""

from __future__ import annotations

from typing import Literal, final

import numpy as np

from pipeline.metrics.protocol import METRICS, Estimate, Measured, Reference
from pipeline.metrics.squared_error import squared_error
from pipeline.metrics.undefined import defect, undefined
from pipeline.record import Score


@final
class Rmse:
    """sqrt(MSE) in radiance; the interval's ends are the roots of the MSE's."""

    name = "rmse"
    title = "RMSE"
    unit = "W/(m² sr)"
    better: Literal["lower", "higher"] = "lower"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w): root mean square over channels of the difference, the reference's noise in it."""
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        error = squared_error(estimate, reference)
        value, low, high = (None if x is None else float(np.sqrt(x)) for x in (error.value, error.low, error.high))
        score = Score(metric=self.name, value=value, low=low, high=high, bound=error.bound, note=error.note)
        return Measured(score, np.sqrt(np.mean((estimate.mean - reference.mean) ** 2, axis=-1)))


METRICS.add("rmse", Rmse())
