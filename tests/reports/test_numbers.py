"""From a run of known truths to points, slopes, ratios and sentences: each value can be told beforehand."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import replace
from pathlib import Path

import pytest
from scipy import stats

from pipeline.schema.record import Score, Seconds
from pipeline.statistics.slopes import halving_cost
from pipeline.store.run_folder import FinishedCell, Run, load_run
from reports.data import points_csv
from reports.findings import (
    by_estimator,
    by_sampler,
    cost_sentences,
    left_out_sentences,
    promise_accuracy,
    promise_plan,
    promise_stability,
    stability_sentences,
)
from reports.formats import count, ends, interval, listing, millions, plain, power_of_ten, sig, spread
from reports.headline import answer
from reports.series import Measure, Panel, Series, StudyView, _point, measure_all, select_studies
from tests.kit.small_run import GAPS, SECONDS, SEEDS, SIGMA, SPP, SPREAD


@pytest.fixture(scope="module")
def run(small_run: Path) -> Run:
    return load_run(small_run)


@pytest.fixture(scope="module")
def samples(run: Run) -> Panel:
    return select_studies(run)[0].panels[0]


@pytest.fixture(scope="module")
def overflow(run: Run) -> Panel:
    return select_studies(run)[1].panels[0]


def line(panel: Panel, estimator: str, sampler: str = "independent") -> Series:
    return next(s for s in panel.series if (s.estimator, s.sampler) == (estimator, sampler))


def test_replicates_become_one_point_with_students_interval(samples: Panel) -> None:
    """Catches an interval that is not over the seeds: Student's, two degrees of freedom, on the MSE, then the
    root.
    """
    half = stats.t.isf(0.025, SEEDS - 1) * SPREAD / math.sqrt(SEEDS)
    for estimator, sigma in SIGMA.items():
        points = line(samples, estimator).points
        assert [p.spp for p in points] == SPP
        for point in points:
            rmse = sigma / math.sqrt(point.spp)
            assert len(point.cells) == SEEDS
            assert point.seconds.value == pytest.approx(SECONDS[estimator] * point.spp)
            assert (point.rmse.value, point.rmse.low, point.rmse.high) == pytest.approx(
                (rmse, rmse * math.sqrt(1 - half), rmse * math.sqrt(1 + half))
            )


def test_efficiency_is_one_over_mse_times_seconds(samples: Panel) -> None:
    for estimator, sigma in SIGMA.items():
        for point in line(samples, estimator).points:
            assert point.efficiency.value == pytest.approx(1 / (sigma**2 * SECONDS[estimator]))
            assert point.efficiency.low is not None and point.efficiency.high is not None
            assert point.efficiency.low < 1 / (sigma**2 * SECONDS[estimator]) < point.efficiency.high


def test_a_bound_is_no_measured_point(samples: Panel) -> None:
    """Catches a bound that enters a fit or an efficiency: the slope would no longer be -1."""
    series = line(samples, "area", "sobol")
    last = series.points[-1]
    assert last.rmse.bound and not last.rmse.measured and last.efficiency.value is None
    slope = series.last_slope()
    assert slope is not None
    assert (slope[1].spp, slope[2].spp) == (4, 16)
    assert slope[0].value == pytest.approx(-1)
    assert halving_cost(slope[0]).value == pytest.approx(2)


def test_slopes_of_independent_samples(samples: Panel) -> None:
    for estimator in SIGMA:
        fitted, alone = line(samples, estimator).fitted_slope(), line(samples, estimator).sample_slope()
        assert fitted is not None and alone is not None
        assert (fitted.value, alone.value) == pytest.approx((-0.5, -0.5))
        assert halving_cost(fitted).value == pytest.approx(4)


def test_no_slope_from_one_point(samples: Panel) -> None:
    one = replace(line(samples, "area"), points=line(samples, "area").points[:1])
    assert one.fitted_slope() is None and one.last_slope() is None and one.sample_slope() is None
    assert "no cost can be told" in cost_sentences(replace(samples, series=(one,)))[0]


def test_comparisons_are_ratios_of_efficiency_where_both_are_measured(samples: Panel) -> None:
    """Solid angle has half the error at the same time, so four times the efficiency; sobol at 16 spp has 16
    times.
    """
    found = {c.series.sampler: c for c in by_estimator(samples)}
    assert (found["independent"].spp, found["sobol"].spp) == (64, 16)
    assert [found[s].ratio.value for s in ("independent", "sobol")] == pytest.approx([4, 4])
    assert [c.ratio.value for c in by_sampler(samples)] == pytest.approx([16, 16])


def test_untrustworthy_cells_have_no_number_at_all(overflow: Panel) -> None:
    """Catches a score that slips through: these cells have scores on disk, and they are wrong."""
    points = {p.x: p for p in line(overflow, "area").points}
    assert sorted(points) == sorted(GAPS)
    for gap in GAPS[1:]:
        point = points[gap]
        assert not point.trusted and point.doubted == SEEDS
        assert all(m.value is None for m in (point.rmse, point.efficiency, *point.scores.values()))
        assert "carries 30%" in point.verdict
    assert points[1.0].trusted and points[1.0].rmse.value == pytest.approx(0.02)


def test_one_doubtful_replicate_takes_the_number_from_all(run: Run) -> None:
    study = run.studies[0]
    first = study.cells[0]
    statistics = first.record.statistics.model_copy(update={"verdict": "untrustworthy"})
    doubtful = replace(first, record=first.record.model_copy(update={"statistics": statistics}))
    changed = replace(run, studies=(replace(study, cells=(doubtful, *study.cells[1:])), run.studies[1]))
    point = line(select_studies(changed)[0].panels[0], first.entry.job.estimator).points[0]
    assert not point.trusted and point.doubted == 1 and point.rmse.value is None


def test_a_replicate_without_a_score_takes_the_number_from_all(run: Run) -> None:
    """A mean over the replicates that happen to be defined would be a mean over the lucky ones."""
    study = run.studies[0]
    first = study.cells[0]
    assert first.card is not None
    scores = first.card.scores | {"mse": Score(metric="mse", value=None, note="3 pixels are not finite")}
    broken = replace(first, card=first.card.model_copy(update={"scores": scores}))
    changed = replace(run, studies=(replace(study, cells=(broken, *study.cells[1:])), run.studies[1]))
    point = line(select_studies(changed)[0].panels[0], first.entry.job.estimator).points[0]
    assert point.trusted and point.rmse.value is None and point.rmse.note == "3 pixels are not finite"


def test_labels_name_only_what_varies(samples: Panel, overflow: Panel) -> None:
    assert [s.label for s in samples.series][:2] == ["area, independent", "area, sobol"]
    assert [s.label for s in overflow.series] == ["area", "solid-angle"]
    assert overflow.fixed == () and overflow.constants == (("width", 2.0),)


def test_cost_sentences(samples: Panel) -> None:
    told = cost_sentences(samples)
    assert "Area with independent samples: halving the error costs 4.00 " in told[0]
    assert "slope −0.500 ± 0.000, fitted from 1 to 64 spp" in told[0]
    assert "Area with sobol: at the pace of the last measured step, 4 to 16 spp, 2.00 (" in told[1]
    assert "64 spp is below the reference's noise" in told[1]
    assert any(
        "solid-angle was 4.00 (" in sentence and "as efficient as area at 64 spp" in sentence
        for sentence in told
    )


def test_what_was_left_out_of_a_scene_is_said_where_the_scene_is(run: Run) -> None:
    view = select_studies(run)[0]
    assert left_out_sentences(view, view.panels[0]) == []
    disk = replace(view.panels[0], scene="disk-light")
    assert left_out_sentences(view, disk) == ["Solid-angle is left out: its method is still to come."]


def test_stability_sentences(overflow: Panel) -> None:
    fails, holds = stability_sentences(overflow)
    assert fails.startswith(
        "Area is untrustworthy at gap = 0.01 and 0.0001: there the samples of 6 of 6 images"
    )
    assert holds.startswith(
        "Solid-angle holds from gap = 1 to 0.0001: the samples of all 9 images can be trusted"
    )
    assert "RMSE 0.0200" in holds


def test_promises(run: Run) -> None:
    views = select_studies(run)
    accuracy, stability = promise_accuracy(views), promise_stability(views)
    plan = promise_plan([panel for view in views for panel in view.panels])
    assert "with area by 4.00 (4.00 to 4.00) on soft-shadow" in accuracy[0]
    assert accuracy[-1].startswith(
        "Of 16 points, 2 below the reference's noise are given as upper bounds, and 0 untrustworthy"
    )
    assert "6 were called untrustworthy" in stability[-1] and "none had a sample" in stability[-1]
    assert "decided on 8 effects and left out 4" in plan[0]
    assert "touching-light needed none at all" in plan[1]


def test_relmse_is_told_where_it_tells_another_story(samples: Panel) -> None:
    """Both errors are halved in the small run; here relMSE of solid angle is a hundredth besides, MSE is
    not.
    """
    solid = line(samples, "solid-angle")
    last = solid.points[-1]
    relmse = last.scores["relmse"]
    assert relmse.value and relmse.low and relmse.high
    better = Measure(relmse.value / 100, relmse.low / 100, relmse.high / 100)
    points = (*solid.points[:-1], replace(last, scores=last.scores | {"relmse": better}))
    changed = replace(samples, series=(line(samples, "area"), replace(solid, points=points)))
    found = by_estimator(changed)[0]
    assert found.relative is not None
    assert (found.ratio.value, found.relative.value) == pytest.approx((4, 400))
    assert any("(by relMSE, 400 (" in sentence for sentence in cost_sentences(changed))
    assert not any("relMSE" in sentence for sentence in cost_sentences(samples))


def test_a_busy_machine_is_told(run: Run) -> None:
    """Catches times that are another program's: wall seconds twice the CPU's in every cell."""
    cells = tuple(
        replace(cell, record=cell.record.model_copy(update={"seconds": _waiting(cell.record.seconds)}))
        for cell in run.studies[0].cells
    )
    changed = replace(run, studies=(replace(run.studies[0], cells=cells), run.studies[1]))
    assert "took 2.00 times their CPU time or more" in promise_accuracy(select_studies(changed))[-1]
    assert "CPU" not in " ".join(promise_accuracy(select_studies(run)))


def _waiting(seconds: Seconds) -> Seconds:
    return seconds.model_copy(update={"cpu": seconds.render / 2})


def test_a_run_says_what_it_does_not_show(run: Run) -> None:
    views = select_studies(run)
    assert promise_accuracy(views[1:]) == [
        "This run varied no sample count, so that it says nothing about the price of accuracy."
    ]
    assert promise_stability(views[:1])[0] == "This run drove no scene parameter to an extreme."
    assert promise_plan([]) == ["No image was rendered."]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (1.0, "1.00"),
        (12.345, "12.3"),
        (999.96, "1,000"),
        (0.0012345, "0.00123"),
        (0.0009996, "0.00100"),
        (9.994e-4, "9.99×10⁻⁴"),
        (1.5e-9, "1.50×10⁻⁹"),
        (123456.0, "1.23×10⁵"),
        (-0.5, "−0.500"),
        (math.inf, "∞"),
        (math.nan, "–"),
        (None, "–"),
    ],
)
def test_three_significant_digits(value: float | None, text: str) -> None:
    """Catches rounding that crosses a power of ten (999.96, 0.0009996) and exponents of the machine's own
    making.
    """
    assert sig(value) == text


def test_other_texts() -> None:
    assert [plain(x) for x in (1.0, 0.01, 1e-5, 2.5e-7, -1e-5)] == ["1", "0.01", "10⁻⁵", "2.5×10⁻⁷", "−10⁻⁵"]
    assert [millions(x) for x in (12, 1234, 2.5e6)] == ["12", "1.23 k", "2.50 M"]
    assert [listing(x) for x in ([], ["a"], ["a", "b"], ["a", "b", "c"])] == [
        "",
        "a",
        "a and b",
        "a, b and c",
    ]
    assert [count(n, "image") for n in (0, 1, 2)] == ["no image", "1 image", "2 images"]
    assert (power_of_ten(0), power_of_ten(3)) == ("1", "10³")
    assert (spread([0.1, 0.3]), spread([0.1, 0.1])) == ("0.100 to 0.300", "0.100")
    assert interval(Measure(1.0, 0.5, 2.0)) == "1.00 (0.500 to 2.00)"
    assert (interval(Measure(1.0)), ends(Measure(1.0, math.nan, math.nan))) == ("1.00", "")


def test_a_bound_is_the_end_that_nothing_lies_beyond() -> None:
    """Below the noise an error has at most its upper end, and a likeness at least its lower one."""
    mse = Score(metric="mse", value=2e-5, low=-1e-5, high=5e-5, bound=True)
    near = Score(metric="psnr", value=40.0, low=38.0, high=43.0)
    far = Score(metric="mae", value=0.2, low=0.1, high=0.4)
    shift = Score(metric="bias", value=0.2, low=0.1, high=0.4)
    found = measure_all([{s.metric: s for s in (mse, near, far, shift)}], None)
    assert found["psnr"].bound and found["psnr"].value == 38.0
    assert found["mae"].bound and found["mae"].value == 0.4
    assert not found["bias"].bound and found["bias"].value == 0.2


def test_points_without_mse_say_so_everywhere(samples: Panel) -> None:
    """Catches a report that shows nothing and calls every point sound."""

    def bare(cell: FinishedCell) -> FinishedCell:
        assert cell.card is not None
        scores = {name: score for name, score in cell.card.scores.items() if name != "mse"}
        return replace(cell, card=cell.card.model_copy(update={"scores": scores}))

    cells = tuple(bare(cell) for cell in samples.series[0].points[0].cells)
    point = _point(samples.study, 1.0, cells)
    assert (point.state, point.rmse.value, point.efficiency.value) == ("no score", None, None)
    panel = replace(samples, series=(replace(samples.series[0], points=(point, point)),))
    why = "no MSE was scored; `penumbra run` scores it"
    assert promise_accuracy([StudyView(samples.study, (panel,), (), (), ())])[-1].endswith(
        f"; 2 have no error: {why}."
    )
    assert answer(panel).endswith(f" to tell ({why}).")
    row = next(csv.DictReader(io.StringIO(points_csv([panel]))))
    assert (row["verdict"], row["rmse"], row["efficiency"]) == ("no score", "", "")
