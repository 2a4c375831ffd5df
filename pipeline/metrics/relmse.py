"""Relative mean squared error with the denominator r^2 + 0.01. How it is measured: squared_error.py."""

from __future__ import annotations

from typing import final

from pipeline.scoring.metric import METRICS, Better, Estimate, Judges, Measured, Reference
from pipeline.scoring.squared_error import weighted_score

FLOOR = 0.01  # squared radiance; keeps a pixel in the umbra from counting without limit, and lets it count


@final
class RelMse:
    """Mean of ((estimate - r)^2 - variance of r) / (r^2 + 0.01), r the reference, over every pixel and
    channel.

    Other programs write relMSE for other denominators (see `relmse-imgtool`, `relmse-simpleimageio`, also r^2
    + 0.0001); figures do not compare across them. The 0.01 is a squared radiance: scaling a scene's lights
    changes the score where r is around 0.1 or less. The noise of r in the denominator adds up to three times
    its relative variance to the score, 0.03 % of it at 1 % noise a pixel.
    """

    name = "relmse"
    title = "relMSE, d² / (r² + 0.01)"
    unit = "1"
    better: Better = "lower"
    judges: Judges = "error"
    source = "simpleimageio 1.13's default floor; every channel counts"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w) of which the measured error is the mean, negative where below
        the reference's noise.
        """
        return weighted_score(self.name, estimate, reference, 1.0 / (reference.mean**2 + FLOOR))


METRICS.add("relmse", RelMse())
