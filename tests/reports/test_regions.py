"""Errors by region, bounds that look like bounds, and comparisons that show nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.schema.record import Score
from pipeline.statistics.intervals import Interval
from pipeline.store.run_folder import load_run
from reports.findings import Comparison, _ratios, by_estimator  # pyright: ignore[reportPrivateUsage]
from reports.page import write_report
from reports.series import Panel, measure_all, select_studies
from reports.tables import error_table, region_table, value_cell
from tests.kit.small_run import HEIGHT, LEAK, PIXELS, SIGMA, SPP, WIDTH, write_run


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("run"))


def panels(root: Path) -> list[Panel]:
    return [panel for view in select_studies(load_run(root)) for panel in view.panels]


def mse(value: float, bound: bool) -> Score:
    return Score(metric="mse", value=value, low=0.9 * value, high=1.1 * value, bound=bound)


def test_the_error_of_each_region_is_in_its_table(root: Path) -> None:
    """All of it in the lit region: its RMSE is that of the image times sqrt(all pixels / lit ones)."""
    table = region_table(panels(root)[0])
    assert table is not None
    titles = [(heading.title, heading.unit) for heading in table.headings]
    assert titles[2:] == [("lit", "700 px"), ("umbra", "68 px"), ("umbra leak", "of all light")]
    series = next(row for row in table.rows if row.cells[0].text.startswith("area, independent"))
    expected = SIGMA["area"] / SPP[-1] ** 0.5 * (WIDTH * HEIGHT / PIXELS["lit"]) ** 0.5
    assert float(series.cells[2].text) == pytest.approx(expected, rel=0.01)
    assert (series.cells[3].text, series.cells[4].text) == ("0", "3.00×10⁻⁵") and LEAK == 3e-5


def test_an_untrustworthy_point_has_no_number_in_any_region(root: Path) -> None:
    table = region_table(panels(root)[1])
    assert table is not None
    area = next(row for row in table.rows if row.cells[0].text == "area")
    assert [cell.text for cell in area.cells[2:]] == ["–", "–", "–"]


def test_the_page_shows_where_the_error_is(root: Path, tmp_path: Path) -> None:
    page = write_report(root, tmp_path / "report").read_text(encoding="utf-8")
    assert page.count("Where the error is") == 2 and "68 px" in page


def test_below_the_reference_noise_no_figure_is_bare(root: Path) -> None:
    """The last sobol point is a bound: every figure of its row that holds the reference's noise is one, and
    points the right way.
    """
    table = error_table(panels(root)[0])
    titles = [heading.title for heading in table.headings]
    row = next(r for r in table.rows if r.cells[-1].text == "upper bound")
    shown = {
        title: row.cells[titles.index(title)].text for title in ("RMSE", "relMSE", "HDR-FLIP", "efficiency")
    }
    assert shown.pop("efficiency") == "–"
    assert all(text.startswith("< ") for text in shown.values())


def test_bounds_point_the_way_that_is_safe() -> None:
    card = {
        "mse": mse(1e-4, bound=True),
        "relmse": Score(metric="relmse", value=2e-4, low=1e-4, high=3e-4),
        "psnr": Score(metric="psnr", value=40.0, low=39.0, high=41.0),
        "nonfinite": Score(metric="nonfinite", value=0.0, low=0.0, high=0.0),
    }
    found = measure_all([card], None)
    assert (found["relmse"].value, found["relmse"].bound) == (3e-4, True)
    assert value_cell(found["psnr"], higher=True).text == "> 39.0"
    assert not found["nonfinite"].bound
    plain = measure_all([card | {"mse": mse(1e-4, bound=False)}], None)
    assert not plain["psnr"].bound and value_cell(plain["psnr"], higher=True).range == "39.0 to 41.0"


@pytest.mark.parametrize(("low", "high", "told"), [(0.9, 1.2, True), (1.05, 1.2, False), (0.8, 0.95, False)])
def test_a_ratio_whose_interval_holds_one_shows_no_difference(
    root: Path, low: float, high: float, told: bool
) -> None:
    panel = panels(root)[0]
    one = by_estimator(panel)[0]
    found = Comparison(panel, one.series, one.base, one.spp, Interval((low + high) / 2, low, high), None)
    assert ("(no difference shown)" in _ratios([found], "area", scenes=False)) is told
    many = _ratios([found] * 4, "area", scenes=False)
    assert ("4 of them show no difference" in many) is told
