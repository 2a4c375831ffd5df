"""The tables of the report as headings and cells of text, which the template lays out."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from pipeline.schema.record import PlanDecision, RayCounts
from pipeline.scoring.metric import METRICS, Metric
from reports.figures import color
from reports.formats import DASH, ends, listing, millions, plain, power_of_ten, scene_title, sig
from reports.series import BELOW, Measure, Panel, Point, Series, Settings, root_of, varied

LEAK = "umbra-leak"
# Metrics without a column of their own: RMSE, regions and verdict show them.
ELSEWHERE = ("mse", "rmse", "nonfinite", "largest-share", LEAK)


@dataclass(frozen=True)
class Heading:
    """A column: its title, its unit in small print, and whether it holds words."""

    title: str
    unit: str = ""
    words: bool = False


@dataclass(frozen=True)
class Cell:
    """A text with `range` in small print below it.

    kind: CSS classes. color: a swatch before the text. title: text on hover.
    """

    text: str
    range: str = ""
    kind: str = ""
    color: str = ""
    title: str = ""


@dataclass(frozen=True)
class Row:
    """A row of cells. first: it begins a new group of rows."""

    cells: tuple[Cell, ...]
    first: bool = False


@dataclass(frozen=True)
class Table:
    """Headings and rows."""

    headings: tuple[Heading, ...]
    rows: tuple[Row, ...]


def error_table(panel: Panel) -> Table:
    """Error, time, rays and efficiency of every point of a panel."""
    metrics = [name for name in panel.study.metrics if name not in ELSEWHERE]
    samplers = len(panel.study.axes.sampler) > 1
    unit = _unit(point.efficiency for series in panel.series for point in series.points)
    headings = (
        Heading("estimator", words=True),
        *([Heading("sampler", words=True)] if samplers else []),
        *([] if panel.study.over == "spp" else [Heading(panel.study.over)]),
        Heading("spp"),
        Heading("RMSE", "W/(m² sr)"),
        *(_metric_heading(METRICS[name]) for name in metrics),
        Heading("time", "s"),
        Heading("rays", "+ shadow rays"),
        Heading("efficiency", f"{power_of_ten(unit)}/(MSE × s)"),
        Heading("verdict", words=True),
    )
    rows = (_error_row(panel, s, p, metrics, unit) for s in panel.series for p in panel.ordered(s))
    return Table(headings, (*rows, *_baseline_row(panel, metrics)))


def _metric_cells(point: Point, metrics: Sequence[str]) -> Iterator[Cell]:
    for name in metrics:
        yield value_cell(point.scores.get(name, Measure(None)), METRICS[name].better == "higher")


def _metric_heading(metric: Metric) -> Heading:
    """The title up to its definition, its unit if it has one, and an arrow where more of it is better."""
    units = [metric.unit] if metric.unit != "1" else []
    more = ["\u2191"] if metric.better == "higher" else []
    return Heading(re.split(r",| \(", metric.title)[0], " ".join(units + more))


def _baseline_row(panel: Panel, metrics: Sequence[str]) -> list[Row]:
    """The rasterised image: no samples, no rays, and no efficiency, since no time lowers its error."""
    point = panel.baseline
    if point is None:
        return []
    verdict = Cell("biased", "no shadows, lights without size", "left", title=point.worst.reason)
    cells = (
        Cell(panel.study.baseline or "", kind="left"),
        *([Cell(DASH, kind="left muted")] if len(panel.study.axes.sampler) > 1 else []),
        Cell(DASH, kind="muted"),
        value_cell(point.rmse),
        *_metric_cells(point, metrics),
        Cell(sig(point.seconds.value)),
        Cell(DASH, kind="muted"),
        value_cell(point.efficiency),
        verdict,
    )
    return [Row(cells, first=True)]


def _unit(found: Iterable[Measure]) -> int:
    """The exponent of the power of a thousand in which the smallest of these figures is at least one."""
    values = [measure.value for measure in found if measure.value]
    return 3 * math.floor(math.log10(min(values)) / 3) if values else 0


def _error_row(panel: Panel, series: Series, point: Point, metrics: Sequence[str], unit: int) -> Row:
    primary, shadow = point.rays
    cells = (
        Cell(series.estimator, kind="left", color=color(panel, series)),
        *([Cell(series.sampler, kind="left")] if len(panel.study.axes.sampler) > 1 else []),
        *(() if panel.study.over == "spp" else (Cell(plain(point.x)),)),
        Cell(f"{point.spp:,}"),
        value_cell(point.rmse),
        *_metric_cells(point, metrics),
        Cell(sig(point.seconds.value), title=f"95 %: {ends(point.seconds)} s"),
        Cell(millions(primary), f"+ {millions(shadow)}"),
        value_cell(_scaled(point.efficiency, 10.0**-unit)),
        _verdict(point),
    )
    return Row(cells, first=point is panel.ordered(series)[0])


def _scaled(found: Measure, factor: float) -> Measure:
    value, low, high = (None if x is None else x * factor for x in (found.value, found.low, found.high))
    return replace(found, value=value, low=low, high=high)


def value_cell(found: Measure, higher: bool = False) -> Cell:
    """A number with its interval, a bound with its sign, or a dash. higher: a bound is a lower one."""
    if found.value is None:
        return Cell(DASH, kind="muted", title=found.note)
    if found.bound:
        sign = ">" if higher else "<"
        return Cell(f"{sign} {sig(found.value)}", kind="muted", title=found.note or BELOW)
    return Cell(sig(found.value), range=ends(found))


def _verdict(point: Point) -> Cell:
    if not point.trusted:
        doubted = f"{point.doubted} of {len(point.cells)} images"
        return Cell(point.state, doubted, "left bad", title=point.verdict)
    return Cell(point.state, kind="left" if point.rmse.measured else "left muted", title=point.rmse.note)


def samples_table(panel: Panel) -> Table:
    """The statistics of the samples along a parameter, from which each verdict follows."""
    headings = (
        Heading("estimator", words=True),
        Heading(panel.study.over),
        Heading("tail index", "below 2: heavy"),
        Heading("largest share", "of all light"),
        Heading("verdict", words=True),
        Heading("because (of the worst replicate)", words=True),
    )
    return Table(headings, tuple(_samples_row(panel, s, p) for s in panel.series for p in panel.ordered(s)))


def _samples_row(panel: Panel, series: Series, point: Point) -> Row:
    shown = point.worst
    cells = (
        Cell(series.label, kind="left", color=color(panel, series)),
        Cell(plain(point.x)),
        Cell(sig(shown.hill)),
        Cell(sig(shown.max_share)),
        Cell(shown.verdict, kind="left" if point.trusted else "left bad"),
        Cell(shown.reason, kind="left wrap"),
    )
    return Row(cells, first=point is panel.ordered(series)[0])


def region_table(panel: Panel) -> Table | None:
    """RMSE by region at each series' last point, with most samples or hardest; None without such scores."""
    last = [(series, panel.ordered(series)[-1]) for series in panel.series if series.points]
    pixels = _region_pixels([point for _, point in last])
    if not pixels:
        return None
    leaks = any(LEAK in point.scores for _, point in last)
    headings = (
        Heading("estimator", words=True),
        Heading("at", words=True),
        *(Heading(name, f"{count:,} px") for name, count in pixels.items()),
        *([Heading("umbra leak", "of all light")] if leaks else []),
    )
    return Table(
        headings, tuple(_region_row(panel, series, point, list(pixels), leaks) for series, point in last)
    )


