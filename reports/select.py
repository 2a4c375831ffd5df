"""From a run folder to tidy series: which points a figure has, with what intervals, and what may be said of each.

The rule of the house is kept here and nowhere else: an untrustworthy cell has no number, a cell below the
reference's noise has an upper bound, everything else has a value with a 95 % interval over its replicate seeds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from pipeline.manifest import CellEntry, LeftOut, StudyEntry
from pipeline.record import Job, Record, ReferenceInfo, SampleStatistics, Score
from pipeline.statistics.intervals import Interval, efficiency, mean_interval, replicate_mse
from pipeline.store import FinishedCell, FinishedStudy, Run
from pipeline.sweep import Study

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)
Settings = tuple[tuple[str, float], ...]  # scene parameters and their values
SQUARED = ("mse", "relmse")  # means of squares: noise of the reference is subtracted from them, and may drown them


@dataclass(frozen=True)
class Measure:
    """A figure with its 95 % interval; bound: an upper bound. value None: there is no number to show, `note` says why."""

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
    """The replicates of one configuration. x: where it stands on the study's axis, spp or a parameter; place: that in words."""

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
    def doubted(self) -> int:
        """How many replicates are untrustworthy."""
        return sum(cell.record.statistics.verdict != "ok" for cell in self.cells)

    @property
    def worst(self) -> SampleStatistics:
        """What the samples of the most doubtful replicate say: untrustworthy before ok, then by the lowest tail index."""
        return min((cell.record.statistics for cell in self.cells), key=_trust)


@dataclass(frozen=True)
class Series:
    """One line of a figure. label: what legends and tables call it, naming only what the study varies."""

    estimator: str
    sampler: str
    label: str
    points: tuple[Point, ...]


@dataclass(frozen=True)
class Panel:
    """One figure's worth of a study: one scene, all held fixed but the axis `over` and what tells the series apart.

    fixed: this panel's values of the other parameters that the study varies.
    """

    study: Study
    scene: str
    fixed: Settings
    series: tuple[Series, ...]

    @property
    def constants(self) -> Settings:
        """The parameters to which the whole study gives one value."""
        return tuple((name, values[0]) for name, values in self.study.axes.parameters.items() if len(values) == 1)

    @property
    def cells(self) -> list[FinishedCell]:
        """Every cell of the panel, in the order of the sweep."""
        return [cell for series in self.series for point in self.ordered(series) for cell in point.cells]

    def ordered(self, series: Series) -> list[Point]:
        """The points of a series as the sweep names them, a parameter from easy to hard where it does so."""
        study = self.study
        given = [float(x) for x in (study.axes.spp if study.over == "spp" else study.axes.parameters[study.over])]
        return sorted(series.points, key=lambda point: given.index(point.x))

    @property
    def references(self) -> list[ReferenceInfo]:
        """The references that its cells were scored against, each once."""
        return _distinct(cell.card.reference for cell in self.cells if cell.card)


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


def _view(finished: FinishedStudy, entry: StudyEntry) -> StudyView:
    there = {cell.entry.key for cell in finished.cells}
    groups = _grouped(finished.cells, lambda cell: (cell.entry.job.scene, _fixed(finished.study, cell.entry.job)))
    return StudyView(
        finished.study,
        tuple(_panel(finished.study, scene, fixed, cells) for (scene, fixed), cells in groups.items()),
        tuple(cell for cell in entry.cells if cell.key not in there),
        tuple(cell.entry for cell in finished.cells if cell.card is None),
        finished.left_out,
    )


def wall_over_cpu(records: Iterable[Record]) -> list[float]:
    """Wall over CPU seconds of each render: 1 on a machine with nothing else to do."""
    return [record.seconds.render / record.seconds.cpu for record in records if record.seconds.cpu > 0]


def varied(study: Study, job: Job) -> Settings:
    """A job's values of the parameters to which its study gives more than one."""
    return tuple((name, value) for name, value in job.parameters.items() if len(study.axes.parameters[name]) > 1)


def _fixed(study: Study, job: Job) -> Settings:
    return tuple((name, value) for name, value in varied(study, job) if name != study.over)


def _panel(study: Study, scene: str, fixed: Settings, cells: Sequence[FinishedCell]) -> Panel:
    groups = _grouped(cells, lambda cell: _series_key(study, cell.entry.job))
    series = [
        Series(estimator, sampler, _label(study, estimator, sampler, spp), _points(study, members))
        for (estimator, sampler, spp), members in sorted(groups.items(), key=lambda item: _declared(study, item[0]))
    ]
    return Panel(study, scene, fixed, tuple(series))


