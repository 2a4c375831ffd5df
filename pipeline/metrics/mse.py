"""Mean squared error, the reference's variance subtracted. How and why: squared_error.py."""

from __future__ import annotations

from typing import final

from pipeline.scoring.metric import METRICS, Better, Estimate, Judges, Measured, Reference
from pipeline.scoring.squared_error import weighted_score


@final
class Mse:
    """Mean over pixels and channels of (estimate - reference)^2 - variance of the reference, in squared
    radiance.
    """

    name = "mse"
    title = "MSE"
    unit = "(W/(m² sr))²"
    better: Better = "lower"
    judges: Judges = "error"
    source = "[pharr2023] sec. 2.1.4"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w) of which the measured error is the mean, negative where below
        the reference's noise.
        """
        return weighted_score(self.name, estimate, reference)


METRICS.add("mse", Mse())
