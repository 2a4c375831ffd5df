"""The render's own standard error, without any reference."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.metric import METRICS, Estimate, Image, Judges, Mask, Measured, Metric, Reference
from pipeline.scoring.spread import scale_interval, standard_error


@final
class Noise(Metric):
    """Root mean square over pixels and channels of the standard error of the mean.

    It needs two independent samples a pixel. Beside `rmse` it tells bias from noise: an unbiased render's
    RMSE is its noise. A heavy tail hides itself from both (see `largest-share`). The map is the root mean
    square over channels.
    """

    name = "noise"
    title = "Noise (own standard error)"
    unit = "W/(m² sr)"
    judges: Judges = "samples"
    source = "[pharr2023] sec. 2.1.3"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        if estimate.variance is None or not np.isfinite(estimate.variance).all():
            return undefined(self.name, "the estimate does not know the variance of its mean")
        pixel: Image = np.mean(estimate.variance, axis=-1)

        def over(mask: Mask) -> Score:
            value = float(np.mean(pixel[mask]))
            low, high = scale_interval(value, standard_error(pixel, mask))
            return Score(metric=self.name, value=value**0.5, low=low**0.5, high=high**0.5)

        return measured(pixel.shape, over, np.sqrt(pixel))


METRICS.add("noise", Noise())
