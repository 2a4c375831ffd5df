# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""CIEDE2000: the difference of colours as displayed, pixel by pixel (colour-science)."""

from __future__ import annotations

import warnings
from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.metric import METRICS, Estimate, Image, Mask, Measured, Metric, Reference
from pipeline.scoring.spread import scale_interval, standard_error
from pipeline.scoring.squared_error import BELOW_NOISE, NOISE_SHARE
from pipeline.scoring.tone import displayed, exposure, shown_noise


@final
class Ciede2000(Metric):
    """Mean CIEDE2000 colour difference [sharma2005] of the displayed pictures' pixels, white point D65.

    Exposed for the reference, sRGB, clipped to [0, 1]. About 1 is just noticeable side by side. It compares
    single pixels, so that fine noise counts as much as a shift of the same size; `flip` blurs as an eye does.
    The formula jumps where hues are 180 degrees apart, so that no bound holds for a small change of the
    reference, and its error does not enter the interval. If that error may move the displayed picture by more
    than a tenth of the squared difference, the value is the interval's upper end, as a bound.
    """

    name = "ciede2000"
    title = "CIEDE2000 (sRGB, exposed for the reference)"
    unit = "ΔE00"
    source = "[sharma2005]; colour-science, delta_E_CIE2000"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        scale = exposure(reference.mean)
        shown, truth = displayed(estimate.mean, scale), displayed(reference.mean, scale)
        pixel, squared = _difference(shown, truth), np.mean((shown - truth) ** 2, axis=-1)

        def over(mask: Mask) -> Score:
            value, note = float(np.mean(pixel[mask])), f"exposure {scale:.4g}"
            low, high = scale_interval(value, standard_error(pixel, mask))
            difference = float(np.mean(squared[mask]))
            if value > 0 and shown_noise(reference, scale, mask) > NOISE_SHARE * difference:
                note = f"{note}; {BELOW_NOISE}"
                return Score(metric=self.name, value=high, low=0.0, high=high, bound=True, note=note)
            return Score(metric=self.name, value=value, low=low, high=high, note=note)

        return measured(pixel.shape, over, pixel)


def _difference(shown: Image, truth: Image) -> Image:
    """The colour differences (h, w) of two sRGB-encoded images (h, w, 3)."""
    # Imported here: it takes a second, and warns of a plotting library that is not needed.
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message='.*"Matplotlib" related API')
        import colour
    left, right = (colour.XYZ_to_Lab(colour.sRGB_to_XYZ(image)) for image in (shown, truth))
    return np.asarray(colour.difference.delta_E_CIE2000(left, right), dtype=np.float64)


METRICS.add("ciede2000", Ciede2000())
