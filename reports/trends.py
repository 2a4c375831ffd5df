"""What a series says as a whole: its slope, the slope at its end, and how it compares with another.

Only measured points enter: no bound and no untrustworthy cell has a place in a fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.statistics.intervals import Interval, product
from pipeline.statistics.slopes import Slope, fit_slope
from reports.measures import Measure
from reports.series import Panel, Point, Series


@dataclass(frozen=True)
class Comparison:
    """How many times as efficient `series` is as `base`, at the largest sample count at which both are
    measured.

    relative: the same by relMSE instead of MSE, where that is measured too: the two differ where few bright
    pixels make up the MSE.
    """

    panel: Panel
    series: Series
    base: Series
    spp: int
    ratio: Interval
    relative: Interval | None


def measured(series: Series) -> list[Point]:
    """The points with a positive RMSE that is an estimate."""
    return [p for p in series.points if p.rmse.measured and (p.rmse.value or 0.0) > 0]


def fitted_slope(series: Series) -> Slope | None:
    """The slope of RMSE against render seconds over all measured points; None with fewer than two.

    With three points or more all weigh the same and the scatter about the line gives the error, so that a
    departure from a power law widens it: intervals from a few replicates would make poor weights. Two points
    have their intervals alone.
    """
    points = measured(series)
    return _fit(points, weigh=len(points) == 2)


def last_slope(series: Series) -> tuple[Slope, Point, Point] | None:
    """The slope between the last two measured points of neighbouring sample counts, and these points."""
    points = measured(series)[-2:]
    slope = _fit(points, weigh=True)
    return (slope, points[0], points[1]) if slope else None


def sample_slope(series: Series) -> Slope | None:
    """The slope of RMSE against the number of samples, which fixed costs of an image have no part in; None
    with fewer than two points.
    """
    points = measured(series)
    if len({p.spp for p in points}) < 2:
        return None
    return fit_slope([float(p.spp) for p in points], [p.rmse.value or 0.0 for p in points])


def _fit(points: Sequence[Point], weigh: bool) -> Slope | None:
    if len(points) < 2 or len({p.seconds.value for p in points}) < 2:
        return None
    x, y = [p.seconds.value for p in points], [p.rmse.value or 0.0 for p in points]
    ends = [(p.rmse.low or 0.0, p.rmse.high or 0.0) for p in points]
    if weigh and all(0 < low < high for low, high in ends):
        return fit_slope(x, y, [low for low, _ in ends], [high for _, high in ends])
    return fit_slope(x, y)


def by_estimator(panel: Panel) -> list[Comparison]:
    """Every estimator against the first of the sweep, sampler by sampler."""
    first = panel.study.axes.estimator[0]
    bases = {s.sampler: s for s in panel.series if s.estimator == first}
    return _compare(panel, [(s, bases.get(s.sampler)) for s in panel.series if s.estimator != first])


def by_sampler(panel: Panel) -> list[Comparison]:
    """Every sampler against the first of the sweep, estimator by estimator."""
    first = panel.study.axes.sampler[0]
    bases = {s.estimator: s for s in panel.series if s.sampler == first}
    return _compare(panel, [(s, bases.get(s.estimator)) for s in panel.series if s.sampler != first])


def _compare(panel: Panel, pairs: Sequence[tuple[Series, Series | None]]) -> list[Comparison]:
    """At the largest x at which both have an efficiency; pairs without one are left out."""
    found: list[Comparison] = []
    for series, base in pairs:
        against = {p.x: p for p in base.points if p.efficiency.measured} if base else {}
        both = [p for p in series.points if p.efficiency.measured and p.x in against]
        if base and both:
            one, other = both[-1], against[both[-1].x]
            ratio = product((_interval(one.efficiency), 1.0), (_interval(other.efficiency), -1.0))
            found.append(Comparison(panel, series, base, one.spp, ratio, _relative(one, other)))
    return found


def _relative(one: Point, other: Point) -> Interval | None:
    scores = [point.scores.get("relmse", Measure(None)) for point in (one, other)]
    if not all(score.measured and score.value for score in scores):
        return None
    relmse = [_interval(score) for score in scores]
    return product((relmse[0], -1.0), (one.seconds, -1.0), (relmse[1], 1.0), (other.seconds, 1.0))


def _interval(found: Measure) -> Interval:
    return Interval(found.value or 0.0, found.low or 0.0, found.high or 0.0)
