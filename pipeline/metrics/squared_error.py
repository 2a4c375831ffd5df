"""Mean squared errors that differ by a root or a denominator: MSE, RMSE and three kinds of relMSE.

All subtract the reference's variance and score every pixel and channel; scoring/squared_error.py derives the
debiasing and the interval. Each map but RMSE's averages to the measured error, and is negative in pixels
where the estimate is closer to the reference than the reference's own noise.
"""

from __future__ import annotations

from dataclasses import replace
from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.metric import METRICS, Estimate, Mask, Measured, Metric, Reference
from pipeline.scoring.squared_error import squared_error, to_score, weighted_score

FLOOR = 0.01  # squared radiance; keeps a pixel in the umbra from counting without limit, and lets it count
IMGTOOL_FLOOR = 0.01  # radiance


@final
class Mse(Metric):
    """Mean over pixels and channels of (estimate - reference)^2 - variance of the reference."""

    name = "mse"
    title = "MSE"
    unit = "(W/(m² sr))²"
    squares = True
    source = "[pharr2023] sec. 2.1.4"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        return weighted_score(self.name, estimate, reference)


@final
class Rmse(Metric):
    """sqrt(MSE); the interval's ends are the roots of the MSE's.

    Its map is the root mean square over channels of the difference, the reference's noise included.
    """

    name = "rmse"
    title = "RMSE"
    unit = "W/(m² sr)"
    source = "[pharr2023] sec. 2.1.4"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        if note := defect(estimate, reference):
            return undefined(self.name, note)

        def over(mask: Mask) -> Score:
            error = squared_error(estimate, reference, mask=mask)
            value, low, high = (
                None if x is None else float(np.sqrt(x)) for x in (error.value, error.low, error.high)
            )
            return to_score(self.name, replace(error, value=value, low=low, high=high))

        root = np.sqrt(np.mean((estimate.mean - reference.mean) ** 2, axis=-1))
        return measured(root.shape, over, root)


@final
class RelMse(Metric):
    """Mean of ((estimate - r)^2 - variance of r) / (r^2 + 0.01), r the reference.

    Other programs write relMSE for other denominators (see `relmse-imgtool`, `relmse-simpleimageio`, also
    r^2 + 0.0001); figures do not compare across them. The 0.01 is a squared radiance: scaling a scene's
    lights changes the score where r is around 0.1 or less. The noise of r in the denominator adds up to three
    times its relative variance to the score, 0.03 % of it at 1 % noise a pixel.
    """

    name = "relmse"
    title = "relMSE, d² / (r² + 0.01)"
    unit = "1"
    squares = True
    source = "simpleimageio 1.13's default floor; every channel counts"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        return weighted_score(self.name, estimate, reference, 1.0 / (reference.mean**2 + FLOOR))


@final
class RelMseImgtool(Metric):
    """Mean of ((estimate - r)^2 - variance of r) / (r + 0.01)^2, as `imgtool diff --metric MRSE` has it.

    pbrt-v4's Image::MRSE [pharr2023]. In the umbra it divides by 1e-4, a hundred times less than `relmse`.
    imgtool leaves infinite terms out; here a pixel that is not finite makes the metric undefined. imgtool
    subtracts nothing: against a reference without variance the two agree. Against a deterministic reference
    the weight moves with the reference by about 1e-8 of the value, which the interval leaves out.
    """

    name = "relmse-imgtool"
    title = "relMSE of pbrt's imgtool, d² / (r + 0.01)²"
    unit = "1"
    squares = True
    source = "[pharr2023], the program's Image::MRSE"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        return weighted_score(self.name, estimate, reference, 1.0 / (reference.mean + IMGTOOL_FLOOR) ** 2)


@final
class RelMseSimpleImageIo(Metric):
    """Mean of ((estimate - r)^2 - variance of r) / (r^2 + 0.01), where a channel with r = 0 counts 0.

    SimpleImageIO's `relative_mse`, measured in version 1.13, whose outlier-rejecting variant does the same.
    It cannot see a leak into the umbra: it is here to match figures of papers, not to judge by.
    """

    name = "relmse-simpleimageio"
    title = "relMSE of simpleimageio, d² / (r² + 0.01) where r is not 0"
    unit = "1"
    squares = True
    source = "simpleimageio 1.13, relative_mse"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        weight = np.where(reference.mean == 0, 0.0, 1.0 / (reference.mean**2 + FLOOR))
        return weighted_score(self.name, estimate, reference, weight)


for _metric in (Mse(), Rmse(), RelMse(), RelMseImgtool(), RelMseSimpleImageIo()):
    METRICS.add(_metric.name, _metric)
