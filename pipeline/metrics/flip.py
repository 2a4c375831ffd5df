"""HDR-FLIP and LDR-FLIP: the difference that a viewer sees when flipping between two pictures.

NVIDIA's flip-evaluator computes both. The exposures of HDR-FLIP are chosen here, from the reference: from the
one that maps its greatest luminance to 0.85 by the tone mapper to the one that maps the median of its lit
pixels there, in steps of at most one stop [andersson2021]. The library's own choice takes the median over all
pixels: a half-black picture then gets 26 exposures, and a black one ends the process. With a single exposure
the library scores every picture 0, so that there are never fewer than two.

The maps' filters overlap, so that one image gives no interval: replicate seeds do.
"""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.flip_library import error_map
from pipeline.scoring.metric import METRICS, Estimate, Image, Mask, Measured, Metric, Reference
from pipeline.scoring.tone import displayed, exposure, lit_luminance

WHITE = 0.85  # the tone mapper's output at the ends of the range of exposures
# (a x^2 + b x + c) / (d x^2 + e x + f)
ACES = (0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14)
LARGEST = 1e30  # radiance; times 2^26 it still fits float32


@final
class Flip(Metric):
    """Mean of the HDR-FLIP error map at 67 pixels a degree, ACES tone mapping: 0 (equal) to 1.

    Negative radiance counts as 0. A black reference sets no exposure: a black estimate scores 0 against it,
    and any other is undefined.
    """

    name = "flip"
    title = "HDR-FLIP"
    unit = "1"
    source = "[andersson2021]; flip-evaluator 1.7"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        truth, shown = (np.clip(image, 0.0, LARGEST) for image in (reference.mean, estimate.mean))
        if np.array_equal(truth, shown):
            return _map_mean(self.name, np.zeros(truth.shape[:2]), "equal pictures")
        lit = lit_luminance(truth)
        if lit is None:
            return undefined(self.name, "the reference is black and sets no exposure")
        start, stop, count = exposures(lit)
        chosen = {"startExposure": start, "stopExposure": stop, "numExposures": count, "tonemapper": "aces"}
        error = error_map(truth, shown, "HDR", chosen)
        return _map_mean(self.name, error, f"{count} exposures from 2^{start:.2f} to 2^{stop:.2f}")


@final
class FlipLdr(Metric):
    """Mean of the FLIP error map [andersson2020] at 67 pixels a degree of the displayed pictures: 0 to 1.

    Exposed for the reference, sRGB, clipped to [0, 1]: differences above white do not count. `flip` covers a
    range of exposures.
    """

    name = "flip-ldr"
    title = "LDR-FLIP (sRGB, exposed for the reference)"
    unit = "1"
    source = "[andersson2020]; flip-evaluator 1.7"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        scale = exposure(reference.mean)
        truth, shown = displayed(reference.mean, scale), displayed(estimate.mean, scale)
        return _map_mean(self.name, error_map(truth, shown, "LDR", {}), f"exposure {scale:.4g}")


def _map_mean(metric: str, error: Image, note: str) -> Measured:
    """The mean of an error map (h, w) whose pixels are not independent: no interval."""

    def over(mask: Mask) -> Score:
        return Score(metric=metric, value=float(np.mean(error[mask])), note=note)

    return measured(error.shape, over, error)


def exposures(lit: Image) -> tuple[float, float, int]:
    """First and last exposure (binary logarithms) and their number, at least 2 [andersson2021].

    lit: (n,), luminances above 0.
    """
    a, b, c = (over - WHITE * under for over, under in zip(ACES[:3], ACES[3:], strict=True))
    white = (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a)
    start, stop = float(np.log2(white / np.max(lit))), float(np.log2(white / np.median(lit)))
    return start, stop, max(2, int(np.ceil(stop - start)))


METRICS.add("flip", Flip())
METRICS.add("flip-ldr", FlipLdr())
