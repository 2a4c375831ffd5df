"""Firefly energy: light in pixels far brighter than everything nearby in the reference."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.metric import METRICS, Estimate, Judges, Mask, Measured, Metric, Reference
from pipeline.scoring.spread import scale_interval, standard_error
from pipeline.scoring.tone import luminance
from pipeline.statistics.numerics import box_maximum

FACTOR = 2.0  # a firefly exceeds the brightest luminance nearby more than so many times
REACH = 3  # pixels: the neighbourhood is 3 x 3


@final
class Firefly(Metric):
    """Luminance beyond twice the reference's greatest within 3 x 3 pixels, as a share of all its luminance.

    In lit parts an excess of 100 % is a firefly; in the umbra any light is. With bounded weights the score
    falls to 0 as samples are added. With unbounded weights it stays, since a few pixels hold the light that
    the others lack. Details that are bright in the reference do not count. The definition is this program's
    own. The map is the excess. Against a black reference the score of a lit estimate is undefined.
    """

    name = "firefly"
    title = "Firefly energy"
    unit = "of the light"
    judges: Judges = "defects"
    source = "this program's own"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        truth = luminance(reference.mean)
        excess = np.maximum(luminance(estimate.mean) - FACTOR * box_maximum(truth, REACH), 0.0)

        def over(mask: Mask) -> Score:
            light, value = float(np.mean(truth[mask])), float(np.mean(excess[mask]))
            if value == 0.0:
                return Score(metric=self.name, value=0.0, low=0.0, high=0.0)
            if light <= 0:
                note = "the reference is black here: no light to take a share of"
                return Score(metric=self.name, value=None, note=note)
            low, high = scale_interval(value, standard_error(excess, mask))
            return Score(metric=self.name, value=value / light, low=low / light, high=high / light)

        return measured(excess.shape, over, excess)


METRICS.add("firefly", Firefly())
