"""Firefly energy: light in pixels that stand out of everything that the reference has nearby."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.metric import METRICS, Better, Estimate, Judges, Mask, Measured, Reference, measured
from pipeline.scoring.spread import scale_interval, standard_error
from pipeline.scoring.tone import luminance
from pipeline.scoring.undefined import defect, undefined
from pipeline.statistics.numerics import box_maximum

FACTOR = 2.0  # how many times the brightest luminance nearby is still no firefly
REACH = 3  # pixels: the neighbourhood is 3 x 3


@final
class Firefly:
    """Luminance beyond twice the greatest of the reference's 3 x 3 pixels around, summed, over the sum of the
    reference's luminance.

    In lit parts an excess of 100 % is a firefly, in the umbra any light is. It falls to 0 with the number of
    samples where the weights are bounded; where they are not, it stays: the light of few pixels is what the
    others lack. The definition is this program's own; it asks the reference, so that a bright detail that is
    really there does not count.
    """

    name = "firefly"
    title = "Firefly energy"
    unit = "of the light"
    better: Better = "lower"
    judges: Judges = "defects"
    source = "this program's own"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w): the excess luminance.

        Undefined for a black reference under a lit estimate.
        """
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        truth = luminance(reference.mean)
        excess = np.maximum(luminance(estimate.mean) - FACTOR * box_maximum(truth, REACH), 0.0)

        def over(mask: Mask) -> Score:
            light, value = float(np.mean(truth[mask])), float(np.mean(excess[mask]))
            if value == 0.0:
                return Score(metric=self.name, value=0.0, low=0.0, high=0.0)
            if light <= 0:
                return Score(
                    metric=self.name,
                    value=None,
                    note="the reference is black here: no light to take a share of",
                )
            low, high = scale_interval(value, standard_error(excess, mask))
            return Score(metric=self.name, value=value / light, low=low / light, high=high / light)

        return measured(excess.shape, over, excess)


METRICS.add("firefly", Firefly())
