"""The figures as data: which marker says what, and that no marker says what may not be said."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from pipeline.store.run_folder import load_run
from reports.figures import (
    BOUND,
    REFUSED,
    Span,
    error_against_parameter,
    error_against_time,
    span,
    ticks,
)
from reports.series import select_studies
from tests.kit.small_run import FORBIDDEN, GAPS, SECONDS, SIGMA, SPP


@pytest.fixture(scope="module")
def figures(small_run: Path) -> tuple[Any, Any]:
    """The two figures of the small run as plain data."""
    samples, overflow = (view.panels[0] for view in select_studies(load_run(small_run)))
    return error_against_time(samples).to_dict(), error_against_parameter(overflow).to_dict()


def traces(figure: Any, symbol: str) -> list[Any]:
    """Those with that marker and with points: entries of the legend alone have none."""
    found = [trace for trace in figure["data"] if trace.get("marker", {}).get("symbol") == symbol]
    return [trace for trace in found if trace["x"][0] is not None]


def test_measured_points_stand_at_seconds_and_rmse_with_their_intervals(figures: tuple[Any, Any]) -> None:
    area, solid = traces(figures[0], "circle")
    for trace, name in ((area, "area"), (solid, "solid-angle")):
        assert list(trace["x"]) == pytest.approx([SECONDS[name] * n for n in SPP])
        assert list(trace["y"]) == pytest.approx([SIGMA[name] / math.sqrt(n) for n in SPP])
        assert all(bar > 0 for bar in (*trace["error_y"]["array"], *trace["error_y"]["arrayminus"]))
        assert trace["name"].startswith(f"{name}, independent<br>slope −0.500")
        assert all(f"{n} spp, 3 seeds" in text for n, text in zip(SPP, trace["text"], strict=True))


def test_bounds_are_hollow_triangles_and_no_part_of_a_line(figures: tuple[Any, Any]) -> None:
    lines, bounds = traces(figures[0], "square"), traces(figures[0], BOUND)
    assert [len(line["x"]) for line in lines] == [len(SPP) - 1] * 2
    assert [list(bound["x"]) for bound in bounds] == [pytest.approx([0.64])] * 2
    assert all("RMSE below" in bound["text"][0] for bound in bounds)


def test_untrustworthy_points_are_crosses_at_the_edge_and_tell_no_number(figures: tuple[Any, Any]) -> None:
    (crosses,) = traces(figures[1], REFUSED)
    low, high = figures[1]["layout"]["yaxis"]["range"]
    assert sorted(crosses["x"]) == sorted(GAPS[1:])
    assert all(0.97 < (math.log10(y) - low) / (high - low) < 1 for y in crosses["y"])
    assert all("untrustworthy: no number" in text and "RMSE" not in text for text in crosses["text"])
    values = [y for trace in figures[1]["data"] for y in trace["y"] if y is not None]
    assert not [y for y in values if abs(y / FORBIDDEN - 1) < 1e-3]


def test_guide_has_slope_minus_one_half(figures: tuple[Any, Any]) -> None:
    (guide,) = [trace for trace in figures[0]["data"] if trace.get("name") == "guide: slope −1/2"]
    x, y = guide["x"], guide["y"]
    assert math.log(y[1] / y[0]) / math.log(x[1] / x[0]) == pytest.approx(-0.5)


def test_the_legend_explains_the_markers_that_there_are(figures: tuple[Any, Any]) -> None:
    names = [{trace.get("name") for trace in figure["data"]} for figure in figures]
    assert "upper bound" in names[0] and "untrustworthy" not in names[0]
    assert "untrustworthy" in names[1] and "upper bound" not in names[1]


def test_axes_cover_the_data_and_never_less_than_a_decade() -> None:
    """Catches an axis that blows two values of 1 % difference up to the full height."""
    found = span([1.0, 1.01])
    assert found.high - found.low == pytest.approx(1.0)
    assert found.ends[0] < 1.0 < 1.01 < found.ends[1]
    wide = span([1e-3, 1e2])
    assert wide.ends[0] < 1e-3 < 1e2 < wide.top < wide.ends[1]
    assert span([]).ends == pytest.approx((0.1, 1.0), rel=0.2)


def test_an_axis_with_values_that_have_no_logarithm_is_linear() -> None:
    found = span([-1.0, 0.0, 3.0])
    assert not found.log and found.ends == pytest.approx((-1.28, 3.28))


def test_ticks_are_round_numbers_inside_the_axis() -> None:
    assert ticks(Span(-2.1, -0.9)) == [0.01, 0.02, 0.05, 0.1]
    assert ticks(Span(-5.1, 0.1)) == [1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0]
