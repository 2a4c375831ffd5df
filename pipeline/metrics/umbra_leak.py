"""Umbra leak: light in pixels whose true radiance is exactly 0."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.metric import METRICS, Estimate, Judges, Mask, Measured, Metric, Reference
from pipeline.scoring.spread import scale_interval, standard_error
from pipeline.statistics.numerics import box_maximum


@final
class UmbraLeak(Metric):
    """Sum of |estimate| over the umbra, over the sum of the reference: 0 for a correct shadow test.

    Every sample in the umbra is blocked: light there is no noise but an error of the renderer, such as an
    epsilon or a light that shines through its support. The umbra is that of the visibility pass
    (pipeline/studies/regions.py), as far as the reference is black there. Without a pass it consists of the
    pixels that are certainly black in the reference, as are all their neighbours.
    """

    name = "umbra-leak"
    title = "Umbra leak"
    unit = "of the light"
    judges: Judges = "defects"
    source = "this program's own"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        umbra = black(reference) if reference.umbra is None else reference.umbra
        if not umbra.any():
            return undefined(self.name, "no pixel is in the umbra")
        leak = np.where(umbra, np.mean(np.abs(estimate.mean), axis=-1), 0.0)
        light = float(np.sum(np.mean(np.abs(reference.mean), axis=-1)))

        def over(mask: Mask) -> Score:
            inside = mask & umbra
            if not inside.any():
                return Score(metric=self.name, value=None, note="no pixel of this region is in the umbra")
            value, pixels = float(np.mean(leak[inside])), int(np.count_nonzero(inside))
            if value == 0.0:
                return Score(metric=self.name, value=0.0, low=0.0, high=0.0, note=f"{pixels:,} pixels")
            if light == 0.0:
                note = "the reference is black: no light to take a share of"
                return Score(metric=self.name, value=None, note=note)
            low, high = scale_interval(value, standard_error(leak, inside))
            share = pixels / light
            note = f"{pixels:,} pixels, {np.count_nonzero(leak[inside]):,} of them lit"
            return Score(metric=self.name, value=value * share, low=low * share, high=high * share, note=note)

        return measured(leak.shape, over, leak)


def black(reference: Reference) -> Mask:
    """The pixels (h, w) where the reference is exactly 0, as it is in all pixels around them."""
    lit = ((reference.mean != 0) | (reference.variance > 0)).any(axis=-1)
    return box_maximum(lit.astype(np.float64), 3) == 0.0


METRICS.add("umbra-leak", UmbraLeak())
