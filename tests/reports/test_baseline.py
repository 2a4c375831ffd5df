"""The rasterised picture in the report: a point by itself, called biased, and no part of any comparison."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pipeline.schema.manifest import CellEntry
from pipeline.schema.record import Job
from pipeline.store.run_folder import Store, load_run
from reports import write_report
from reports.figures import error_against_time
from reports.series import Panel, select_studies
from reports.tables import error_table
from tests.kit import small_run as small
from tests.kit.small_run import write_run

RMSE, SECONDS = 0.31, 0.02


@pytest.fixture(scope="module")
def with_baseline(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small run, its first study with a rasterised picture."""
    root = write_run(tmp_path_factory.mktemp("small") / "run")
    job = Job(scene="soft-shadow", estimator="pyrender", sampler="pixel-middle", spp=1, seed=1)
    entry = CellEntry(key="drawn", job=job, score="score-drawn")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(small.SECONDS, "pyrender", SECONDS)
        small._write(Store(root), entry, RMSE, bound=False)
    manifest = Store(root).read_manifest()
    first, second = manifest.studies
    studies = [first.model_copy(update={"cells": [*first.cells, entry]}), second]
    study = manifest.sweep.study[0].model_copy(update={"baseline": "pyrender"})
    sweep = manifest.sweep.model_copy(update={"study": [study, manifest.sweep.study[1]]})
    Store(root).write_manifest(manifest.model_copy(update={"studies": studies, "sweep": sweep}))
    return root


def _panels(root: Path) -> list[Panel]:
    return [panel for view in select_studies(load_run(root)) for panel in view.panels]


def test_it_stands_apart_from_the_series(with_baseline: Path) -> None:
    first, other = _panels(with_baseline)
    assert other.baseline is None
    assert {series.estimator for series in first.series} == {"area", "solid-angle"}
    assert first.baseline is not None
    assert first.baseline.rmse.value == pytest.approx(RMSE)
    assert first.baseline.seconds.value == SECONDS
    assert first.baseline.efficiency.value is None


def test_the_chart_has_one_point_that_says_biased(with_baseline: Path) -> None:
    figure = error_against_time(_panels(with_baseline)[0])
    (trace,) = [trace for trace in figure.data if trace.name and "pyrender" in trace.name]
    assert "biased" in trace.name
    assert (list(trace.x), list(trace.y)) == ([SECONDS], [pytest.approx(RMSE)])
    assert trace.mode == "markers"
    low, high = figure.layout.yaxis.range
    assert 10**low < RMSE < 10**high


def test_the_table_has_its_row_and_no_efficiency(with_baseline: Path) -> None:
    table = error_table(_panels(with_baseline)[0])
    last = table.rows[-1].cells
    assert len(last) == len(table.headings) == len(table.rows[0].cells)
    assert last[0].text == "pyrender"
    assert (last[-1].text, last[-2].text) == ("biased", "–")


def test_the_page_tells_its_cost_and_where_less_error_begins(with_baseline: Path) -> None:
    """Area with one sample takes 0.01 s and is off by 0.4; solid-angle is off by 0.2 for the same time."""
    page = re.sub(r"\s+", " ", write_report(with_baseline).read_text(encoding="utf-8"))
    assert "Rasterised by pyrender without shadows" in page
    assert "takes 0.0200 s and has an RMSE of 0.310, which no time makes less" in page
    assert "the first point with less error is solid-angle, independent at 1 spp, after 0.0100 s" in page
    assert "A square star is the rasterised picture" in page
