"""The findings of a run as sentences, each with the figures that it rests on."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pipeline.statistics.intervals import Interval, product
from pipeline.statistics.slopes import halving_cost
from reports.formats import (
    capital,
    count,
    interval,
    listing,
    millions,
    plain,
    scene_title,
    sig,
    slope_text,
    spread,
)
from reports.series import Measure, Panel, Point, Series, StudyView, wall_over_cpu

DISAGREE = 1.5  # factor between the ratios by MSE and by relMSE from which the text gives both
TOLD = 3  # comparisons that the text names one by one
QUIET = 1.1  # wall over CPU seconds; above it, other programs ran too


@dataclass(frozen=True)
class Comparison:
    """The ratio of the efficiency of `series` to that of `base`, at the largest spp where both are measured.

    relative: the ratio by relMSE, where both have one. It differs where few bright pixels dominate the MSE.
    """

    panel: Panel
    series: Series
    base: Series
    spp: int
    ratio: Interval
    relative: Interval | None


def cost_sentences(panel: Panel) -> list[str]:
    """The cost of halving the error, a sentence for each series; then comparisons of the series."""
    told = [_fitted_cost(s) if s.sampler == "independent" else _last_cost(s) for s in panel.series]
    return told + _compared([panel], by_estimator) + _compared([panel], by_sampler) + _rasterised(panel)


def _rasterised(panel: Panel) -> list[str]:
    """The time and error of the rasterised image, and the first series that has less error."""
    found = panel.baseline
    if found is None or found.rmse.value is None:
        return []
    error, seconds = found.rmse.value, found.seconds.value
    better = [(s, p) for s in panel.series for p in s.measured if (p.rmse.value or 0.0) < error]
    first = min(better, key=lambda one: one[1].seconds.value, default=None)
    than = "no measured point has less error"
    if first is not None:
        label, point = first[0].label, first[1]
        after = f"after {sig(point.seconds.value)} s"
        than = f"the first point with less error is {label} at {point.spp} spp, {after}"
    return [
        f"Rasterised by {panel.study.baseline} without shadows, and with a point in place of each light, "
        f"the picture takes {sig(seconds)} s and has an RMSE of {sig(error)}, which no time makes less; "
        f"{than}."
    ]


def _fitted_cost(series: Series) -> str:
    slope = series.fitted_slope()
    if slope is None:
        return _no_cost(series)
    first, last = series.measured[0], series.measured[-1]
    alone = series.sample_slope()
    beside = f"; against samples instead of seconds it is {slope_text(alone)}" if alone else ""
    return (
        f"{capital(series.estimator)} with independent samples: halving the error costs "
        f"{interval(halving_cost(slope))} times the render time "
        f"(slope {slope_text(slope)}, fitted from {first.spp} to {last.spp} spp{beside})."
    )


def _last_cost(series: Series) -> str:
    """The last measured step of a series, which has no single slope where it is no power law."""
    found = series.last_slope()
    if found is None:
        return _no_cost(series)
    slope, start, stop = found
    hidden = [p for p in series.points if p.rmse.bound]
    beyond = f"; {_spp(hidden)} {_are(len(hidden))} below the reference's noise" if hidden else ""
    return (
        f"{capital(series.estimator)} with {series.sampler}: at the pace of the last measured step, "
        f"{start.spp} to {stop.spp} spp, {interval(halving_cost(slope))} times "
        f"(local slope {slope_text(slope)}{beyond})."
    )


def _no_cost(series: Series) -> str:
    where = f"{capital(series.estimator)} with {series.sampler}"
    return f"{where}: fewer than two measured errors, so that no cost can be told."


def stability_sentences(panel: Panel) -> list[str]:
    """The series that hold along a parameter, and those that fail, with the place where they do."""
    return [capital(sentence) for sentence in _stability(panel)]


def _stability(panel: Panel) -> list[str]:
    return [_holds(s, panel) if all(p.trusted for p in s.points) else _fails(s, panel) for s in panel.series]


def _holds(series: Series, panel: Panel) -> str:
    ends = f"from {panel.study.over} = {plain(series.points[-1].x)} to {plain(series.points[0].x)}"
    values = [p.rmse.value for p in series.measured if p.rmse.value is not None]
    bounds = sum(p.rmse.bound for p in series.points)
    cells = sum(len(p.cells) for p in series.points)
    error = f"RMSE {spread(values)}" if values else "no RMSE that is more than a bound"
    hidden = f", {count(bounds, 'more point')} below the reference's noise" if bounds and values else ""
    return f"{series.label} holds {ends}: the samples of all {cells} images can be trusted, {error}{hidden}."


def _fails(series: Series, panel: Panel) -> str:
    refused = [p for p in series.points if not p.trusted]
    where = listing([plain(p.x) for p in reversed(refused)])
    doubted = sum(p.doubted for p in refused)
    total = sum(len(p.cells) for p in refused)
    return (
        f"{series.label} is untrustworthy at {panel.study.over} = {where}: there the samples of {doubted} "
        f"of {total} images cannot tell their own error, and no number is given."
    )


def left_out_sentences(view: StudyView, panel: Panel) -> list[str]:
    """The parts of the sweep that this scene does not support."""
    return [
        f"{capital(item.what)} is left out: {item.reason.replace('`', '')}."
        for item in view.left_out
        if item.scene == panel.scene or item.scene.startswith(f"{panel.scene} ")
    ]


def promise_accuracy(views: Sequence[StudyView]) -> list[str]:
    """Promise 1: the time that accuracy cost in this run."""
    panels = [panel for view in views if view.study.over == "spp" for panel in view.panels]
    if not panels:
        return ["This run varied no sample count, so that it says nothing about the price of accuracy."]
    told = [_costs(panels), *_compared(panels, by_estimator), *_compared(panels, by_sampler), _hidden(panels)]
    return told + _disturbed(panels)


def _disturbed(panels: Sequence[Panel]) -> list[str]:
    """A warning where a busy machine made the times long and scattered."""
    ratios = wall_over_cpu(cell.record for panel in panels for cell in panel.cells)
    usual = statistics.median(ratios) if ratios else 1.0
    if usual <= QUIET:
        return []
    return [
        f"The machine was busy: half of the renders waited for the processor so long that they took "
        f"{sig(usual)} times their CPU time or more. Its times and efficiencies are that uncertain."
    ]


def _costs(panels: Sequence[Panel]) -> str:
    """Halving costs with independent samples, estimator by estimator, scene by scene."""
    told: dict[str, list[str]] = {}
    for panel in panels:
        for series in panel.series:
            slope = series.fitted_slope() if series.sampler == "independent" else None
            if slope is not None:
                told.setdefault(series.estimator, []).append(
                    f"by {interval(halving_cost(slope))} {_on(panel)}"
                )
    if not told:
        return (
            "No series with independent samples has two measured errors, so that no cost of halving the "
            "error can be told."
        )
    parts = [f"with {estimator} {listing(costs)}" for estimator, costs in told.items()]
    return (
        f"Halving the error with independent samples multiplied the render time: {', and '.join(parts)} "
        f"(4 where nothing but the number of samples costs time)."
    )


def _compared(panels: Sequence[Panel], pairs: Callable[[Panel], list[Comparison]]) -> list[str]:
    """The ratios of efficiency, a sentence for each kind of comparison."""
    kinds: dict[tuple[str, str], list[Comparison]] = {}
    for found in (comparison for panel in panels for comparison in pairs(panel)):
        kinds.setdefault(_kind(found), []).append(found)
    return [f"{what} {_ratios(found, base, len(panels) > 1)}." for (what, base), found in kinds.items()]


def _kind(found: Comparison) -> tuple[str, str]:
    if found.series.estimator == found.base.estimator:
        return f"{capital(found.series.sampler)} samples were", f"{found.base.sampler} ones"
    return f"With {found.series.sampler} samples, {found.series.estimator} was", found.base.estimator


def _ratios(found: Sequence[Comparison], base: str, scenes: bool) -> str:
    """The ratios one by one, or their range where they are many."""
    if len(found) > TOLD:
        low, high = min(c.ratio.low for c in found), max(c.ratio.high for c in found)
        ratios = f"{spread([c.ratio.value for c in found])} times as efficient as {base}"
        alike = sum(_undecided(c) for c in found)
        none = f"; {alike} of them show no difference" if alike else ""
        return f"{ratios} ({len(found)} comparisons, 95 % intervals within {sig(low)} to {sig(high)}{none})"
    told = [f"{interval(c.ratio)}|{_where(c, scenes)}{_by_relmse(c)}{_no_difference(c)}" for c in found]
    return listing(
        [told[0].replace("|", f" times as efficient as {base} "), *(t.replace("|", " ") for t in told[1:])]
    )


def _undecided(found: Comparison) -> bool:
    """Whether the interval of the ratio contains 1."""
    return found.ratio.low <= 1 <= found.ratio.high


def _no_difference(found: Comparison) -> str:
    return " (no difference shown)" if _undecided(found) else ""


def _by_relmse(found: Comparison) -> str:
    """The ratio by relMSE where it differs from that by MSE."""
    if found.relative is None or 1 / DISAGREE < found.relative.value / found.ratio.value < DISAGREE:
        return ""
    return f" (by relMSE, {interval(found.relative)} times)"


def _where(found: Comparison, scenes: bool) -> str:
    """The setting that sets one comparison of a kind apart from the others."""
    sampler = found.series.estimator == found.base.estimator
    place = _on(found.panel) if scenes else f"with {found.series.estimator}" if sampler else ""
    return f"{place} at {found.spp} spp".strip()


def _hidden(panels: Sequence[Panel]) -> str:
    """The number of points that have no RMSE, or no more than a bound, and why."""
    points = [p for panel in panels for s in panel.series for p in s.points]
    states = Counter(p.state for p in points)
    if set(states) == {"ok"}:
        every = f"All {len(points)} points"
        return f"{every} stand above the reference's noise and rest on samples that can be trusted."
    bounds, refused, unscored = (states[name] for name in ("upper bound", "untrustworthy", "no score"))
    reasons = dict.fromkeys(p.rmse.note for p in points if p.state == "no score")
    none = f"; {unscored} {_have(unscored)} no error: {listing(list(reasons))}" if unscored else ""
    return (
        f"Of {len(points)} points, {bounds} below the reference's noise {_are(bounds)} given as upper "
        f"bounds, and {refused} untrustworthy {_are(refused)} given no number{none}."
    )


def _have(number: int) -> str:
    return "has" if number == 1 else "have"


def _are(number: int) -> str:
    return "is" if number == 1 else "are"


def promise_stability(views: Sequence[StudyView]) -> list[str]:
    """Promise 2: the stability of hard cases in this run."""
    panels = [panel for view in views if view.study.over != "spp" for panel in view.panels]
    told = [f"{capital(_on(p))}, {sentence}" for p in panels for sentence in _stability(p)]
    if not panels:
        told = ["This run drove no scene parameter to an extreme."]
    return [*told, _soundness([panel for view in views for panel in view.panels])]


def _soundness(panels: Sequence[Panel]) -> str:
    records = [cell.record for panel in panels for cell in panel.cells]
    broken = sum(record.statistics.nonfinite > 0 for record in records)
    doubted = sum(record.statistics.verdict != "ok" for record in records)
    return (
        f"Of the {len(records):,} images of this run, {broken or 'none'} had a sample that is not a "
        f"finite number, and {doubted or 'none'} were called untrustworthy by their own samples."
    )


def promise_plan(panels: Sequence[Panel]) -> list[str]:
    """Promise 3: the effects that the plan left out, and the rays that were traced."""
    records = [cell.record for panel in panels for cell in panel.cells]
    if not records:
        return ["No image was rendered."]
    plans = {record.scene_hash: record.plan for record in records}
    decided = sum(map(len, plans.values()))
    spared = sum(not decision.needed for plan in plans.values() for decision in plan)
    primary, shadow = sum(r.rays.primary for r in records), sum(r.rays.shadow for r in records)
    return [
        f"For {count(len(plans), 'scene', 'scenes and variants of scenes')} the plan decided on {decided} "
        f"effects and left out {spared}, whose result is provably zero or changes nothing.",
        f"{millions(primary)} primary rays needed {millions(shadow)} shadow rays{_saved(primary, shadow)}"
        f"{_unshadowed(panels)}.",
    ]


def _saved(primary: int, shadow: int) -> str:
    share = f"{100 * (1 - shadow / primary):.0f} %"
    return f", {share} fewer than one each: the others had nothing to shade, or nothing could lie between"


def _unshadowed(panels: Sequence[Panel]) -> str:
    """The scenes that need no shadow ray at all, by the plan's proof."""
    scenes = {p.scene: sum(c.record.rays.shadow for c in p.cells) for p in panels}
    free = [scene_title(scene) for scene, rays in scenes.items() if rays == 0]
    return f"; {listing(free)} needed none at all" if free else ""


def _on(panel: Panel) -> str:
    return f"on {scene_title(panel.scene, panel.fixed)}"


def _spp(points: Sequence[Point]) -> str:
    return f"{listing([str(p.spp) for p in points])} spp"


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
    """The pairs at the largest x where both have an efficiency; the others are left out."""
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
