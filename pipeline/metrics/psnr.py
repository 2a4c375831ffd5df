# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false, reportUnknownMemberType=false
"""Peak signal-to-noise ratio of the displayed picture (scikit-image)."""

from __future__ import annotations

from typing import final

import numpy as np
from skimage.metrics import peak_signal_noise_ratio

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.metric import METRICS, Better, Estimate, Mask, Measured, Metric, Reference
from pipeline.scoring.spread import scale_interval, standard_error
from pipeline.scoring.squared_error import BELOW_NOISE, NOISE_SHARE, within_bound
from pipeline.scoring.tone import displayed, exposure, shown_noise


@final
class Psnr(Metric):
    """10 log10(1 / MSE) of the displayed pictures: exposed for the reference, sRGB, clipped to [0, 1].

    The interval is that of the displayed pictures' MSE, taken through the logarithm; equal pictures score
    infinity. The reference's noise is part of the difference: above a tenth of it, the value is the
    interval's lower end and is marked as a bound. A deterministic reference's error bound, as displayed,
    moves the ends out. The map is the squared difference.
    """

    name = "psnr"
    title = "PSNR (sRGB, exposed for the reference)"
    unit = "dB"
    better: Better = "higher"
    source = "scikit-image, peak_signal_noise_ratio"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        scale = exposure(reference.mean)
        shown, truth = displayed(estimate.mean, scale), displayed(reference.mean, scale)
        squared = np.mean((shown - truth) ** 2, axis=-1)

        def over(mask: Mask) -> Score:
            mean, note = float(np.mean(squared[mask])), f"exposure {scale:.4g}"
            ends = scale_interval(mean, standard_error(squared, mask))
            noise = shown_noise(reference, scale, mask)
            ends = ends if reference.batches else within_bound(mean, ends, noise)[:2]
            high, low = (_decibels(x) for x in ends)
            if noise > NOISE_SHARE * mean:
                note = f"{note}; a lower bound: {BELOW_NOISE}"
                return Score(metric=self.name, value=low, low=low, high=high, bound=True, note=note)
            if mean == 0:
                note = f"{note}; infinite: equal as displayed"
                return Score(metric=self.name, value=np.inf, low=np.inf, high=np.inf, note=note)
            value = peak_signal_noise_ratio(truth[mask], shown[mask], data_range=1.0)
            return Score(metric=self.name, value=float(value), low=low, high=high, note=note)

        return measured(squared.shape, over, squared)


def _decibels(mean_square: float) -> float:
    """10 log10(1 / mean square), infinite for 0."""
    return -10.0 * float(np.log10(mean_square)) if mean_square > 0 else float("inf")


METRICS.add("psnr", Psnr())
