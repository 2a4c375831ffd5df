"""The share of the largest sample in all reflected light, which tells if one draw carries the image."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import measured, same_size, undefined
from pipeline.scoring.metric import METRICS, Estimate, Judges, Mask, Measured, Metric, Reference
from pipeline.statistics.heavy_tail import SHARE_LIMIT


@final
class LargestShare(Metric):
    """The largest sample of reflected light over the sum of all, 0 to 1; the maximum over channels.

    At a tenth, a new draw of this one sample would move the mean by a tenth. Pixels whose mean exceeds their
    largest reflected sample see a light directly and are left out. A share is a property of this draw and has
    no interval. A small share proves nothing, since the samples that matter may not have been drawn yet: the
    verdict in the record also uses Hill's index [hill1975]. The map is each pixel's largest sample over the
    light of the whole image.
    """

    name = "largest-share"
    title = "Largest sample's share"
    unit = "1"
    judges: Judges = "samples"
    source = "statistics/heavy_tail.py"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        same_size(estimate, reference)
        if estimate.maximum is None or estimate.count is None:
            return undefined(self.name, "an image alone does not tell its samples")
        largest, count = estimate.maximum, estimate.count[..., None]
        if not (np.isfinite(largest).all() and np.isfinite(estimate.mean).all()):
            bad = int(np.count_nonzero(~np.isfinite(estimate.mean + largest).all(axis=-1)))
            return undefined(self.name, f"{bad:,} of {count.size:,} pixels of the estimate are not finite")
        reflected = estimate.mean <= largest
        light = np.where(reflected, estimate.mean * count, 0.0)
        peak = np.where(reflected, largest, 0.0)

        def over(mask: Mask) -> Score:
            total, top = np.sum(light[mask], axis=0), np.max(peak[mask], axis=0)
            share = float(np.max(np.divide(top, total, out=np.zeros_like(top), where=total > 0)))
            note = f"one sample carries {share:.0%} of the light" if share > SHARE_LIMIT else ""
            return Score(metric=self.name, value=share, note=note)

        total = np.sum(light, axis=(0, 1))
        own = np.divide(peak, total, out=np.zeros_like(peak), where=total > 0)
        return measured(own.shape, over, np.max(own, axis=-1))


METRICS.add("largest-share", LargestShare())
