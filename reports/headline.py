"""The first screen of a report: the question, its answer in one number, and a figure for each promise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.statistics.intervals import Interval, product
from pipeline.statistics.slopes import halving_cost
from reports.findings import by_estimator, by_sampler
from reports.formats import capital, ends, interval, listing, plain, scene_title, sig
from reports.series import Panel, Point, Series, StudyView


@dataclass(frozen=True)
class Card:
    """A promise with one figure of the run. range: the figure's interval. findings: all that it rests on."""

    title: str
    promise: str
    figure: str
    range: str
    text: str
    findings: list[str]


def answer(panel: Panel) -> str:
    """The answer to a study's question in one sentence of one number with its interval, where it has one."""
    return capital(_by_samples(panel) if panel.study.over == "spp" else _along(panel))


def accuracy_card(views: Sequence[StudyView], findings: list[str]) -> Card:
    """The cost of halving the error, of the first series with independent samples that has one."""
    title = ("The price of accuracy", "Show what accuracy costs in time.")
    for panel in _panels(views):
        for series in panel.series if panel.study.over == "spp" else ():
            slope = series.fitted_slope() if series.sampler == "independent" else None
            if slope is not None:
                cost = halving_cost(slope)
                text = (
                    f"the render time for half the error: {series.estimator} on {scene_title(panel.scene)}."
                )
                return Card(*title, f"{sig(cost.value)} ×", ends(cost), text, findings)
    return Card(*title, "–", "", "No cost of halving the error was measured.", findings)


def stability_card(views: Sequence[StudyView], findings: list[str]) -> Card:
    """The number of images that their own samples call untrustworthy."""
    records = [cell.record for panel in _panels(views) for cell in panel.cells]
    doubted = sum(record.statistics.verdict != "ok" for record in records)
    title = ("Hard cases", "Test that hard cases stay numerically stable.")
    text = "images cannot be trusted by their own samples."
    return Card(*title, f"{doubted:,} of {len(records):,}", "", text, findings)


def plan_card(views: Sequence[StudyView], findings: list[str]) -> Card:
    """The share of camera rays that needed no shadow ray."""
    rays = [cell.record.rays for panel in _panels(views) for cell in panel.cells]
    primary, shadow = sum(r.primary for r in rays), sum(r.shadow for r in rays)
    title = ("Only what is needed", "Simulate only the effects that a scene calls for.")
    text = "fewer shadow rays than camera rays."
    if not primary or shadow > primary:
        share = f"{sig(shadow / primary)}" if primary else "–"
        return Card(*title, share, "", "shadow rays for each camera ray.", findings)
    return Card(*title, f"{100 * (1 - shadow / primary):.0f} %", "", text, findings)


def _panels(views: Sequence[StudyView]) -> list[Panel]:
    return [panel for view in views for panel in view.panels]


def _by_samples(panel: Panel) -> str:
    """The first comparison of the sweep: it is fixed before anything is measured."""
    found = next(iter([*by_estimator(panel), *by_sampler(panel)]), None)
    where = f"on {scene_title(panel.scene, panel.fixed)}"
    if found is None:
        costs = [(s, s.fitted_slope()) for s in panel.series]
        series, slope = next(((s, f) for s, f in costs if f is not None), (None, None))
        if series is None or slope is None:
            return f"too few errors were measured {where} to tell{_why(panel)}."
        return (
            f"half the error costs {interval(halving_cost(slope))} times the render time with {series.label}."
        )
    one, other = found.series.estimator, found.base.estimator
    if one == other:
        one, other = found.series.label, found.base.label
    ratio = f"{interval(found.ratio)} times"
    if found.ratio.low <= 1 <= found.ratio.high:
        return f"no difference seen {where}: {one} is {ratio} as efficient as {other} at {found.spp} spp."
    return f"{one} is {ratio} as efficient as {other} {where}, at {found.spp} spp."


def _along(panel: Panel) -> str:
    """The failure of the series that fail; else the first one's growth of error, from end to end."""
    failed = [s for s in panel.series if not all(p.trusted for p in s.points)]
    if failed:
        sound = [s.label for s in panel.series if s not in failed]
        first = failed[0]
        places = sum(not p.trusted for p in first.points)
        rest = f"; {listing(sound)} can at all" if sound else ""
        return (
            f"{first.label} cannot be trusted at {places} of {len(first.points)} values of "
            f"{panel.study.over}{rest}."
        )
    for series in panel.series:
        pair = _ends(panel, series)
        if pair is not None:
            start, stop = pair
            return (
                f"from {panel.study.over} = {plain(start.x)} to {plain(stop.x)} the error of {series.label} "
                f"is multiplied by {interval(_growth(start, stop))}."
            )
    return f"too few errors were measured along {panel.study.over} to tell{_why(panel)}."


def _why(panel: Panel) -> str:
    """The first reason that a point has no measured error, in brackets."""
    notes = [p.rmse.note for series in panel.series for p in series.points if not p.rmse.measured]
    return f" ({notes[0]})" if notes else ""


def _ends(panel: Panel, series: Series) -> tuple[Point, Point] | None:
    """The first and the last measured point in the order of the sweep."""
    points = [p for p in panel.ordered(series) if p.rmse.measured and (p.rmse.value or 0.0) > 0]
    return (points[0], points[-1]) if len(points) > 1 else None


def _growth(start: Point, stop: Point) -> Interval:
    """The ratio of two RMSE with its interval."""
    one, other = (
        Interval(p.rmse.value or math.nan, p.rmse.low or 0.0, p.rmse.high or math.inf) for p in (stop, start)
    )
    return product((one, 1.0), (other, -1.0))
