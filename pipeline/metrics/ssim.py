# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false, reportUnknownMemberType=false
"""Structural similarity of the displayed picture (scikit-image)."""

from __future__ import annotations

from typing import final

import numpy as np
from skimage.metrics import structural_similarity

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.metric import METRICS, Better, Estimate, Image, Mask, Measured, Metric, Reference
from pipeline.scoring.tone import displayed, exposure

WINDOW = 11  # pixels; a gaussian of standard deviation 1.5, cut at 3.5 of them
BORDER = (WINDOW - 1) // 2


@final
class Ssim(Metric):
    """SSIM [wang2004] of the displayed pictures: exposed for the reference, sRGB, clipped to [0, 1].

    Gaussian window of 1.5 pixels, K1 = 0.01, K2 = 0.03, data range 1; mean over channels and over all pixels
    whose window lies inside the picture, which needs 11 x 11 pixels. Equal pictures score 1. Windows overlap,
    so that one image gives no interval: replicate seeds do.
    """

    name = "ssim"
    title = "SSIM (sRGB, exposed for the reference)"
    unit = "1"
    better: Better = "higher"
    source = "[wang2004]; scikit-image, structural_similarity"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        if min(estimate.mean.shape[:2]) < WINDOW:
            return undefined(self.name, f"the picture is smaller than the {WINDOW} x {WINDOW} window")
        scale = exposure(reference.mean)
        local = _similarity(displayed(reference.mean, scale), displayed(estimate.mean, scale))
        whole = np.zeros(local.shape, dtype=np.bool_)
        whole[BORDER:-BORDER, BORDER:-BORDER] = True

        def over(mask: Mask) -> Score:
            inside = mask & whole
            if not inside.any():
                note = "no pixel here has its whole window in the picture"
                return Score(metric=self.name, value=None, note=note)
            return Score(metric=self.name, value=float(np.mean(local[inside])), note=f"exposure {scale:.4g}")

        return measured(local.shape, over, local)


def _similarity(truth: Image, shown: Image) -> Image:
    """The local similarity (h, w), mean over channels. truth, shown: (h, w, 3) in [0, 1]."""
    _, local = structural_similarity(  # pyright: ignore[reportAssignmentType]
        truth,
        shown,
        data_range=1.0,
        channel_axis=-1,
        gaussian_weights=True,
        use_sample_covariance=False,
        full=True,
    )
    return np.mean(np.asarray(local, dtype=np.float64), axis=-1)


METRICS.add("ssim", Ssim())
