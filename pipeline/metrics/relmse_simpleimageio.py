"""Relative mean squared error as SimpleImageIO's `relative_mse` has it: r^2 + 0.01, and nothing where r is
0.
"""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.scoring.metric import METRICS, Better, Estimate, Judges, Measured, Reference
from pipeline.scoring.squared_error import weighted_score

FLOOR = 0.01  # squared radiance


@final
class RelMseSimpleImageIo:
    """Mean of ((estimate - r)^2 - variance of r) / (r^2 + 0.01), a channel with r = 0 counting 0 whatever the
    estimate has there.

    So it cannot see a leak into the umbra: it is here to match figures of papers, not to judge by. Measured
    in simpleimageio 1.13, whose outlier-rejecting variant does the same.
    """

    name = "relmse-simpleimageio"
    title = "relMSE of simpleimageio, d² / (r² + 0.01) where r is not 0"
    unit = "1"
    better: Better = "lower"
    judges: Judges = "error"
    source = "simpleimageio 1.13, relative_mse"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w) of which the measured error is the mean, 0 where the reference
        is black.
        """
        weight = np.where(reference.mean == 0, 0.0, 1.0 / (reference.mean**2 + FLOOR))
        return weighted_score(self.name, estimate, reference, weight)


METRICS.add("relmse-simpleimageio", RelMseSimpleImageIo())
