"""Relative mean squared error as pbrt-v4's `imgtool diff --metric MRSE` has it: the denominator (r +
0.01)^2.
"""

from __future__ import annotations

from typing import final

from pipeline.scoring.metric import METRICS, Better, Estimate, Judges, Measured, Reference
from pipeline.scoring.squared_error import weighted_score

FLOOR = 0.01  # radiance


@final
class RelMseImgtool:
    """Mean of ((estimate - r)^2 - variance of r) / (r + 0.01)^2 over every pixel and channel (pbrt-v4,
    Image::MRSE [pharr2023]).

    In the umbra it divides by 1e-4, a hundred times less than `relmse`. imgtool leaves infinite terms out;
    here a pixel that is not finite makes it undefined. It subtracts nothing: against a reference without
    variance the two agree. Against a deterministic reference the interval leaves out that the weight moves
    with the reference, by about 1e-8 of the value at the bounds there are.
    """

    name = "relmse-imgtool"
    title = "relMSE of pbrt's imgtool, d² / (r + 0.01)²"
    unit = "1"
    better: Better = "lower"
    judges: Judges = "error"
    source = "[pharr2023], the program's Image::MRSE"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w) of which the measured error is the mean, negative where below
        the reference's noise.
        """
        return weighted_score(self.name, estimate, reference, 1.0 / (reference.mean + FLOOR) ** 2)


METRICS.add("relmse-imgtool", RelMseImgtool())
