"""Every point of a report as CSV: for a spreadsheet, or to plot anew."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable

from reports.formats import settings
from reports.series import Measure, Panel, Point

COLUMNS = (
    *("study", "scene", "parameters", "estimator", "sampler", "over", "x", "spp", "seeds", "verdict"),
    *("rmse", "rmse_low", "rmse_high", "rmse_is_bound", "seconds", "seconds_low", "seconds_high"),
    *("efficiency", "efficiency_low", "efficiency_high", "primary_rays", "shadow_rays"),
)


def points_csv(panels: Iterable[Panel]) -> str:
    """A row for each point under COLUMNS: RMSE in W/(m^2 sr), wall seconds, 1 / (MSE x s).

    Ends are those of 95 % intervals; what has no number is empty.
    """
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    for panel in panels:
        for series in panel.series:
            for point in panel.ordered(series):
                where = (panel.study.name, panel.scene, settings((*panel.fixed, *panel.constants)))
                rows.writerow([*where, series.estimator, series.sampler, panel.study.over, *_figures(point)])
    return text.getvalue()


def _figures(point: Point) -> list[object]:
    seconds = point.seconds
    return [
        *(point.x, point.spp, len(point.cells), point.state),
        *_ends(point.rmse),
        int(point.rmse.bound),
        *(seconds.value, seconds.low, seconds.high),
        *_ends(point.efficiency),
        *point.rays,
    ]


def _ends(found: Measure) -> tuple[float | None, float | None, float | None]:
    return (None, None, None) if found.value is None else (found.value, found.low, found.high)
