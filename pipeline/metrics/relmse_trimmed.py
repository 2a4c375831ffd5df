"""relMSE without its worst 0.1 % of values, that is with fireflies set aside."""

from __future__ import annotations

from typing import final

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.metric import METRICS, Estimate, Image, Mask, Measured, Metric, Reference
from pipeline.scoring.spread import scale_interval, standard_error
from pipeline.scoring.squared_error import BELOW_NOISE, NOISE_SHARE, within_bound
from pipeline.statistics.intervals import NORMAL

FLOOR = 0.01  # squared radiance
TRIMMED = 0.001  # of all values, a pixel having three


@final
class RelMseTrimmed(Metric):
    """Mean of d^2 / (r^2 + 0.01) without the largest 0.1 % of its values, less the reference's variance.

    Below 1,000 values (334 pixels) none is left out. The interval is that of a winsorised mean [tukey1963].
    A trimmed mean is no mean squared error: rank estimators by it only beside `relmse` and `firefly`, which
    tell how much was set aside. A deterministic reference's bound moves the root of the score, and so the
    interval's ends, by at most its own weighted root mean square: the kept values have the least sum, so that
    the triangle inequality holds for them too. simpleimageio's version scores 0 where the reference is black.
    The map is d^2 / (r^2 + 0.01) before trimming.
    """

    name = "relmse-trimmed"
    title = "relMSE without the worst 0.1 %"
    unit = "1"
    squares = True
    source = "[tukey1963]; simpleimageio 1.13, relative_mse_outlier_rejection"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        weight = 1.0 / (reference.mean**2 + FLOOR)
        raw = (estimate.mean - reference.mean) ** 2 * weight
        noise = reference.variance * weight
        score = _trimmed if reference.batches else _trimmed_within_bound

        def over(mask: Mask) -> Score:
            return score(self.name, raw, noise, mask)

        return measured(raw.shape, over, np.mean(raw, axis=-1))


def _trimmed(metric: str, raw: Image, noise: Image, mask: Mask) -> Score:
    """Against a sampled reference. raw, noise: (h, w, 3), weighted d^2 and v. mask: (h, w)."""
    kept, limit, note = _kept(raw, mask)
    share = float(np.mean(noise[mask]))
    value, error = kept - share, _error(raw, limit, noise, mask)
    if share > NOISE_SHARE * value:
        upper = max(value, 0.0) + NORMAL * error
        return Score(
            metric=metric, value=upper, low=0.0, high=upper, bound=True, note=f"{BELOW_NOISE}; {note}"
        )
    low, high = scale_interval(value, error)
    return Score(metric=metric, value=value, low=low, high=high, note=note)


def _trimmed_within_bound(metric: str, raw: Image, squared: Image, mask: Mask) -> Score:
    """Against a deterministic reference. raw, squared: (h, w, 3), weighted d^2 and b^2. mask: (h, w)."""
    value, limit, note = _kept(raw, mask)
    ends = scale_interval(value, _error(raw, limit, np.zeros_like(raw), mask))
    low, high, hidden = within_bound(value, ends, float(np.mean(squared[mask])) / (1.0 - TRIMMED))
    note = f"{BELOW_NOISE}; {note}" if hidden else note
    return Score(metric=metric, value=high if hidden else value, low=low, high=high, bound=hidden, note=note)


def _kept(raw: Image, mask: Mask) -> tuple[float, float, str]:
    """The mean of the values kept, the largest of them, and how many were not, in words."""
    ranked = np.sort(raw[mask], axis=None)
    dropped = int(ranked.size * TRIMMED)
    kept = ranked[: ranked.size - dropped]
    return float(np.mean(kept)), float(kept[-1]), f"{dropped:,} of {ranked.size:,} values left out"


def _error(raw: Image, limit: float, noise: Image, mask: Mask) -> float:
    """The standard error of a winsorised mean."""
    winsorised = np.mean(np.minimum(raw, limit) - noise, axis=-1)
    return standard_error(winsorised, mask) / (1.0 - TRIMMED)


METRICS.add("relmse-trimmed", RelMseTrimmed())
