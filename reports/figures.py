# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
"""The plotly figures: error against render seconds, and error against a scene parameter.

What a marker says: filled, a measured value with its 95 % interval; hollow triangle pointing down, an upper
bound (the reference's noise hides more); cross on the upper edge, an untrustworthy cell, of which there is no
number to place it by.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import plotly.graph_objects as go
import plotly.io
from plotly.offline import get_plotlyjs

from pipeline.statistics.slopes import Slope
from reports.axes import SOFT, Span, layout, span
from reports.formats import interval, sig, slope_text
from reports.measures import Measure
from reports.series import Panel, Point, Series
from reports.trends import fitted_slope

COLORS = ("#b4531f", "#1f5f8b", "#3f7d4e", "#8a4b8f", "#a07a12", "#5b6770")
BOUND, REFUSED, DRAWN = "triangle-down-open", "x-thin", "star-square-open"
DASHES = ("solid", "dash", "dot", "dashdot")
SYMBOLS = ("circle", "square", "diamond", "pentagon")
CONFIG = {"displaylogo": False, "responsive": True, "modeBarButtonsToRemove": ["select2d", "lasso2d"]}


@dataclass(frozen=True)
class Style:
    """How a series looks: colour by estimator, dash and symbol by sampler."""

    color: str
    dash: str
    symbol: str


def styles(panel: Panel) -> dict[str, Style]:
    """Series label to style; the same for every panel of a study, as the sweep's axes give the order."""
    axes = panel.study.axes
    return {
        series.label: Style(
            color(panel, series),
            DASHES[axes.sampler.index(series.sampler) % len(DASHES)],
            SYMBOLS[axes.sampler.index(series.sampler) % len(SYMBOLS)],
        )
        for series in panel.series
    }


def color(panel: Panel, series: Series) -> str:
    """The colour of a series, by its estimator's place in the sweep."""
    return COLORS[panel.study.axes.estimator.index(series.estimator) % len(COLORS)]


def plotly_source() -> str:
    """The script that draws the figures."""
    return get_plotlyjs()


def html(figure: go.Figure, anchor: str) -> str:
    """A `div` with the id `anchor` and the script that draws the figure into it."""
    return plotly.io.to_html(figure, config=CONFIG, include_plotlyjs=False, full_html=False, div_id=anchor)


def error_against_time(panel: Panel) -> go.Figure:
    """RMSE against render seconds, log-log, with the slopes fitted for `independent` and a guide of slope
    -1/2.
    """
    return _figure(panel, _seconds, "render time of one image, one thread (s)", _slopes(panel))


def error_against_parameter(panel: Panel) -> go.Figure:
    """RMSE against the parameter that the study varies, log-log."""
    return _figure(panel, _position, f"{panel.study.over} (parameter of the scene)", {})


def _seconds(point: Point) -> float:
    return point.seconds.value


def _position(point: Point) -> float:
    return point.x


def _slopes(panel: Panel) -> dict[str, Slope]:
    found = {series.label: fitted_slope(series) for series in panel.series if series.sampler == "independent"}
    return {label: slope for label, slope in found.items() if slope is not None}


def _figure(panel: Panel, x: Callable[[Point], float], title: str, slopes: dict[str, Slope]) -> go.Figure:
    points = [point for series in panel.series for point in series.points]
    points += [panel.baseline] if panel.baseline else []
    across, up = span([x(p) for p in points]), span([e for p in points for e in _ends(p.rmse)])
    figure = go.Figure(layout=layout(title, across, "RMSE, radiance (W/(m² sr))", up))
    looks = styles(panel)
    for series in panel.series:
        for trace in _traces(series, looks[series.label], x, up, slopes.get(series.label)):
            figure.add_trace(trace)
    for trace in [*_guides(panel, across, slopes), *_baseline(panel, x), *_key(points)]:
        figure.add_trace(trace)
    return figure


def _ends(measure: Measure) -> list[float]:
    return [
        end for end in (measure.value, measure.low, measure.high) if end is not None and 0 < end < math.inf
    ]


def _traces(
    series: Series, look: Style, x: Callable[[Point], float], up: Span, slope: Slope | None
) -> list[go.Scatter]:
    measured = [p for p in series.points if p.rmse.measured]
    bounds = [p for p in series.points if p.rmse.bound]
    refused = [p for p in series.points if not p.trusted]
    traces = [_line(series, look, measured, x, slope, up)]
    if bounds:
        traces.append(_markers(series, look, bounds, x, [p.rmse.value for p in bounds], BOUND))
    if refused:
        traces.append(_markers(series, look, refused, x, [up.top] * len(refused), REFUSED))
    return traces


