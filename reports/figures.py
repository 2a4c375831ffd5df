# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
"""The plotly figures: error against render seconds, and error against a scene parameter.

A filled marker is a measured value with its 95 % interval. A hollow triangle is an upper bound: the
reference's noise hides more. A cross on the upper edge is an untrustworthy cell, which has no number.
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
from reports.formats import interval, plain, sig, slope_text
from reports.series import Measure, Panel, Point, Series

COLORS = ("#b4531f", "#1f5f8b", "#3f7d4e", "#8a4b8f", "#a07a12", "#5b6770")
BOUND, REFUSED, DRAWN = "triangle-down-open", "x-thin", "star-square-open"
DASHES = ("solid", "dash", "dot", "dashdot")
SYMBOLS = ("circle", "square", "diamond", "pentagon")
FONT = 'system-ui, -apple-system, "Segoe UI", "Liberation Sans", sans-serif'
GRID, INK, SOFT = "#e4e7e8", "#1c2024", "#5a636b"
FEW_DECADES = 2.5
PAD = 0.07  # of an axis, on either side of the data
CONFIG = {"displaylogo": False, "responsive": True, "modeBarButtonsToRemove": ["select2d", "lasso2d"]}


@dataclass(frozen=True)
class Style:
    """The look of a series: colour by estimator, dash and symbol by sampler."""

    color: str
    dash: str
    symbol: str


def styles(panel: Panel) -> dict[str, Style]:
    """The style of each series by its label. The sweep's axes give the order, so that all panels agree."""
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
    """The source of plotly.js, which draws the figures."""
    return get_plotlyjs()


def html(figure: go.Figure, anchor: str) -> str:
    """A `div` with the id `anchor` and the script that draws the figure into it."""
    return plotly.io.to_html(figure, config=CONFIG, include_plotlyjs=False, full_html=False, div_id=anchor)


def error_against_time(panel: Panel) -> go.Figure:
    """RMSE against render seconds, log-log, with the slopes of `independent` and a guide of slope -1/2."""
    return _figure(panel, _seconds, "render time of one image, one thread (s)", _slopes(panel))


def error_against_parameter(panel: Panel) -> go.Figure:
    """RMSE against the parameter that the study varies, log-log."""
    return _figure(panel, _position, f"{panel.study.over} (parameter of the scene)", {})


def _seconds(point: Point) -> float:
    return point.seconds.value


def _position(point: Point) -> float:
    return point.x


def _slopes(panel: Panel) -> dict[str, Slope]:
    found = {
        series.label: series.fitted_slope() for series in panel.series if series.sampler == "independent"
    }
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
    """A single marker for the rasterised image, whose error no time lowers."""
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
    """Legend entries for the markers that are not measured values."""
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
    """The fitted lines, thin, and a grey line of slope -1/2 through the middle of the first one."""
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


@dataclass(frozen=True)
class Span:
    """The range of an axis; low and high are decades (powers of ten) if `log`."""

    low: float
    high: float
    log: bool = True

    @property
    def ends(self) -> tuple[float, float]:
        """The values at both ends."""
        return self._value(self.low), self._value(self.high)

    @property
    def top(self) -> float:
        """The place just inside the upper end, for markers without a value."""
        return self._value(self.high - 0.3 * PAD * (self.high - self.low))

    def _value(self, place: float) -> float:
        return 10.0**place if self.log else place


def span(values: Sequence[float]) -> Span:
    """The range of the values with a margin; linear where a value is not positive, 0.1 to 1 without values.

    A logarithmic range spans at least one decade, so that small differences look small.
    """
    log = all(value > 0 for value in values)
    places = [math.log10(value) if log else value for value in values] or [-1.0, 0.0]
    low, high = min(places), max(places)
    pad = max(PAD * (high - low), (1.0 - (high - low)) / 2 if log else 0.0)
    return Span(low - pad, high + pad, log)


def layout(x_title: str, x: Span, y_title: str, y: Span) -> dict[str, Any]:
    """A plotly layout: the legend to the right of the frame, both below the bar of tools."""
    return {
        "template": "none",
        "font": {"family": FONT, "size": 13, "color": INK},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "#ffffff",
        "margin": {"l": 78, "r": 16, "t": 36, "b": 62},
        "hoverlabel": {
            "bgcolor": "#ffffff",
            "bordercolor": "#b9bfc4",
            "font": {"family": FONT, "size": 12.5},
        },
        "legend": {"x": 1.015, "xanchor": "left", "y": 1, "tracegroupgap": 6, "font": {"size": 12.5}},
        "xaxis": _axis(x_title, x),
        "yaxis": _axis(y_title, y),
    }


def _axis(title: str, found: Span) -> dict[str, Any]:
    axis = {
        "range": [found.low, found.high],
        "title": {"text": title, "standoff": 12, "font": {"size": 13.5}},
        "gridcolor": GRID,
        "linecolor": SOFT,
        "mirror": True,
        "showline": True,
        "zeroline": False,
        "ticks": "outside",
        "tickcolor": SOFT,
        "ticklen": 5,
        "automargin": True,
    }
    if not found.log:
        return axis
    values = ticks(found)
    return axis | {"type": "log", "tickvals": values, "ticktext": [plain(value) for value in values]}


def ticks(found: Span) -> list[float]:
    """The decades inside a logarithmic range, and 2 and 5 times them where they are few."""
    steps = (1,) if found.high - found.low > FEW_DECADES else (1, 2, 5)
    decades = range(math.floor(found.low), math.ceil(found.high) + 1)
    values = [float(f"{step}e{decade}") for decade in decades for step in steps]
    return [value for value in values if found.low <= math.log10(value) <= found.high]
