"""Axes of the figures: ranges, ticks and the frame around them, numbers written as in the text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from reports.formats import plain

FONT = 'system-ui, -apple-system, "Segoe UI", "Liberation Sans", sans-serif'
GRID, INK, SOFT = "#e4e7e8", "#1c2024", "#5a636b"
FEW_DECADES = 2.5
PAD = 0.07  # of an axis, on either side of the data


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
        """Just inside the upper end: where markers stand that have no value."""
        return self._value(self.high - 0.3 * PAD * (self.high - self.low))

    def _value(self, place: float) -> float:
        return 10.0**place if self.log else place


def span(values: Sequence[float]) -> Span:
    """The range of the values with a margin: one decade at least, so that what hardly changes looks so; 0.1
    to 1 for none.

    Linear where a value is not positive.
    """
    log = all(value > 0 for value in values)
    places = [math.log10(value) if log else value for value in values] or [-1.0, 0.0]
    low, high = min(places), max(places)
    pad = max(PAD * (high - low), (1.0 - (high - low)) / 2 if log else 0.0)
    return Span(low - pad, high + pad, log)


def layout(x_title: str, x: Span, y_title: str, y: Span) -> dict[str, Any]:
    """A plotly layout: the legend to the right of the frame."""
    return {
        "template": "none",
        "font": {"family": FONT, "size": 13, "color": INK},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "#ffffff",
        "margin": {"l": 78, "r": 16, "t": 14, "b": 62},
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
    """The decades inside a logarithmic range, with 2 and 5 times them where there are few."""
    steps = (1,) if found.high - found.low > FEW_DECADES else (1, 2, 5)
    decades = range(math.floor(found.low), math.ceil(found.high) + 1)
    values = [float(f"{step}e{decade}") for decade in decades for step in steps]
    return [value for value in values if found.low <= math.log10(value) <= found.high]
