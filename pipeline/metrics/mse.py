"""Mean squared error, the reference's variance subtracted. How and why: squared_error.py."""

from __future__ import annotations

from typing import Literal, final

from pipeline.metrics.protocol import METRICS, Estimate, Measured, Reference
from pipeline.metrics.squared_error import squared_error
from pipeline.metrics.undefined import defect, undefined
from pipeline.record import Score


@final
class Mse:
    """Mean over pixels and channels of (estimate - reference)^2 - variance of the reference, in squared radiance."""

    name = "mse"
    title = "MSE"
    unit = "(W/(m² sr))²"
    better: Literal["lower", "higher"] = "lower"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w) of which the measured error is the mean, negative where below the reference's noise."""
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        error = squared_error(estimate, reference)
        score = Score(
            metric=self.name, value=error.value, low=error.low, high=error.high, bound=error.bound, note=error.note
        )
        return Measured(score, error.map)


METRICS.add("mse", Mse())
