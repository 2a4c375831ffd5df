"""The mean squared error of an estimate against a reference that is noisy itself, with its 95 % interval.

With d = estimate - reference and v the variance of the reference's mean, E[d^2 - v] is the estimate's own
squared error, variance and squared bias, as the two are independent; so v is subtracted pixel by pixel, and
the score is the mean of the map q = mean over channels of (d^2 - v) * weight. Its interval is that of
spread.py, unless it drowns in the reference's noise.

Reference noise. Where mean v exceeds a tenth of the measured error, the value is the interval's upper end and
is marked as a bound. Against a deterministic reference (0 batches) v is the square of an error bound b, of
unknown sign: nothing is subtracted, and by the triangle inequality the true root mean square lies within
rms(b) of the measured one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.schema.record import Score
from pipeline.scoring.answers import defect, measured, undefined
from pipeline.scoring.metric import Estimate, Image, Mask, Measured, Reference
from pipeline.scoring.spread import scale_interval, standard_error
from pipeline.statistics.intervals import NORMAL

NOISE_SHARE = 0.1  # of the measured error; a larger reference variance makes the figure an upper bound
DEPENDENT = 5.0  # standard errors below zero: no independent estimate is that close to a noisy reference
BELOW_NOISE = "below reference noise"


@dataclass(frozen=True, eq=False)
class SquaredError:
    """A mean squared error with its 95 % interval.

    value: the mean of `map`, or the interval's upper end if `bound`; None if undefined. note: why it is a
    bound or undefined. map: (h, w), q of each pixel, negative where the estimate is closer to the reference
    than the reference's own noise.
    """

    value: float | None
    low: float | None
    high: float | None
    bound: bool
    note: str
    map: Image


def squared_error(
    estimate: Estimate, reference: Reference, weight: Image | float = 1.0, mask: Mask | None = None
) -> SquaredError:
    """The mean of weight * (d^2 - v) over channels and the pixels of a mask, with its interval.

    weight: (h, w, 3), or one for all. mask: (h, w); all pixels if None. All pixels must be finite.
    """
    raw: Image = np.mean((estimate.mean - reference.mean) ** 2 * weight, axis=-1)
    noise: Image = np.mean(reference.variance * weight, axis=-1)
    inside = np.ones(raw.shape, dtype=np.bool_) if mask is None else mask
    if reference.batches == 0:
        return _within_bound(raw, float(np.mean(noise[inside])), inside)
    return _debiased(raw, noise, inside)


def weighted_score(
    metric: str, estimate: Estimate, reference: Reference, weight: Image | float = 1.0
) -> Measured:
    """The answer of a metric that is a weighted mean squared error."""
    if note := defect(estimate, reference):
        return undefined(metric, note)

    def over(mask: Mask) -> Score:
        return to_score(metric, squared_error(estimate, reference, weight, mask))

    return measured(estimate.mean.shape, over, squared_error(estimate, reference, weight).map)


def to_score(metric: str, error: SquaredError) -> Score:
    """The score of a metric, without the map."""
    value, low, high = error.value, error.low, error.high
    return Score(metric=metric, value=value, low=low, high=high, bound=error.bound, note=error.note)


def noise_limit(error: SquaredError) -> bool:
    """Whether the reference's own noise hides how small the error is."""
    return error.bound or error.value is None


def _debiased(raw: Image, noise: Image, inside: Mask) -> SquaredError:
    """Against a reference with a sampled variance. raw: (h, w), d^2. noise: (h, w), v. inside: (h, w)."""
    pixel = raw - noise
    value, share = float(np.mean(pixel[inside])), float(np.mean(noise[inside]))
    error = standard_error(pixel, inside)
    if value + DEPENDENT * error < 0 and float(np.mean(raw[inside])) < 0.5 * share:
        note = "closer to the reference than the reference's own noise: the two are not independent"
        return SquaredError(None, None, None, False, note, pixel)
    if share > NOISE_SHARE * value:
        upper = max(value, 0.0) + NORMAL * error
        return SquaredError(upper, max(value - NORMAL * error, 0.0), upper, True, BELOW_NOISE, pixel)
    return SquaredError(value, *scale_interval(value, error), False, "", pixel)


def _within_bound(raw: Image, squared_bound: float, inside: Mask) -> SquaredError:
    """Against a deterministic reference. raw, inside: (h, w). squared_bound: the mean of b^2."""
    value = float(np.mean(raw[inside]))
    low, high, hidden = within_bound(value, scale_interval(value, standard_error(raw, inside)), squared_bound)
    return SquaredError(high if hidden else value, low, high, hidden, BELOW_NOISE if hidden else "", raw)


def within_bound(value: float, ends: tuple[float, float], squared_bound: float) -> tuple[float, float, bool]:
    """Widen a squared error's interval for a reference that is off by rms `sqrt(squared_bound)` at most.

    Returns low, high, and whether the bound hides the error.
    """
    slack = np.sqrt(squared_bound)
    low, high = max(np.sqrt(ends[0]) - slack, 0.0) ** 2, (np.sqrt(ends[1]) + slack) ** 2
    return float(low), float(high), squared_bound > NOISE_SHARE * value