def _baseline(panel: Panel, x: Callable[[Point], float]) -> list[go.Scatter]:
    """The rasterised picture, a marker by itself: there is no line that more time would follow."""
    point, name = panel.baseline, panel.study.baseline
    if point is None or point.rmse.value is None:
        return []
    lines = [f"<b>{name}</b>: rasterised, biased", _error_line(point), f"time {sig(point.seconds.value)} s"]
    marker = go.Scatter(
        x=[x(point)],
        y=[point.rmse.value],
        error_y=_bars([point], SOFT, 0.0),
        name=f"{name}: rasterised,<br>no shadows, biased",
        mode="markers",
        marker=_mark(SOFT, DRAWN),
        text=["<br>".join(lines)],
        hovertemplate="%{text}<extra></extra>",
    )
    return [marker]


def _key(points: Sequence[Point]) -> list[go.Scatter]:
    """Legend entries for the markers that are no measured values, where there are such."""
    meanings = (
        (BOUND, "upper bound", any(p.rmse.bound for p in points)),
        (REFUSED, "untrustworthy", any(not p.trusted for p in points)),
    )
    return [
        go.Scatter(x=[None], y=[None], name=name, mode="markers", marker=_mark(SOFT, symbol))
        for symbol, name, there in meanings
        if there
    ]


def _mark(color: str, symbol: str) -> dict[str, Any]:
    return {"color": color, "symbol": symbol, "size": 11, "line": {"color": color, "width": 2.2}}


def _line(
    series: Series,
    look: Style,
    points: Sequence[Point],
    x: Callable[[Point], float],
    slope: Slope | None,
    up: Span,
) -> go.Scatter:
    name = series.label if slope is None else f"{series.label}<br>slope {slope_text(slope)}"
    return go.Scatter(
        x=[x(p) for p in points],
        y=[p.rmse.value for p in points],
        error_y=_bars(points, look.color, up.ends[0]),
        name=name,
        legendgroup=series.label,
        mode="lines+markers",
        line={"color": look.color, "dash": look.dash, "width": 1.8},
        marker={"color": look.color, "symbol": look.symbol, "size": 8},
        text=[_hover(series, p) for p in points],
        hovertemplate="%{text}<extra></extra>",
    )


def _bars(points: Sequence[Point], color: str, floor: float) -> dict[str, Any]:
    """Error bars to the ends of the 95 % intervals, of unequal length; an end at 0 stops at the axis."""
    triples = [(p.rmse.value or 0.0, max(p.rmse.low or 0.0, floor), p.rmse.high or 0.0) for p in points]
    return {
        "type": "data",
        "symmetric": False,
        "array": [high - value for value, _, high in triples],
        "arrayminus": [value - low for value, low, _ in triples],
        "color": color,
        "thickness": 1.2,
        "width": 4,
    }


def _markers(
    series: Series,
    look: Style,
    points: Sequence[Point],
    x: Callable[[Point], float],
    y: Sequence[float | None],
    symbol: str,
) -> go.Scatter:
    return go.Scatter(
        x=[x(p) for p in points],
        y=list(y),
        legendgroup=series.label,
        showlegend=False,
        mode="markers",
        cliponaxis=False,
        marker=_mark(look.color, symbol),
        text=[_hover(series, p) for p in points],
        hovertemplate="%{text}<extra></extra>",
    )


def _guides(panel: Panel, across: Span, slopes: dict[str, Slope]) -> list[go.Scatter]:
    """The fitted lines, thin, and a grey line of slope -1/2 through the middle of the first of them."""
    looks = styles(panel)
    ends = list(across.ends)
    lines = [
        _guide(ends, [slope(x) for x in ends], looks[label].color, label) for label, slope in slopes.items()
    ]
    if not slopes:
        return lines
    first = next(iter(slopes.values()))
    through = [math.exp(first.level - 0.5 * (math.log(x) - first.center)) for x in ends]
    return [*lines, _guide(ends, through, "#9aa1a6", "guide", name="guide: slope −1/2", dash="longdash")]


def _guide(
    x: list[float], y: list[float], color: str, group: str, name: str = "", dash: str = "dot"
) -> go.Scatter:
    return go.Scatter(
        x=x,
        y=y,
        mode="lines",
        name=name,
        legendgroup=group,
        showlegend=bool(name),
        line={"color": color, "width": 1, "dash": dash},
        opacity=1.0 if name else 0.55,
        hoverinfo="skip",
    )


def _hover(series: Series, point: Point) -> str:
    lines = [f"<b>{series.label}</b>", f"{point.place}, {len(point.cells)} seeds", _error_line(point)]
    return "<br>".join([*lines, f"time {interval(point.seconds)} s"])


def _error_line(point: Point) -> str:
    if not point.trusted:
        return "untrustworthy: no number"
    if point.rmse.value is None:
        return f"no RMSE: {point.rmse.note}"
    return f"RMSE below {sig(point.rmse.value)}" if point.rmse.bound else f"RMSE {interval(point.rmse)}"