def _label(study: Study, estimator: str, sampler: str, spp: int | None) -> str:
    parts = [estimator]
    if len(study.axes.sampler) > 1:
        parts.append(sampler)
    if spp is not None and len(study.axes.spp) > 1:
        parts.append(f"{spp} spp")
    return ", ".join(parts)


def _series_key(study: Study, job: Job) -> tuple[str, str, int | None]:
    return job.estimator, job.sampler, None if study.over == "spp" else job.spp


def _declared(study: Study, key: tuple[str, str, int | None]) -> tuple[int, int, int]:
    """The order in which the sweep names them."""
    return study.axes.estimator.index(key[0]), study.axes.sampler.index(key[1]), key[2] or 0


def _points(study: Study, cells: Sequence[FinishedCell]) -> tuple[Point, ...]:
    groups = _grouped(cells, lambda cell: position(study, cell.entry.job))
    return tuple(_point(study, x, groups[x]) for x in sorted(groups))


def position(study: Study, job: Job) -> float:
    """Where a job stands on its study's axis."""
    return float(job.spp) if study.over == "spp" else job.parameters[study.over]


def _point(study: Study, x: float, cells: Sequence[FinishedCell]) -> Point:
    spp = cells[0].entry.job.spp
    seconds = mean_interval([cell.record.seconds.render for cell in cells])
    trusted, verdict = _verdict(cells)
    scores = {name: _score(name, cells, None if trusted else verdict) for name in _metrics(cells)}
    mse = scores.get("mse", Measure(None, note="no mse was scored"))
    return Point(
        x,
        f"{spp:,} spp" if study.over == "spp" else f"{study.over} = {x:g}, {spp:,} spp",
        spp,
        tuple(cells),
        seconds,
        scores,
        _root(mse),
        _efficiency(mse, seconds),
        trusted,
        verdict,
    )


def _trust(found: SampleStatistics) -> tuple[bool, float]:
    return found.verdict == "ok", math.inf if found.hill is None else found.hill


def _verdict(cells: Sequence[FinishedCell]) -> tuple[bool, str]:
    """Whether every replicate's samples may be believed, and if not, the worst of what they say."""
    doubted = [cell.record.statistics for cell in cells if cell.record.statistics.verdict != "ok"]
    if not doubted:
        return True, "ok"
    return False, f"untrustworthy, {len(doubted)} of {len(cells)}: {doubted[0].reason}"


def _metrics(cells: Sequence[FinishedCell]) -> list[str]:
    return _distinct(name for cell in cells if cell.card for name in cell.card.scores)


def _score(name: str, cells: Sequence[FinishedCell], refused: str | None) -> Measure:
    """The mean over replicates; without a number if the samples are not to be believed or a replicate has none."""
    if refused is not None:
        return Measure(None, note=refused)
    scores = [cell.card.scores[name] for cell in cells if cell.card and name in cell.card.scores]
    if len(scores) < len(cells):
        return Measure(None, note=f"{len(cells) - len(scores)} of {len(cells)} replicates are not scored")
    return _squared(scores) if name in SQUARED else _plain(scores)


def _squared(scores: Sequence[Score]) -> Measure:
    mean = replicate_mse(scores)
    return Measure(mean.value, mean.low, mean.high, mean.bound, mean.note)


def _plain(scores: Sequence[Score]) -> Measure:
    values = [score.value for score in scores if score.value is not None]
    if len(values) < len(scores):
        return Measure(None, note=next(score.note for score in scores if score.value is None))
    mean = mean_interval(values)
    return Measure(mean.value, mean.low, mean.high, any(score.bound for score in scores))


def _root(mse: Measure) -> Measure:
    """RMSE from MSE: the ends of the interval go through the square root, which is monotonic."""
    roots = [None if end is None else math.sqrt(max(end, 0.0)) for end in (mse.value, mse.low, mse.high)]
    return replace(mse, value=roots[0], low=roots[1], high=roots[2])


def _efficiency(mse: Measure, seconds: Interval) -> Measure:
    """1 / (MSE x seconds); where the MSE is an upper bound it is a lower bound, which has no place among numbers to compare."""
    if mse.value is None or mse.low is None or mse.high is None:
        return Measure(None, note=mse.note)
    if mse.bound or mse.value <= 0:
        return Measure(None, note=mse.note or "the error is below the reference's noise")
    found = efficiency(Interval(mse.value, mse.low, mse.high), seconds)
    return Measure(found.value, found.low, found.high)


def _grouped(items: Iterable[T], key: Callable[[T], K]) -> dict[K, list[T]]:
    groups: dict[K, list[T]] = {}
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return groups


def _distinct(items: Iterable[T]) -> list[T]:
    found: list[T] = []
    for item in items:
        if item not in found:
            found.append(item)
    return found
