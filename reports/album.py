"""Which pictures of a panel are shown: references, estimates, error maps; and how bright."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.store import FinishedCell
from reports.formats import plain
from reports.select import Panel, Point, Series
from reports.viewer import MAX_IMAGES, Picture
from scenes.images import read_exr, read_rgb

Array = NDArray[np.float64]

PREFERRED_SPP = 16  # enough to know the scene, few enough to see the noise
SHOWN = 0.8  # of white: where the brightest hundredth of a reference begins
WORST = 99.0  # percentile: where white is set, and where the false colours of error maps end


@dataclass(frozen=True, eq=False)
class Album:
    """Pictures of one size; `exposure` in stops; `about` says what they are; `columns`: how many stand side by side."""

    pictures: tuple[Picture, ...]
    exposure: float
    about: str
    columns: int

    @property
    def stills(self) -> list[Picture]:
        """The colour pictures, to be shown side by side."""
        return [picture for picture in self.pictures if picture.limit is None]

    @property
    def has_maps(self) -> bool:
        """Whether there are error maps."""
        return len(self.stills) < len(self.pictures)


def make_album(root: Path, panel: Panel) -> Album | None:
    """The pictures of a panel from its run folder; None where nothing was scored, so that there is no reference to show."""
    return _samples_album(root, panel) if panel.study.over == "spp" else _parameter_album(root, panel)


def _samples_album(root: Path, panel: Panel) -> Album | None:
    """The reference, then every series at one sample count, then the error maps of these."""
    shared = [{p.spp for p in series.points if _scored(p)} for series in panel.series]
    common = sorted(set[int]().union(*shared))
    if not common:
        return None
    spp = min(common, key=lambda n: abs(np.log2(n / PREFERRED_SPP)))
    cells = [(s, c) for s in panel.series for p in s.points if p.spp == spp for c in _scored(p)[:1]]
    cells = cells[: (MAX_IMAGES - 1) // 2]
    reference = _reference(root, cells[0][1])
    images = [Picture(s.label, read_rgb(root / c.record.image)) for s, c in cells]
    maps = _error_maps((f"error of {number}", _error(root, c)) for number, (_, c) in enumerate(cells, 2))
    seed = cells[0][1].entry.job.seed
    return Album(
        (Picture("reference", reference), *images, *maps),
        _exposure([reference]),
        f"{spp} samples a pixel, seed {seed}",
        1 + len(images),
    )


def _parameter_album(root: Path, panel: Panel) -> Album | None:
    """The reference and the first series of each estimator at both ends and in the middle of the axis."""
    series = list({s.estimator: s for s in reversed(panel.series)}.values())[::-1][:2]
    places = sorted({p.x for s in series for p in s.points if _scored(p)}, reverse=True)
    if not places:
        return None
    chosen = sorted({places[0], places[len(places) // 2], places[-1]}, reverse=True)
    pictures = [picture for x in chosen for picture in _at(root, panel, series, x)]
    references = [picture.pixels for picture in pictures if picture.name.startswith("reference")]
    spp = series[0].points[0].spp
    return Album(tuple(pictures), _exposure(references), f"{spp} samples a pixel, first seed", 1 + len(series))


def _at(root: Path, panel: Panel, series: Sequence[Series], x: float) -> list[Picture]:
    cells = [(s, c) for s in series for p in s.points if p.x == x for c in _scored(p)[:1]]
    where = f"{panel.study.over} {plain(x)}"
    images = [Picture(f"{s.estimator}, {where}", read_rgb(root / c.record.image)) for s, c in cells]
    return [Picture(f"reference, {where}", _reference(root, cells[0][1])), *images] if cells else []


def _scored(point: Point) -> list[FinishedCell]:
    return [cell for cell in point.cells if cell.card]


def _reference(root: Path, cell: FinishedCell) -> Array:
    assert cell.card is not None  # only scored cells come here
    return read_rgb(root / cell.card.reference.image)


def _error(root: Path, cell: FinishedCell) -> Array | None:
    """Each pixel's root mean square error over channels, from the map that was stored with the scores."""
    if cell.card is None or cell.card.error_map is None:
        return None
    channels = read_exr(root / cell.card.error_map).channels
    if "rmse" in channels:
        return channels["rmse"]
    return np.sqrt(np.maximum(channels["mse"], 0.0)) if "mse" in channels else None


def _error_maps(named: Iterable[tuple[str, Array | None]]) -> list[Picture]:
    """False-colour pictures on one scale, so that they can be compared."""
    maps = [(name, error) for name, error in named if error is not None]
    if not maps:
        return []
    limit = max(_percentile(error) for _, error in maps) or 1.0
    return [Picture(name, error, limit) for name, error in maps]


def _exposure(references: Sequence[Array]) -> float:
    """Stops, in halves, that bring the 99th percentile of the references to nearly white."""
    level = _percentile(np.concatenate([image.reshape(-1) for image in references]))
    return round(2.0 * math.log2(SHOWN / level)) / 2.0 if level > 0 else 0.0


def _percentile(values: Array) -> float:
    """The 99th percentile of the finite values, 0 if there are none."""
    finite = values[np.isfinite(values)]
    return float(np.percentile(finite, WORST)) if finite.size else 0.0
