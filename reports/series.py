"""A run folder as tidy series: the points of each figure, with their intervals and verdicts.

An untrustworthy cell has no number. A cell below the reference's noise has an upper bound.
Everything else has a value with a 95 % interval over its replicate seeds. No other module decides this.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from pipeline.schema.manifest import CellEntry, LeftOut, StudyEntry
from pipeline.schema.record import Job, Record, SampleStatistics, Score
from pipeline.schema.sweep import Study
from pipeline.scoring.metric import METRICS
from pipeline.statistics.intervals import (
    Interval,
    efficiency,
    mean_interval,
    replicate_interval,
    replicate_mse,
)
from pipeline.statistics.slopes import Slope, fit_slope
from pipeline.store.run_folder import FinishedCell, FinishedStudy, Run

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)
Cards = Sequence[Mapping[str, Score] | None]  # the scores of each replicate, None where it is not scored
Settings = tuple[tuple[str, float], ...]  # scene parameters and their values

BELOW = "below the reference's noise"


@dataclass(frozen=True)
class Measure:
    """A figure with its 95 % interval, or an upper bound. `note` says why a `value` of None is none."""

    value: float | None
    low: float | None = None
    high: float | None = None
    bound: bool = False
    note: str = ""

    @property
    def measured(self) -> bool:
        """Whether `value` is an estimate, neither missing nor a bound."""
        return self.value is not None and not self.bound


@dataclass(frozen=True)
class Point:
    """The replicates of one configuration. x: its position on the study's axis. place: that position in
    words.
    """

    x: float
    place: str
    spp: int
    cells: tuple[FinishedCell, ...]
    seconds: Interval
    scores: dict[str, Measure]
    rmse: Measure
    efficiency: Measure
    trusted: bool
    verdict: str

    @property
    def rays(self) -> tuple[int, int]:
        """Primary and shadow rays of one render, the mean over replicates."""
        counts = [cell.record.rays for cell in self.cells]
        return sum(c.primary for c in counts) // len(counts), sum(c.shadow for c in counts) // len(counts)

    @property
    def regions(self) -> dict[str, dict[str, Measure]]:
        """The measures of each region of the image, as `scores` has them for the whole."""
        cards = [cell.card.regions if cell.card else {} for cell in self.cells]
        refused = None if self.trusted else self.verdict
        names = list(dict.fromkeys(name for card in cards for name in card))
        return {
            name: measure_all([card[name].scores if name in card else None for card in cards], refused)
            for name in names
        }

    @property
    def state(self) -> str:
        """`ok`, `upper bound`, `no score` or `untrustworthy`: whether its RMSE is a number, and why not."""
        if not self.trusted:
            return "untrustworthy"
        if self.rmse.value is None:
            return "no score"
        return "upper bound" if self.rmse.bound else "ok"

    @property
    def doubted(self) -> int:
        """The number of untrustworthy replicates."""
        return sum(cell.record.statistics.verdict != "ok" for cell in self.cells)

    @property
    def worst(self) -> SampleStatistics:
        """The most doubtful replicate's statistics: untrustworthy before ok, then the lowest tail index."""
        return min((cell.record.statistics for cell in self.cells), key=_trust)


@dataclass(frozen=True)
class Series:
    """One line of a figure. label: its name in legends and tables, from the settings that vary."""

    estimator: str
    sampler: str
    label: str
    points: tuple[Point, ...]

    @property
    def measured(self) -> list[Point]:
        """The points whose RMSE is an estimate above zero. Only these enter a fit."""
        return [p for p in self.points if p.rmse.measured and (p.rmse.value or 0.0) > 0]

    def fitted_slope(self) -> Slope | None:
        """The slope of RMSE against render seconds over all measured points; None with fewer than two.

        Three points or more weigh the same, since intervals from a few replicates make poor weights.
        Their scatter about the line gives the error, which a departure from a power law widens.
        Two points have only their intervals.
        """
        points = self.measured
        return _fit(points, weigh=len(points) == 2)

    def last_slope(self) -> tuple[Slope, Point, Point] | None:
        """The slope between the last two measured points, and these points."""
        points = self.measured[-2:]
        slope = _fit(points, weigh=True)
        return (slope, points[0], points[1]) if slope else None

    def sample_slope(self) -> Slope | None:
        """The slope of RMSE against spp, free of an image's fixed costs; None with fewer than two points."""
        points = self.measured
        if len({p.spp for p in points}) < 2:
            return None
        return fit_slope([float(p.spp) for p in points], [p.rmse.value or 0.0 for p in points])


