"""What may be said of the replicates of one configuration: a value with its interval, a bound, or nothing and
why.

An untrustworthy cell has no number; where the squared error is below the reference's noise every figure that
holds that noise is a bound; everything else has a value with a 95 % interval over its replicate seeds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from pipeline.schema.record import Score
from pipeline.statistics.intervals import Interval, efficiency, replicate_interval, replicate_mse

SQUARED = ("mse", "relmse", "relmse-imgtool", "relmse-simpleimageio", "relmse-trimmed")
"""Means of squares: noise of the reference is subtracted from them, and may drown them."""
HIGHER = ("psnr", "ssim")  # better when higher, so that a bound is a lower one
OWN = (
    "nonfinite",
    "largest-share",
    "noise",
    "bias",
    "umbra-leak",
    "firefly",
)  # do not hold the reference's noise, or hold it in their interval
BELOW = "below the reference's noise"


@dataclass(frozen=True)
class Measure:
    """A figure with its 95 % interval; bound: an upper bound. value None: there is no number to show, `note`
    says why.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    bound: bool = False
    note: str = ""

    @property
    def measured(self) -> bool:
        """Whether `value` is an estimate, neither missing nor a bound."""
        return self.value is not None and not self.bound


def measure_all(cards: Sequence[Mapping[str, Score] | None], refused: str | None) -> dict[str, Measure]:
    """Every metric's measure over the replicates. cards: the scores of each, None for one that is not scored.

    refused: why no number may be told, or None.
    """
    names = list(dict.fromkeys(name for card in cards if card for name in card))
    found = {name: _score(name, cards, refused) for name in names}
    if not found.get("mse", Measure(None)).bound:
        return found
    return {name: measure if name in OWN else _bounded(name, measure) for name, measure in found.items()}


def _bounded(name: str, found: Measure) -> Measure:
    """A figure that holds the reference's noise where that is most of it: the end of its interval that is
    safe, as a bound.
    """
    if found.value is None or found.bound:
        return found
    end = found.low if name in HIGHER else found.high
    value = found.value if end is None or math.isnan(end) else end
    return replace(found, value=value, bound=True, note=BELOW)


def _score(name: str, cards: Sequence[Mapping[str, Score] | None], refused: str | None) -> Measure:
    """The mean over replicates; without a number if the samples are not to be believed or a replicate has
    none.
    """
    if refused is not None:
        return Measure(None, note=refused)
    scores = [card[name] for card in cards if card and name in card]
    if len(scores) < len(cards):
        return Measure(None, note=f"{len(cards) - len(scores)} of {len(cards)} replicates are not scored")
    return _squared(scores) if name in SQUARED else _plain(scores)


def _squared(scores: Sequence[Score]) -> Measure:
    mean = replicate_mse(scores)
    return Measure(mean.value, mean.low, mean.high, mean.bound, mean.note)


def _plain(scores: Sequence[Score]) -> Measure:
    """The mean over replicates with its interval; a single replicate brings its own."""
    values = [score.value for score in scores if score.value is not None]
    if len(values) < len(scores):
        return Measure(None, note=next(score.note for score in scores if score.value is None))
    bound = any(score.bound for score in scores)
    if len(scores) == 1:
        return Measure(values[0], scores[0].low, scores[0].high, bound)
    mean = replicate_interval(values)
    return Measure(mean.value, mean.low, mean.high, bound)


def root_of(mse: Measure) -> Measure:
    """RMSE from MSE: the ends of the interval go through the square root, which is monotonic."""
    roots = [None if end is None else math.sqrt(max(end, 0.0)) for end in (mse.value, mse.low, mse.high)]
    return replace(mse, value=roots[0], low=roots[1], high=roots[2])


def efficiency_of(mse: Measure, seconds: Interval) -> Measure:
    """1 / (MSE x seconds); where the MSE is an upper bound it is a lower bound, which has no place among
    numbers to compare.
    """
    if mse.value is None or mse.low is None or mse.high is None:
        return Measure(None, note=mse.note)
    if mse.bound or mse.value <= 0:
        return Measure(None, note=mse.note or "the error is below the reference's noise")
    found = efficiency(Interval(mse.value, mse.low, mse.high), seconds)
    return Measure(found.value, found.low, found.high)
