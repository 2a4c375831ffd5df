"""Relative mean squared error with the denominator r^2 + 0.01. How it is measured: squared_error.py."""

from __future__ import annotations

from typing import Literal, final

from pipeline.metrics.protocol import METRICS, Estimate, Measured, Reference
from pipeline.metrics.squared_error import squared_error
from pipeline.metrics.undefined import defect, undefined
from pipeline.record import Score

FLOOR = 0.01  # squared radiance; keeps a pixel in the umbra from counting without limit, and lets it count


@final
class RelMse:
    """Mean of ((estimate - r)^2 - variance of r) / (r^2 + 0.01), r the reference, over every pixel and channel.

    Other programs write relMSE for other denominators (r^2 + 0.0001, (r + 0.01)^2); figures do not compare across them. The 0.01 is
    a squared radiance: scaling a scene's lights changes the score where r is around 0.1 or less. The noise of r in the
    denominator adds up to three times its relative variance to the score, 0.03 % of it at 1 % noise a pixel.
    """

    name = "relmse"
    title = "relMSE, d² / (r² + 0.01)"
    unit = "1"
    better: Literal["lower", "higher"] = "lower"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w) of which the measured error is the mean, negative where below the reference's noise."""
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        error = squared_error(estimate, reference, 1.0 / (reference.mean**2 + FLOOR))
        score = Score(
            metric=self.name, value=error.value, low=error.low, high=error.high, bound=error.bound, note=error.note
        )
        return Measured(score, error.map)


METRICS.add("relmse", RelMse())