@dataclass(frozen=True)
class Panel:
    """One figure of a study: one scene, where only the axis `over`, the estimator and the sampler vary.

    fixed: this panel's values of the other parameters that the study varies. baseline: the rasterised image,
    which is biased and stands outside every comparison.
    """

    study: Study
    scene: str
    fixed: Settings
    series: tuple[Series, ...]
    baseline: Point | None = None

    @property
    def constants(self) -> Settings:
        """The parameters to which the whole study gives one value."""
        given = self.study.axes.parameters.items()
        return tuple((name, values[0]) for name, values in given if len(values) == 1)

    @property
    def cells(self) -> list[FinishedCell]:
        """Every cell of the panel, in the order of the sweep."""
        return [cell for series in self.series for point in self.ordered(series) for cell in point.cells]

    def ordered(self, series: Series) -> list[Point]:
        """The points of a series in the order of the sweep, which may lead a parameter from easy to hard."""
        axes = self.study.axes
        given = axes.spp if self.study.over == "spp" else axes.parameters[self.study.over]
        return sorted(series.points, key=lambda point: [float(x) for x in given].index(point.x))


@dataclass(frozen=True)
class StudyView:
    """A study as the report shows it."""

    study: Study
    panels: tuple[Panel, ...]
    missing: tuple[CellEntry, ...]
    unscored: tuple[CellEntry, ...]
    left_out: tuple[LeftOut, ...]


def select_studies(run: Run) -> list[StudyView]:
    """Every study of a run in the order of its sweep."""
    pairs = zip(run.studies, run.manifest.studies, strict=True)
    return [_view(finished, entry) for finished, entry in pairs]


def measure_all(cards: Cards, refused: str | None) -> dict[str, Measure]:
    """Every metric's measure over the replicates. refused: the reason to give no number, or None."""
    names = list(dict.fromkeys(name for card in cards if card for name in card))
    found = {name: _measure(name, cards, refused) for name in names}
    if not found.get("mse", Measure(None)).bound:
        return found
    # What judges no error holds no noise of the reference, or holds it in its interval.
    return {
        name: _bounded(name, measure) if METRICS[name].judges == "error" else measure
        for name, measure in found.items()
    }


def root_of(mse: Measure) -> Measure:
    """RMSE from MSE: the square root is monotonic, so that the ends of the interval go through it."""
    roots = [None if end is None else math.sqrt(max(end, 0.0)) for end in (mse.value, mse.low, mse.high)]
    return replace(mse, value=roots[0], low=roots[1], high=roots[2])


def wall_over_cpu(records: Iterable[Record]) -> list[float]:
    """Wall over CPU seconds of each render: 1 on an idle machine."""
    return [record.seconds.render / record.seconds.cpu for record in records if record.seconds.cpu > 0]


def varied(study: Study, job: Job) -> Settings:
    """A job's values of the parameters to which its study gives more than one."""
    return tuple((name, x) for name, x in job.parameters.items() if len(study.axes.parameters[name]) > 1)


def _view(finished: FinishedStudy, entry: StudyEntry) -> StudyView:
    study, there = finished.study, {cell.entry.key for cell in finished.cells}
    groups = _grouped(finished.cells, lambda c: (c.entry.job.scene, _fixed(study, c.entry.job)))
    return StudyView(
        study,
        tuple(_panel(study, scene, fixed, cells) for (scene, fixed), cells in groups.items()),
        tuple(cell for cell in entry.cells if cell.key not in there),
        tuple(cell.entry for cell in finished.cells if cell.card is None),
        finished.left_out,
    )


def _fixed(study: Study, job: Job) -> Settings:
    return tuple((name, value) for name, value in varied(study, job) if name != study.over)


def _panel(study: Study, scene: str, fixed: Settings, cells: Sequence[FinishedCell]) -> Panel:
    rasterised = [cell for cell in cells if cell.entry.job.estimator == study.baseline]
    groups = _grouped((c for c in cells if c not in rasterised), lambda c: _series_key(study, c.entry.job))
    series = [
        Series(estimator, sampler, _label(study, estimator, sampler, spp), _points(study, members))
        for (estimator, sampler, spp), members in sorted(groups.items(), key=lambda g: _rank(study, g[0]))
    ]
    return Panel(study, scene, fixed, tuple(series), _baseline(study, rasterised) if rasterised else None)


def _baseline(study: Study, cells: Sequence[FinishedCell]) -> Point:
    """The rasterised image without an efficiency: more time does not lower its error."""
    no_cost = Measure(None, note="biased: no time makes its error less")
    return replace(_point(study, 1.0, cells), place="rasterised", efficiency=no_cost)


def _label(study: Study, estimator: str, sampler: str, spp: int | None) -> str:
    parts = [estimator]
    if len(study.axes.sampler) > 1:
        parts.append(sampler)
    if spp is not None and len(study.axes.spp) > 1:
        parts.append(f"{spp} spp")
    return ", ".join(parts)


