"""What a run showed, in sentences.

Each carries the figures that it rests on, and says so where there are none.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence

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
from reports.series import Panel, Point, Series, StudyView, wall_over_cpu
from reports.trends import (
    Comparison,
    by_estimator,
    by_sampler,
    fitted_slope,
    last_slope,
    measured,
    sample_slope,
)

DISAGREE = 1.5  # factor between the ratio by MSE and that by relMSE from which on both are told
TOLD = 3  # comparisons named one by one
QUIET = 1.1  # wall over CPU seconds; beyond it the times are another program's as well


def cost_sentences(panel: Panel) -> list[str]:
    """What halving the error costs in time, one sentence for each series; then how the series compare."""
    told = [_fitted_cost(s) if s.sampler == "independent" else _last_cost(s) for s in panel.series]
    return told + _compared([panel], by_estimator) + _compared([panel], by_sampler) + _rasterised(panel)


def _rasterised(panel: Panel) -> list[str]:
    """What the rasterised picture costs and is worth, and which series does better for less."""
    found = panel.baseline
    if found is None or found.rmse.value is None:
        return []
    error, seconds = found.rmse.value, found.seconds.value
    better = [(s, p) for s in panel.series for p in measured(s) if (p.rmse.value or 0.0) < error]
    first = min(better, key=lambda one: one[1].seconds.value, default=None)
    than = "no measured point has less error"
    if first is not None:
        series, point = first
        than = f"the first point with less error is {series.label} at {point.spp} spp, after {sig(point.seconds.value)} s"  # noqa: E501
    return [
        f"Rasterised by {panel.study.baseline} without shadows, and with a point in place of each light, the picture takes "  # noqa: E501
        f"{sig(seconds)} s and has an RMSE of {sig(error)}, which no time makes less; {than}."
    ]


def _fitted_cost(series: Series) -> str:
    slope = fitted_slope(series)
    if slope is None:
        return _no_cost(series)
    first, last = measured(series)[0], measured(series)[-1]
    alone = sample_slope(series)
    beside = f"; against samples instead of seconds it is {slope_text(alone)}" if alone else ""
    return (
        f"{capital(series.estimator)} with independent samples: halving the error costs {interval(halving_cost(slope))} times "  # noqa: E501
        f"the render time (slope {slope_text(slope)}, fitted from {first.spp} to {last.spp} spp{beside})."
    )


def _last_cost(series: Series) -> str:
    """A series that is no power law has no one slope: what its last measured step says."""
    found = last_slope(series)
    if found is None:
        return _no_cost(series)
    slope, start, stop = found
    hidden = [p for p in series.points if p.rmse.bound]
    beyond = f"; {_spp(hidden)} {_are(len(hidden))} below the reference's noise" if hidden else ""
    return (
        f"{capital(series.estimator)} with {series.sampler}: at the pace of the last measured step, {start.spp} to {stop.spp} spp, "  # noqa: E501
        f"{interval(halving_cost(slope))} times (local slope {slope_text(slope)}{beyond})."
    )


def _no_cost(series: Series) -> str:
    where = f"{capital(series.estimator)} with {series.sampler}"
    return f"{where}: fewer than two measured errors, so that no cost can be told."


def stability_sentences(panel: Panel) -> list[str]:
    """Which series hold along a parameter, which do not, and from where on."""
    return [capital(sentence) for sentence in _stability(panel)]


def _stability(panel: Panel) -> list[str]:
    return [_holds(s, panel) if all(p.trusted for p in s.points) else _fails(s, panel) for s in panel.series]


def _holds(series: Series, panel: Panel) -> str:
    ends = f"from {panel.study.over} = {plain(series.points[-1].x)} to {plain(series.points[0].x)}"
    values = [p.rmse.value for p in measured(series) if p.rmse.value is not None]
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
        f"{series.label} is untrustworthy at {panel.study.over} = {where}: there the samples of {doubted} of {total} images "  # noqa: E501
        f"cannot tell their own error, and no number is given."
    )


def left_out_sentences(view: StudyView, panel: Panel) -> list[str]:
    """What the sweep asked for on this scene and could not have."""
    return [
        f"{capital(item.what)} is left out: {item.reason.replace('`', '')}."
        for item in view.left_out
        if item.scene == panel.scene or item.scene.startswith(f"{panel.scene} ")
    ]


def promise_accuracy(views: Sequence[StudyView]) -> list[str]:
    """Promise 1: what accuracy cost in time in this run."""
    panels = [panel for view in views if view.study.over == "spp" for panel in view.panels]
    if not panels:
        return ["This run varied no sample count, so that it says nothing about the price of accuracy."]
    told = [_costs(panels), *_compared(panels, by_estimator), *_compared(panels, by_sampler), _hidden(panels)]
    return told + _disturbed(panels)


def _disturbed(panels: Sequence[Panel]) -> list[str]:
    """A warning where the machine had other work, so that times and all that is made of them are too long and
    scattered.
    """
    ratios = wall_over_cpu(cell.record for panel in panels for cell in panel.cells)
    usual = statistics.median(ratios) if ratios else 1.0
    if usual <= QUIET:
        return []
    return [
        f"The machine was busy: half of the renders waited for the processor so long that they took {sig(usual)} times "  # noqa: E501
        f"their CPU time or more. Its times and efficiencies are that uncertain."
    ]


def _costs(panels: Sequence[Panel]) -> str:
    """Halving costs with independent samples, estimator by estimator, scene by scene."""
    told: dict[str, list[str]] = {}
    for panel in panels:
        for series in panel.series:
            slope = fitted_slope(series) if series.sampler == "independent" else None
            if slope is not None:
                told.setdefault(series.estimator, []).append(
                    f"by {interval(halving_cost(slope))} {_on(panel)}"
                )
    if not told:
        return "No series with independent samples has two measured errors, so that no cost of halving the error can be told."  # noqa: E501
    parts = [f"with {estimator} {listing(costs)}" for estimator, costs in told.items()]
    return (
        f"Halving the error with independent samples multiplied the render time: {', and '.join(parts)} "
        f"(4 where nothing but the number of samples costs time)."
    )


def _compared(panels: Sequence[Panel], pairs: Callable[[Panel], list[Comparison]]) -> list[str]:
    """How many times as efficient one kind of series was as another, a sentence for each kind."""
    kinds: dict[tuple[str, str], list[Comparison]] = {}
    for found in (comparison for panel in panels for comparison in pairs(panel)):
        kinds.setdefault(_kind(found), []).append(found)
    return [f"{what} {_ratios(found, base, len(panels) > 1)}." for (what, base), found in kinds.items()]


def _kind(found: Comparison) -> tuple[str, str]:
    if found.series.estimator == found.base.estimator:
        return f"{capital(found.series.sampler)} samples were", f"{found.base.sampler} ones"
    return f"With {found.series.sampler} samples, {found.series.estimator} was", found.base.estimator


def _ratios(found: Sequence[Comparison], base: str, scenes: bool) -> str:
    """One by one where they are few, as a range where they are many."""
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
    """Whether the interval of the ratio holds 1."""
    return found.ratio.low <= 1 <= found.ratio.high


def _no_difference(found: Comparison) -> str:
    return " (no difference shown)" if _undecided(found) else ""


def _by_relmse(found: Comparison) -> str:
    """The ratio by relMSE where it tells another story."""
    if found.relative is None or 1 / DISAGREE < found.relative.value / found.ratio.value < DISAGREE:
        return ""
    return f" (by relMSE, {interval(found.relative)} times)"


def _where(found: Comparison, scenes: bool) -> str:
    """What tells one comparison of a kind from the others."""
    sampler = found.series.estimator == found.base.estimator
    place = _on(found.panel) if scenes else f"with {found.series.estimator}" if sampler else ""
    return f"{place} at {found.spp} spp".strip()


def _hidden(panels: Sequence[Panel]) -> str:
    points = [p for panel in panels for s in panel.series for p in s.points]
    bounds, refused = sum(p.rmse.bound for p in points), sum(not p.trusted for p in points)
    if not bounds and not refused:
        return f"All {len(points)} points stand above the reference's noise and rest on samples that can be trusted."  # noqa: E501
    return (
        f"Of {len(points)} points, {bounds} below the reference's noise {_are(bounds)} given as upper bounds, "  # noqa: E501
        f"and {refused} untrustworthy {_are(refused)} given no number."
    )


def _are(number: int) -> str:
    return "is" if number == 1 else "are"


def promise_stability(views: Sequence[StudyView]) -> list[str]:
    """Promise 2: whether hard cases stayed stable in this run."""
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
        f"Of the {len(records):,} images of this run, {broken or 'none'} had a sample that is not a finite number, "  # noqa: E501
        f"and {doubted or 'none'} were called untrustworthy by their own samples."
    )


def promise_plan(panels: Sequence[Panel]) -> list[str]:
    """Promise 3: what the plan left out in this run, and what was traced."""
    records = [cell.record for panel in panels for cell in panel.cells]
    if not records:
        return ["No image was rendered."]
    plans = {record.scene_hash: record.plan for record in records}
    spared = sum(not decision.needed for plan in plans.values() for decision in plan)
    primary, shadow = sum(r.rays.primary for r in records), sum(r.rays.shadow for r in records)
    return [
        f"For {count(len(plans), 'scene', 'scenes and variants of scenes')} the plan decided on {sum(map(len, plans.values()))} effects and left out "  # noqa: E501
        f"{spared}, whose result is provably zero or changes nothing.",
        f"{millions(primary)} primary rays needed {millions(shadow)} shadow rays{_saved(primary, shadow)}{_unshadowed(panels)}.",  # noqa: E501
    ]


def _saved(primary: int, shadow: int) -> str:
    share = f"{100 * (1 - shadow / primary):.0f} %"
    return f", {share} fewer than one each: the others had nothing to shade, or nothing could lie between"


def _unshadowed(panels: Sequence[Panel]) -> str:
    """Scenes for which the plan showed that no shadow ray is needed at all."""
    scenes = {p.scene: sum(c.record.rays.shadow for c in p.cells) for p in panels}
    free = [scene_title(scene) for scene, rays in scenes.items() if rays == 0]
    return f"; {listing(free)} needed none at all" if free else ""


def _on(panel: Panel) -> str:
    return f"on {scene_title(panel.scene, panel.fixed)}"


def _spp(points: Sequence[Point]) -> str:
    return f"{listing([str(p.spp) for p in points])} spp"
