"""HDR-FLIP: what a viewer flipping between the two pictures would notice (NVIDIA's flip-evaluator).

The exposures are chosen here, from the reference, and passed on: from the one that maps its greatest
luminance to 0.85 by the tone mapper to the one that maps the median of its lit pixels there, in steps of at
most one stop [andersson2021]. The library's own choice takes the median over all pixels, which for a
half-black picture gives 26 exposures, and for a black one ends the process; with a single exposure it scores
every picture 0, so that there are never fewer than two.
"""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.flip_library import error_map
from pipeline.scoring.metric import (
    METRICS,
    Better,
    Estimate,
    Image,
    Judges,
    Mask,
    Measured,
    Reference,
    measured,
)
from pipeline.scoring.tone import lit_luminance
from pipeline.scoring.undefined import defect, undefined

WHITE = 0.85  # what the tone mapper is to give at the ends of the range of exposures
ACES = (
    0.6 * 0.6 * 2.51,
    0.6 * 0.03,
    0.0,
    0.6 * 0.6 * 2.43,
    0.6 * 0.59,
    0.14,
)  # (a x^2 + b x + c) / (d x^2 + e x + f)
LARGEST = 1e30  # radiance; float32 and 2^26 more still hold it


@final
class Flip:
    """Mean of the HDR-FLIP error map at 67 pixels a degree, ACES tone mapping: 0 (equal) to 1.

    Negative radiance counts as 0. The map's filters overlap, so that one image gives no interval: replicate
    seeds do.
    """

    name = "flip"
    title = "HDR-FLIP"
    unit = "1"
    better: Better = "lower"
    judges: Judges = "error"
    source = "[andersson2021]; flip-evaluator 1.7"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score; map (h, w) of the error.

        Against a black reference 0 for a black estimate, else undefined: it sets no exposure.
        """
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        truth, shown = (np.clip(image, 0.0, LARGEST) for image in (reference.mean, estimate.mean))
        if np.array_equal(truth, shown):
            return map_mean(self.name, np.zeros(truth.shape[:2]), "equal pictures")
        lit = lit_luminance(truth)
        if lit is None:
            return undefined(self.name, "the reference is black and sets no exposure")
        start, stop, count = exposures(lit)
        chosen = {"startExposure": start, "stopExposure": stop, "numExposures": count, "tonemapper": "aces"}
        error = error_map(truth, shown, "HDR", chosen)
        return map_mean(self.name, error, f"{count} exposures from 2^{start:.2f} to 2^{stop:.2f}")


def map_mean(metric: str, error: Image, note: str) -> Measured:
    """The mean of an error map (h, w) whose pixels are not independent: no interval."""

    def over(mask: Mask) -> Score:
        return Score(metric=metric, value=float(np.mean(error[mask])), note=note)

    return measured(error.shape, over, error)


def exposures(lit: Image) -> tuple[float, float, int]:
    """First and last exposure (binary logarithms) and their number, at least 2. lit: (n,) luminances above 0.
    [andersson2021]
    """
    a, b, c = (over - WHITE * under for over, under in zip(ACES[:3], ACES[3:], strict=True))
    white = (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a)
    start, stop = float(np.log2(white / np.max(lit))), float(np.log2(white / np.median(lit)))
    return start, stop, max(2, int(np.ceil(stop - start)))


METRICS.add("flip", Flip())