def _series_key(study: Study, job: Job) -> tuple[str, str, int | None]:
    return job.estimator, job.sampler, None if study.over == "spp" else job.spp


def _rank(study: Study, key: tuple[str, str, int | None]) -> tuple[int, int, int]:
    """The place of a series in the order of the sweep."""
    return study.axes.estimator.index(key[0]), study.axes.sampler.index(key[1]), key[2] or 0


def _points(study: Study, cells: Sequence[FinishedCell]) -> tuple[Point, ...]:
    groups = _grouped(cells, lambda cell: _position(study, cell.entry.job))
    return tuple(_point(study, x, groups[x]) for x in sorted(groups))


def _position(study: Study, job: Job) -> float:
    return float(job.spp) if study.over == "spp" else job.parameters[study.over]


def _point(study: Study, x: float, cells: Sequence[FinishedCell]) -> Point:
    spp = cells[0].entry.job.spp
    seconds = mean_interval([cell.record.seconds.render for cell in cells])
    verdict = _verdict(cells)
    scores = measure_all([cell.card.scores if cell.card else None for cell in cells], verdict)
    mse = scores.get("mse", Measure(None, note="no MSE was scored; `penumbra run` scores it"))
    return Point(
        x,
        f"{spp:,} spp" if study.over == "spp" else f"{study.over} = {x:g}, {spp:,} spp",
        spp,
        tuple(cells),
        seconds,
        scores,
        root_of(mse),
        _efficiency(mse, seconds),
        verdict is None,
        verdict or "ok",
    )


def _trust(found: SampleStatistics) -> tuple[bool, float]:
    return found.verdict == "ok", math.inf if found.hill is None else found.hill


def _verdict(cells: Sequence[FinishedCell]) -> str | None:
    """The reason to distrust the replicates, None if all are ok."""
    doubted = [cell.record.statistics for cell in cells if cell.record.statistics.verdict != "ok"]
    return f"untrustworthy, {len(doubted)} of {len(cells)}: {doubted[0].reason}" if doubted else None


def _grouped(items: Iterable[T], key: Callable[[T], K]) -> dict[K, list[T]]:
    groups: dict[K, list[T]] = {}
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return groups


def _bounded(name: str, found: Measure) -> Measure:
    """The safe end of an interval as a bound, for a figure that is mostly the reference's noise."""
    if found.value is None or found.bound:
        return found
    end = found.low if METRICS[name].better == "higher" else found.high
    value = found.value if end is None or math.isnan(end) else end
    return replace(found, value=value, bound=True, note=BELOW)


def _measure(name: str, cards: Cards, refused: str | None) -> Measure:
    """The mean over replicates with its interval; no number where one replicate has none.

    A single replicate brings its own interval.
    """
    scores = [card[name] for card in cards if card and name in card]
    values = [score.value for score in scores if score.value is not None]
    if refused is not None:
        return Measure(None, note=refused)
    if len(scores) < len(cards):
        return Measure(None, note=f"{len(cards) - len(scores)} of {len(cards)} replicates are not scored")
    if METRICS[name].squares:
        mse = replicate_mse(scores)
        return Measure(mse.value, mse.low, mse.high, mse.bound, mse.note)
    if len(values) < len(scores):
        return Measure(None, note=next(score.note for score in scores if score.value is None))
    bound = any(score.bound for score in scores)
    if len(scores) == 1:
        return Measure(values[0], scores[0].low, scores[0].high, bound)
    mean = replicate_interval(values)
    return Measure(mean.value, mean.low, mean.high, bound)


def _efficiency(mse: Measure, seconds: Interval) -> Measure:
    """1 / (MSE x seconds). An upper bound of the MSE gives none: a lower bound compares with nothing."""
    if mse.value is None or mse.low is None or mse.high is None:
        return Measure(None, note=mse.note)
    if mse.bound or mse.value <= 0:
        return Measure(None, note=mse.note or "the error is below the reference's noise")
    found = efficiency(Interval(mse.value, mse.low, mse.high), seconds)
    return Measure(found.value, found.low, found.high)


def _fit(points: Sequence[Point], weigh: bool) -> Slope | None:
    if len(points) < 2 or len({p.seconds.value for p in points}) < 2:
        return None
    x, y = [p.seconds.value for p in points], [p.rmse.value or 0.0 for p in points]
    ends = [(p.rmse.low or 0.0, p.rmse.high or 0.0) for p in points]
    if weigh and all(0 < low < high for low, high in ends):
        return fit_slope(x, y, [low for low, _ in ends], [high for _, high in ends])
    return fit_slope(x, y)
