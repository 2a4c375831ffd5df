"""relMSE without its worst 0.1 % of values: what is left when fireflies are set aside."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.metrics.protocol import METRICS, Better, Estimate, Image, Judges, Mask, Measured, Reference, measured
from pipeline.metrics.spread import scale_interval, standard_error
from pipeline.metrics.squared_error import BELOW_NOISE, NOISE_SHARE
from pipeline.metrics.undefined import defect, undefined
from pipeline.record import Score
from pipeline.statistics.intervals import NORMAL

FLOOR = 0.01  # squared radiance
TRIMMED = 0.001  # of all values, a pixel having three


@final
class RelMseTrimmed:
    """Mean of d^2 / (r^2 + 0.01) over channels, the largest 0.1 % of these values left out, the reference's variance subtracted.

    Below 1,000 values (334 pixels) none is left out. The interval is that of a winsorised mean [tukey1963]. A trimmed mean of errors is no
    mean squared error: two estimators may be ranked by it only beside `relmse` and `firefly`, which tell what was set aside.
    It is simpleimageio's but where the reference is black: there that one scores 0.
    """

    name = "relmse-trimmed"
    title = "relMSE without the worst 0.1 %"
    unit = "1"
    better: Better = "lower"
    judges: Judges = "error"
    source = "[tukey1963]; simpleimageio 1.13, relative_mse_outlier_rejection"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w): d^2 / (r^2 + 0.01) before anything is left out, mean over channels."""
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        weight = 1.0 / (reference.mean**2 + FLOOR)
        raw = (estimate.mean - reference.mean) ** 2 * weight
        noise = reference.variance * weight if reference.batches else np.zeros_like(raw)

        def over(mask: Mask) -> Score:
            return _trimmed(self.name, raw, noise, mask)

        return measured(raw.shape, over, np.mean(raw, axis=-1))


def _trimmed(metric: str, raw: Image, noise: Image, mask: Mask) -> Score:
    """raw, noise: (h, w, 3), weighted d^2 and v. mask: (h, w)."""
    values = raw[mask]
    dropped = int(values.size * TRIMMED)
    ranked = np.sort(values, axis=None)
    limit = float(ranked[ranked.size - dropped - 1])
    share = float(np.mean(noise[mask]))
    value = float(np.mean(ranked[: ranked.size - dropped])) - share
    winsorised = np.mean(np.minimum(raw, limit) - noise, axis=-1)
    error = standard_error(winsorised, mask) / (1.0 - TRIMMED)
    note = f"{dropped:,} of {values.size:,} values left out"
    if share > NOISE_SHARE * value:
        upper = max(value, 0.0) + NORMAL * error
        return Score(metric=metric, value=upper, low=0.0, high=upper, bound=True, note=f"{BELOW_NOISE}; {note}")
    low, high = scale_interval(value, error)
    return Score(metric=metric, value=value, low=low, high=high, note=note)


METRICS.add("relmse-trimmed", RelMseTrimmed())
