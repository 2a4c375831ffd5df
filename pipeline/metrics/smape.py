"""Symmetric mean absolute percentage error, as a share. How it is measured: absolute_error.py."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.scoring.absolute_error import absolute_score
from pipeline.scoring.metric import METRICS, Better, Estimate, Judges, Measured, Reference
from pipeline.scoring.undefined import same_size

FLOOR = 0.01  # radiance


@final
class Smape:
    """Mean over pixels and channels of |a - r| / (|a| + |r| + 0.01), 0 to 1, as denoisers are trained by it
    [vogels2018].

    Elsewhere the sum below the line is halved (0 to 2) or has no 0.01. A bright outlier counts 1 at most, and
    so does a dark pixel that should be bright.
    """

    name = "smape"
    title = "SMAPE, |d| / (|a| + |r| + 0.01)"
    unit = "1"
    better: Better = "lower"
    judges: Judges = "error"
    source = "[vogels2018]"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w): mean over channels."""
        same_size(estimate, reference)
        weight = 1.0 / (np.abs(estimate.mean) + np.abs(reference.mean) + FLOOR)
        # r moved by b moves |a - r| and what it is divided by each by at most b, and the quotient stays below
        # 1: it moves by at most 2 b
        # over what it is divided by now.
        return absolute_score(self.name, estimate, reference, weight, 2.0 * weight)


METRICS.add("smape", Smape())
