# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false, reportUnknownMemberType=false
"""Peak signal-to-noise ratio of the displayed picture (scikit-image)."""

from __future__ import annotations

from typing import Literal, final

import numpy as np
from skimage.metrics import peak_signal_noise_ratio

from pipeline.metrics.protocol import METRICS, Estimate, Image, Measured, Reference
from pipeline.metrics.squared_error import NOISE_SHARE, scale_interval, standard_error
from pipeline.metrics.tone import displayed, exposure
from pipeline.metrics.undefined import defect, undefined
from pipeline.record import Score


@final
class Psnr:
    """10 log10(1 / MSE) of the pictures as displayed: exposed for the reference, sRGB, clipped to [0, 1], data range 1.

    The reference's noise is in it; where that makes up more than a tenth of the difference, the note says that the value is only a lower bound.
    """

    name = "psnr"
    title = "PSNR (sRGB, exposed for the reference)"
    unit = "dB"
    better: Literal["lower", "higher"] = "higher"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval, infinite for equal pictures; map (h, w): squared difference of the displayed pictures."""
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        scale = exposure(reference.mean)
        shown, truth = displayed(estimate.mean, scale), displayed(reference.mean, scale)
        squared = np.mean((shown - truth) ** 2, axis=-1)
        mean = float(np.mean(squared))
        value = float(peak_signal_noise_ratio(truth, shown, data_range=1.0)) if mean > 0 else float("inf")
        low, high = (_decibels(x) for x in scale_interval(mean, standard_error(squared))[::-1])
        note = f"exposure {scale:.4g}" + ("; a lower bound: reference noise" if _noisy(reference, scale, mean) else "")
        return Measured(Score(metric=self.name, value=value, low=low, high=high, note=note), squared)


def _decibels(mean_square: float) -> float:
    """10 log10(1 / mean square), infinite for 0."""
    return -10.0 * float(np.log10(mean_square)) if mean_square > 0 else float("inf")


def _noisy(reference: Reference, scale: float, mean_square: float) -> bool:
    """Whether the reference's noise, one standard error as displayed, makes up a tenth of the difference."""
    shifted: Image = reference.mean + np.sqrt(reference.variance)
    noise = np.mean((displayed(shifted, scale) - displayed(reference.mean, scale)) ** 2)
    return bool(noise > NOISE_SHARE * mean_square)


METRICS.add("psnr", Psnr())
