"""Mean signed error: the part of an error that averaging does not remove."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.metric import (
    METRICS,
    Better,
    Estimate,
    Image,
    Judges,
    Mask,
    Measured,
    Metric,
    Reference,
)
from pipeline.scoring.spread import standard_error
from pipeline.statistics.intervals import NORMAL


@final
class Bias(Metric):
    """Mean over pixels and channels of estimate - reference; an unbiased estimator's interval covers 0.

    The interval is normal, from the variances of both sides, with channels taken as fully correlated. Without
    the estimate's variance it comes from the spread of differences among neighbours (spread.py), which
    includes the reference's noise. A deterministic reference widens it by its mean error bound. To test for
    bias use `penumbra verify`. The map is the mean signed difference over channels.
    """

    name = "bias"
    title = "Bias (mean signed error)"
    unit = "W/(m² sr)"
    better: Better = "zero"
    judges: Judges = "bias"
    source = "[pharr2023] sec. 2.1.4"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        pixel: Image = np.mean(estimate.mean - reference.mean, axis=-1)
        deviation = np.mean(np.sqrt(reference.variance), axis=-1)

        def over(mask: Mask) -> Score:
            value, truth = float(np.mean(pixel[mask])), float(np.mean(reference.mean[mask]))
            half = _half(estimate, reference, pixel, deviation, mask)
            note = f"{value / truth:+.3%} of the reference's mean" if truth else ""
            return Score(metric=self.name, value=value, low=value - half, high=value + half, note=note)

        return measured(pixel.shape, over, pixel)


def _half(estimate: Estimate, reference: Reference, pixel: Image, deviation: Image, mask: Mask) -> float:
    """Half the width of the interval. pixel, deviation (of the reference), mask: (h, w)."""
    bound = float(np.mean(deviation[mask])) if reference.batches == 0 else 0.0
    if estimate.variance is None or not np.isfinite(estimate.variance[mask]).all():
        return NORMAL * standard_error(pixel, mask) + bound
    own = np.mean(np.sqrt(estimate.variance), axis=-1)[mask] ** 2
    other = deviation[mask] ** 2 if reference.batches else np.zeros_like(own)
    return NORMAL * float(np.sqrt(np.sum(own + other))) / own.size + bound


METRICS.add("bias", Bias())
