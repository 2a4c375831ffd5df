"""Means of absolute differences, plain or relative.

The reference's variance cannot be subtracted from them: its noise makes them upper bounds.
"""

from __future__ import annotations

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.metric import Estimate, Image, Mask, Measured, Reference
from pipeline.scoring.spread import scale_interval, standard_error
from pipeline.scoring.squared_error import BELOW_NOISE, noise_limit, squared_error


def absolute_score(
    metric: str,
    estimate: Estimate,
    reference: Reference,
    weight: Image | float = 1.0,
    steepest: Image | float | None = None,
) -> Measured:
    """Mean over pixels and channels of |estimate - reference| * weight, with its interval.

    The reference's noise only ever adds to the expectation: a mean of |d + e| over errors e of mean 0 is no
    less than |d|. It adds at most 5 % where the reference's variance is a tenth of the squared error; beyond
    that the upper end is given, as a bound. A deterministic reference (0 batches) may be off by b, of unknown
    sign. No pixel's score is then off by more than b * steepest, so that both ends of the interval move out
    by its mean. steepest: (h, w, 3), the largest slope of the score in the reference; default: `weight`.
    """
    if note := defect(estimate, reference):
        return undefined(metric, note)
    pixel: Image = np.mean(np.abs(estimate.mean - reference.mean) * weight, axis=-1)
    squared = (weight * weight) if isinstance(weight, float) else weight**2
    off = np.sqrt(reference.variance) * (weight if steepest is None else steepest)
    slack: Image = np.mean(off, axis=-1) if reference.batches == 0 else np.zeros_like(pixel)

    def over(mask: Mask) -> Score:
        value, beyond = float(np.mean(pixel[mask])), float(np.mean(slack[mask]))
        low, high = scale_interval(value, standard_error(pixel, mask))
        low, high = max(low - beyond, 0.0), high + beyond
        if value > 0 and noise_limit(squared_error(estimate, reference, squared, mask)):
            return Score(metric=metric, value=high, low=0.0, high=high, bound=True, note=BELOW_NOISE)
        return Score(metric=metric, value=value, low=low, high=high)

    return measured(pixel.shape, over, pixel)
