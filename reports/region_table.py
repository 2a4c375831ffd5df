"""The table of errors by region of the picture: where an error comes from, and whether light leaks into the
umbra.
"""

from __future__ import annotations

from reports.figures import color
from reports.measures import Measure, root_of
from reports.series import Panel, Point, Series
from reports.tables import Cell, Heading, Row, Table, value_cell

LEAK = "umbra-leak"


def region_table(panel: Panel) -> Table | None:
    """RMSE by region of each series' last point: most samples, or hardest; None where nothing was scored by
    region.
    """
    last = [(series, panel.ordered(series)[-1]) for series in panel.series if series.points]
    pixels = _pixels([point for _, point in last])
    if not pixels:
        return None
    leaks = any(LEAK in point.scores for _, point in last)
    headings = (
        Heading("estimator", words=True),
        Heading("at", words=True),
        *(Heading(name, f"{count:,} px") for name, count in pixels.items()),
        *([Heading("umbra leak", "of all light")] if leaks else []),
    )
    return Table(headings, tuple(_row(panel, series, point, list(pixels), leaks) for series, point in last))


def _pixels(points: list[Point]) -> dict[str, int]:
    """Every region with its number of pixels, in the first card that has it."""
    found: dict[str, int] = {}
    for card in (cell.card for point in points for cell in point.cells):
        for name, part in (card.regions if card else {}).items():
            found.setdefault(name, part.pixels)
    return found


def _row(panel: Panel, series: Series, point: Point, regions: list[str], leaks: bool) -> Row:
    by_region = point.regions
    cells = (
        Cell(series.label, kind="left", color=color(panel, series)),
        Cell(point.place, kind="left"),
        *(value_cell(root_of(by_region.get(name, {}).get("mse", Measure(None)))) for name in regions),
        *([value_cell(point.scores.get(LEAK, Measure(None)))] if leaks else []),
    )
    return Row(cells)