def _region_pixels(points: list[Point]) -> dict[str, int]:
    """Every region with its number of pixels, from the first card that has it."""
    found: dict[str, int] = {}
    for card in (cell.card for point in points for cell in point.cells):
        for name, part in (card.regions if card else {}).items():
            found.setdefault(name, part.pixels)
    return found


def _region_row(panel: Panel, series: Series, point: Point, regions: list[str], leaks: bool) -> Row:
    by_region = point.regions
    cells = (
        Cell(series.label, kind="left", color=color(panel, series)),
        Cell(point.place, kind="left"),
        *(value_cell(root_of(by_region.get(name, {}).get("mse", Measure(None)))) for name in regions),
        *([value_cell(point.scores.get(LEAK, Measure(None)))] if leaks else []),
    )
    return Row(cells)


def plan_table(panels: Iterable[Panel]) -> Table:
    """Effect, decision and reason for each scene. Variants of a scene with the same plan share rows."""
    headings = tuple(Heading(title, words=True) for title in ("scene", "effect", "needed", "reason"))
    groups: dict[tuple[str, tuple[PlanDecision, ...]], list[tuple[Settings, RayCounts]]] = {}
    for panel in panels:
        for cell in panel.cells:
            plan, values = tuple(cell.record.plan), varied(panel.study, cell.entry.job)
            groups.setdefault((panel.scene, plan), []).append((values, cell.record.rays))
    rows = (row for (scene, plan), found in groups.items() for row in _plan_rows(scene, plan, found))
    return Table(headings, tuple(rows))


def _plan_rows(
    name: str, plan: Sequence[PlanDecision], found: Sequence[tuple[Settings, RayCounts]]
) -> list[Row]:
    primary, shadow = sum(rays.primary for _, rays in found), sum(rays.shadow for _, rays in found)
    told = ", ".join([scene_title(name), *_variants(values for values, _ in found)])
    scene = Cell(
        told, f"{sig(shadow / primary)} shadow rays a primary ray" if primary else "", "left wrap narrow"
    )
    return [
        Row((scene if i == 0 else Cell(""), *_decision(decision)), first=i == 0)
        for i, decision in enumerate(plan)
    ]


def _decision(decision: PlanDecision) -> tuple[Cell, Cell, Cell]:
    needed = Cell("yes", kind="left") if decision.needed else Cell("no", kind="left good")
    return Cell(decision.effect, kind="left"), needed, Cell(decision.reason, kind="left wrap")


def _variants(settings: Iterable[Settings]) -> list[str]:
    """Each parameter with all its values."""
    values: dict[str, dict[float, None]] = {}
    for name, value in (pair for pairs in settings for pair in pairs):
        values.setdefault(name, {})[value] = None
    return [f"{name} {listing([plain(value) for value in found])}" for name, found in values.items()]
