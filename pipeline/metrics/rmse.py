"""Root of the mean squared error, the reference's variance subtracted before the root.

How and why: squared_error.py.
"""

from __future__ import annotations

from dataclasses import replace
from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.metric import METRICS, Better, Estimate, Judges, Mask, Measured, Reference, measured
from pipeline.scoring.squared_error import squared_error, to_score
from pipeline.scoring.undefined import defect, undefined


@final
class Rmse:
    """sqrt(MSE) in radiance; the interval's ends are the roots of the MSE's."""

    name = "rmse"
    title = "RMSE"
    unit = "W/(m² sr)"
    better: Better = "lower"
    judges: Judges = "error"
    source = "[pharr2023] sec. 2.1.4"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w): root mean square over channels of the difference, the
        reference's noise in it.
        """
        if note := defect(estimate, reference):
            return undefined(self.name, note)

        def over(mask: Mask) -> Score:
            error = squared_error(estimate, reference, mask=mask)
            roots = (None if x is None else float(np.sqrt(x)) for x in (error.value, error.low, error.high))
            value, low, high = roots
            return to_score(self.name, replace(error, value=value, low=low, high=high))

        root = np.sqrt(np.mean((estimate.mean - reference.mean) ** 2, axis=-1))
        return measured(root.shape, over, root)


METRICS.add("rmse", Rmse())
