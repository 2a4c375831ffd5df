"""From a run folder to tidy series: which points a figure has, with what intervals, and what may be said of
each.

The rule of the house is kept here and nowhere else: an untrustworthy cell has no number, a cell below the
reference's noise has an upper bound, everything else has a value with a 95 % interval over its replicate
seeds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from pipeline.schema.manifest import CellEntry, LeftOut, StudyEntry
from pipeline.schema.record import Job, Record, ReferenceInfo, SampleStatistics
from pipeline.schema.sweep import Study
from pipeline.statistics.intervals import Interval, mean_interval
from pipeline.store.run_folder import FinishedCell, FinishedStudy, Run
from reports.measures import Measure, efficiency_of, measure_all, root_of

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)
Settings = tuple[tuple[str, float], ...]  # scene parameters and their values


@dataclass(frozen=True)
class Point:
    """The replicates of one configuration. x: where it stands on the study's axis, spp or a parameter; place:
    that in words.
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
        """Region of the picture to metric to measure, as `scores` is for the whole."""
        cards = [cell.card.regions if cell.card else {} for cell in self.cells]
        refused = None if self.trusted else self.verdict
        names = list(dict.fromkeys(name for card in cards for name in card))
        return {
            name: measure_all([card[name].scores if name in card else None for card in cards], refused)
            for name in names
        }

    @property
    def doubted(self) -> int:
        """How many replicates are untrustworthy."""
        return sum(cell.record.statistics.verdict != "ok" for cell in self.cells)

    @property
    def worst(self) -> SampleStatistics:
        """What the samples of the most doubtful replicate say: untrustworthy before ok, then by the lowest
        tail index.
        """
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
    """One figure's worth of a study: one scene, all held fixed but the axis `over` and what tells the series
    apart.

    fixed: this panel's values of the other parameters that the study varies. baseline: the rasterised
    picture, biased and no part of the comparison.
    """

    study: Study
    scene: str
    fixed: Settings
    series: tuple[Series, ...]
    baseline: Point | None = None

    @property
    def constants(self) -> Settings:
        """The parameters to which the whole study gives one value."""
        return tuple(
            (name, values[0]) for name, values in self.study.axes.parameters.items() if len(values) == 1
        )

    @property
    def cells(self) -> list[FinishedCell]:
        """Every cell of the panel, in the order of the sweep."""
        return [cell for series in self.series for point in self.ordered(series) for cell in point.cells]

    def ordered(self, series: Series) -> list[Point]:
        """The points of a series as the sweep names them, a parameter from easy to hard where it does so."""
        study = self.study
        given = [
            float(x) for x in (study.axes.spp if study.over == "spp" else study.axes.parameters[study.over])
        ]
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
    groups = _grouped(
        finished.cells, lambda cell: (cell.entry.job.scene, _fixed(finished.study, cell.entry.job))
    )
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
    return tuple(
        (name, value) for name, value in job.parameters.items() if len(study.axes.parameters[name]) > 1
    )


def _fixed(study: Study, job: Job) -> Settings:
    return tuple((name, value) for name, value in varied(study, job) if name != study.over)


def _panel(study: Study, scene: str, fixed: Settings, cells: Sequence[FinishedCell]) -> Panel:
    drawn = [cell for cell in cells if cell.entry.job.estimator == study.baseline]
    groups = _grouped((c for c in cells if c not in drawn), lambda cell: _series_key(study, cell.entry.job))
    series = [
        Series(estimator, sampler, _label(study, estimator, sampler, spp), _points(study, members))
        for (estimator, sampler, spp), members in sorted(
            groups.items(), key=lambda item: _declared(study, item[0])
        )
    ]
    return Panel(study, scene, fixed, tuple(series), _baseline(study, drawn) if drawn else None)


def _baseline(study: Study, cells: Sequence[FinishedCell]) -> Point:
    """No time makes its error less, so that it has no efficiency."""
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
    scores = measure_all(
        [cell.card.scores if cell.card else None for cell in cells], None if trusted else verdict
    )
    mse = scores.get("mse", Measure(None, note="no mse was scored"))
    return Point(
        x,
        f"{spp:,} spp" if study.over == "spp" else f"{study.over} = {x:g}, {spp:,} spp",
        spp,
        tuple(cells),
        seconds,
        scores,
        root_of(mse),
        efficiency_of(mse, seconds),
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
