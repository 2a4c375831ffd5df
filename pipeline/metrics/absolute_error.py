"""Mean absolute errors, plain (MAE) and relative (SMAPE); scoring/absolute_error.py has their interval."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.scoring.absolute_error import absolute_score
from pipeline.scoring.answers import same_size
from pipeline.scoring.metric import METRICS, Estimate, Measured, Metric, Reference

FLOOR = 0.01  # radiance


@final
class Mae(Metric):
    """Mean over pixels and channels of |estimate - reference| (imgtool's MAE [pharr2023])."""

    name = "mae"
    title = "MAE"
    unit = "W/(m² sr)"
    source = "[pharr2023], the program's Image::MAE"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        return absolute_score(self.name, estimate, reference)


@final
class Smape(Metric):
    """Mean over pixels and channels of |a - r| / (|a| + |r| + 0.01), 0 to 1, a denoiser's loss [vogels2018].

    Other programs halve the denominator (0 to 2) or omit the 0.01. A bright outlier counts 1 at most, and so
    does a dark pixel that should be bright.
    """

    name = "smape"
    title = "SMAPE, |d| / (|a| + |r| + 0.01)"
    unit = "1"
    source = "[vogels2018]"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        same_size(estimate, reference)
        weight = 1.0 / (np.abs(estimate.mean) + np.abs(reference.mean) + FLOOR)
        # A shift b of r moves |a - r| and the denominator by at most b each, and the quotient is below 1: it
        # moves by at most 2 b over the denominator.
        return absolute_score(self.name, estimate, reference, weight, 2.0 * weight)


METRICS.add("mae", Mae())
METRICS.add("smape", Smape())
