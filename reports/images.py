"""The images that a panel shows: references, estimates and error maps, and their exposure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.schema.record import ScoreCard
from pipeline.store.run_folder import FinishedCell
from reports.formats import plain, sig
from reports.series import Panel, Point, Series
from reports.viewer import MAX_IMAGES, Picture
from scenes.images.exr import read_exr, read_rgb

Array = NDArray[np.float64]

PREFERRED_SPP = 16  # enough to know the scene, few enough to see the noise
MIDDLE = 0.22  # of white: the median of the lit pixels, whether or not lights are in view
WORST = 99.0  # percentile of the error maps at which their false colours end


@dataclass(frozen=True, eq=False)
class ImageSet:
    """Images of one size.

    exposure: in stops. about: their spp and seed in words. columns: how many stand side by side.
    """

    pictures: tuple[Picture, ...]
    exposure: float
    about: str
    columns: int

    @property
    def stills(self) -> list[Picture]:
        """The colour images, shown side by side; the error maps are in the viewer alone."""
        return [picture for picture in self.pictures if picture.limit is None]

    @property
    def has_maps(self) -> bool:
        """Whether some of the images are error maps."""
        return len(self.stills) < len(self.pictures)


@dataclass(frozen=True)
class _Scored:
    """One replicate of a point, with its scores."""

    series: Series
    point: Point
    cell: FinishedCell
    card: ScoreCard


def select_images(root: Path, panel: Panel) -> ImageSet | None:
    """The images of a panel from its run folder; None if no cell is scored."""
    return _samples_images(root, panel) if panel.study.over == "spp" else _parameter_images(root, panel)


@dataclass(frozen=True, eq=False)
class Extremes:
    """The pictures that make a panel's answer visible: reference, best, worst and the worst one's error.

    exposure: in stops, of all but the error. about: where they were taken.
    """

    pictures: tuple[Picture, ...]
    exposure: float
    about: str


def select_extremes(root: Path, panel: Panel) -> Extremes | None:
    """The best and the worst series at one place; None if no cell is scored.

    A series that cannot be trusted is worse than any with a number. A lone series is the best.
    """
    scored = _scored(panel.series)
    if not scored:
        return None
    place = _typical_spp(scored) if panel.study.over == "spp" else panel.ordered(scored[-1].series)[-1].x
    shown = sorted((s for s in scored if s.point.x == place), key=_badness)
    best, worst = shown[0], shown[-1]
    reference, error = _reference(root, worst), _error(root, worst)
    pictures = [Picture("reference", reference), Picture(f"best: {_told(best)}", _image(root, best))]
    if worst is not best:
        pictures.append(Picture(f"worst: {_told(worst)}", _image(root, worst)))
    if error is not None:
        limit = _percentile(error, WORST) or 1.0
        pictures.append(Picture(f"its error, white from {sig(limit)}", error, limit))
    about = f"{best.point.place}, seed {best.cell.entry.job.seed}"
    return Extremes(tuple(pictures), _exposure([reference]), about)


def _badness(shown: _Scored) -> tuple[bool, float]:
    value = shown.point.rmse.value
    return not shown.point.trusted, math.inf if value is None else value


def _told(shown: _Scored) -> str:
    """A series with its error."""
    found = shown.point.rmse
    if not shown.point.trusted or found.value is None:
        return f"{shown.series.label}, no number"
    return f"{shown.series.label}, RMSE {'< ' if found.bound else ''}{sig(found.value)}"


def _typical_spp(scored: Sequence[_Scored]) -> int:
    """The sample count nearest to PREFERRED_SPP."""
    return min((s.point.spp for s in scored), key=lambda n: abs(math.log2(n / PREFERRED_SPP)))


def _samples_images(root: Path, panel: Panel) -> ImageSet | None:
    """The reference, every series at one sample count, and their error maps."""
    scored = _scored(panel.series)
    if not scored:
        return None
    spp = _typical_spp(scored)
    shown = [s for s in scored if s.point.spp == spp][: (MAX_IMAGES - 1) // 2]
    reference = _reference(root, shown[0])
    images = [Picture(s.series.label, _image(root, s)) for s in shown]
    maps = _error_maps((f"error of {number}", _error(root, s)) for number, s in enumerate(shown, 2))
    about = f"{spp} samples a pixel, seed {shown[0].cell.entry.job.seed}"
    return ImageSet(
        (Picture("reference", reference), *images, *maps), _exposure([reference]), about, 1 + len(images)
    )


def _parameter_images(root: Path, panel: Panel) -> ImageSet | None:
    """The reference and the first two estimators, at both ends and in the middle of the axis.

    Images of another size than the first are left out.
    """
    series = list({s.estimator: s for s in reversed(panel.series)}.values())[::-1][:2]
    scored = _scored(series)
    if not scored:
        return None
    places = sorted({s.point.x for s in scored}, reverse=True)
    chosen = dict.fromkeys((places[0], places[len(places) // 2], places[-1]))
    rows = [_at(root, panel, [s for s in scored if s.point.x == x]) for x in chosen]
    pictures = [p for row in rows for p in row if p.pixels.shape == rows[0][0].pixels.shape]
    about = f"{scored[0].point.spp} samples a pixel, first seed"
    return ImageSet(tuple(pictures), _exposure([row[0].pixels for row in rows]), about, 1 + len(series))


def _at(root: Path, panel: Panel, shown: Sequence[_Scored]) -> list[Picture]:
    """The reference and the renders of one place on the axis."""
    where = f"{panel.study.over} {plain(shown[0].point.x)}"
    images = [Picture(f"{s.series.estimator}, {where}", _image(root, s)) for s in shown]
    return [Picture(f"reference, {where}", _reference(root, shown[0])), *images]


def _scored(series: Sequence[Series]) -> list[_Scored]:
    """The first replicate of every point that has a reference."""
    found: list[_Scored] = []
    for line in series:
        for point in line.points:
            cells = [(cell, cell.card) for cell in point.cells if cell.card]
            found += [_Scored(line, point, cell, card) for cell, card in cells[:1]]
    return found


def _image(root: Path, shown: _Scored) -> Array:
    return read_rgb(root / shown.cell.record.image)


def _reference(root: Path, shown: _Scored) -> Array:
    return read_rgb(root / shown.card.reference.image)


def _error(root: Path, shown: _Scored) -> Array | None:
    """Each pixel's root mean square error over the channels, from the map beside the scores."""
    if shown.card.error_map is None:
        return None
    channels = read_exr(root / shown.card.error_map).channels
    if "rmse" in channels:
        return channels["rmse"]
    return np.sqrt(np.maximum(channels["mse"], 0.0)) if "mse" in channels else None


def _error_maps(named: Iterable[tuple[str, Array | None]]) -> list[Picture]:
    """False-colour images on one scale."""
    maps = [(name, error) for name, error in named if error is not None]
    if not maps:
        return []
    limit = max(_percentile(error, WORST) for _, error in maps) or 1.0
    return [Picture(name, error, limit) for name, error in maps]


def _exposure(references: Sequence[Array]) -> float:
    """Stops, in halves, that bring the median of the references' lit pixels to a middle gray."""
    level = _percentile(
        np.concatenate([image.mean(axis=-1).reshape(-1) for image in references]), 50.0, above=0.0
    )
    return round(2.0 * math.log2(MIDDLE / level)) / 2.0 if level > 0 else 0.0


def _percentile(values: Array, share: float, above: float = -math.inf) -> float:
    """A percentile of the finite values above a limit; 0 without such values."""
    counted = values[np.isfinite(values) & (values > above)]
    return float(np.percentile(counted, share)) if counted.size else 0.0
