"""The widths of a run's penumbrae of straight edges, against the closed form.

    python examples/penumbra_width.py runs/penumbra

The visible fraction of the light, V, is the image over the radiance of the same point without the sheet
(Lambert's formula). It runs from 0 to 1 across the shadow; the width is the distance on the floor from where
V is 5 % to where it is 95 %. An image gives V at each of its pixels on the floor, noisy; the rising curve
through them is the isotonic least-squares fit [barlow1972].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from pipeline.console.command import script
from pipeline.console.console import Console
from pipeline.console.options import AsJson, Quiet
from pipeline.references.closed_form.edge_image import floor_points, irradiance, unshadowed
from pipeline.references.closed_form.edge_scene import EdgeScene, analyse_edge
from pipeline.references.closed_form.film import film_plane
from pipeline.schema.record import Job
from pipeline.statistics.intervals import replicate_interval
from pipeline.store.run_folder import FinishedCell, load_run
from scenes import load
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError, SceneError
from scenes.images.exr import read_rgb

Array = NDArray[np.float64]

LEVELS = (0.05, 0.95)
ROUND = 9  # digits: places that differ by less are one row
STEPS = 60  # halvings of an interval that holds a level: down to rounding


@dataclass(frozen=True)
class Width:
    """Widths on the floor, in scene units. measured: in the image; exact: of the closed form.

    similar_triangles: of the whole penumbra, from no light to all. pixel: the spacing of rows.
    """

    measured: float
    exact: float
    similar_triangles: float
    pixel: float

    @property
    def error(self) -> float:
        """The error of the measured width, relative to the exact one."""
        return self.measured / self.exact - 1.0


def width_of(image: Array, scene: SceneDescription) -> Width:
    """The width in an image (h, w, 3) of a scene that `closed-form-edge` supports.

    PenumbraError if the penumbra is not in view. A penumbra narrower than a few rows measures too wide.
    """
    edge = analyse_edge(scene)
    film = film_plane(scene.camera, scene.film)
    pixels, points = floor_points(edge, film)
    away = -(edge.blocked - edge.blocked @ edge.floor_plane.normal * edge.floor_plane.normal)
    s = (points - edge.edge[0]) @ away
    bare = unshadowed(edge, points) * float((edge.floor.reflectance * edge.radiance).sum()) / np.pi
    visible = image.reshape(-1, 3).sum(axis=1)[pixels] / bare
    rows, curve = _profile(s, visible)
    low, high = (_crossing(rows, curve, level) for level in LEVELS)
    ends = [_exact(edge, points[int(np.argmin(np.abs(s)))], away, level) for level in LEVELS]
    spacing = np.diff(rows)[
        np.abs(rows[1:] - (low + high) / 2) <= max(high - low, float(np.diff(rows).max()))
    ]
    pixel = float(np.median(spacing))
    return Width(high - low, ends[1] - ends[0], _similar(edge, away), pixel)


def _profile(s: Array, visible: Array) -> tuple[Array, Array]:
    """The rising curve through the pixels' values: places (k,), ascending, and values (k,).

    Where the camera stands across the edge, all pixels of a row are at one place: they are averaged first, so
    that a level is not crossed within a row.
    """
    places, row, count = np.unique(np.round(s, ROUND), return_inverse=True, return_counts=True)
    mean = np.bincount(row.reshape(-1), visible, places.size) / count
    fit: Any = isotonic_regression(mean, weights=count.astype(np.float64))
    return places.astype(np.float64), np.asarray(fit.x, dtype=np.float64)


def _crossing(s: Array, curve: Array, level: float) -> float:
    """The place where a rising curve first reaches a level, interpolated between two of its points."""
    if not curve[0] < level < curve[-1]:
        raise PenumbraError(
            f"the penumbra is not wholly in view: the light is nowhere {level:.0%} visible on the floor"
        )
    after = int(np.argmax(curve >= level))
    share = (level - curve[after - 1]) / (curve[after] - curve[after - 1])
    return float(s[after - 1] + share * (s[after] - s[after - 1]))


def _exact(edge: EdgeScene, point: Array, away: Array, level: float) -> float:
    """The place of visible fraction `level` on the line through a point (3,) across the shadow."""
    base = point - (point - edge.edge[0]) @ away * away
    low, high = (sign * _reach(edge, away) for sign in (-1.0, 1.0))
    for _ in range(STEPS):
        middle = (low + high) / 2
        p = (base + middle * away)[None]
        if irradiance(edge, edge.floor_plane, p)[0] < level * unshadowed(edge, p)[0]:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _ends(edge: EdgeScene, away: Array) -> Array:
    """Places (v,) on the floor, along `away`, from which the edge just touches each corner of the light."""
    height = float(edge.floor_plane.height(edge.edge[0]))
    corners = edge.light.outline - edge.edge[0]
    return -(corners @ away) * height / (corners @ edge.floor_plane.normal)


def _similar(edge: EdgeScene, away: Array) -> float:
    return float(np.ptp(_ends(edge, away)))


def _reach(edge: EdgeScene, away: Array) -> float:
    """A distance along `away` that reaches beyond the penumbra on either side."""
    return 1.01 * float(np.abs(_ends(edge, away)).max())


Setting = tuple[str, str, str, int]  # the scene with its parameters, estimator, sampler, samples a pixel
FEW = 5.0  # pixels: what is narrower is measured too wide, by any image


def width(
    run: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of a run, finished or not.")],
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Measure the penumbra's width, from 5 % to 95 % of the light seen, in each image of a run and in its
    reference.

    For scenes that the reference closed-form-edge takes: a straight edge before a flat light over a floor.
    Lengths are those on the floor, in scene units; `triangles` is the whole penumbra by similar triangles, a
    little more than 1/0.9 of the exact width.

    Examples:

      penumbra run penumbra --out runs/penumbra && python examples/penumbra_width.py runs/penumbra
    """
    console = Console(as_json=as_json, quiet=quiet)
    cells = [cell for study in load_run(run).studies for cell in study.cells]
    groups: dict[Setting, dict[int, FinishedCell]] = {}
    for cell in cells:
        groups.setdefault(_setting(cell.entry.job), {})[cell.entry.job.seed] = cell
    if not groups:
        raise PenumbraError(f"{run}: the run has no finished images")
    rows: list[dict[str, Any]] = []
    with console.step("widths", len(groups)) as update:
        for number, (setting, seeds) in enumerate(groups.items(), start=1):
            rows.append(_row(run, setting, list(seeds.values())))
            update(number)
    columns = (
        "scene",
        "estimator",
        "sampler",
        "spp",
        "images",
        "width (95 %)",
        "reference",
        "exact",
        "triangles",
        "",
    )
    console.table(columns, [_cells(row) for row in rows])
    console.json(rows)


def _setting(job: Job) -> Setting:
    shown = {
        name: value for name, value in job.parameters.items() if name not in ("xresolution", "yresolution")
    }
    name = " ".join([job.scene, *(f"{name}={value:g}" for name, value in shown.items())])
    return name, job.estimator, job.sampler, job.spp


def _row(root: Path, setting: Setting, cells: Sequence[FinishedCell]) -> dict[str, Any]:
    """The widths of replicates, and that of their reference."""
    widths = [_width(root, cell, cell.record.image) for cell in cells]
    scored = [cell for cell in cells if cell.card is not None and cell.card.reference.image]
    reference = next(
        (_width(root, cell, cell.card.reference.image).measured for cell in scored if cell.card), None
    )
    found = replicate_interval([item.measured for item in widths])
    name, estimator, sampler, spp = setting
    return {
        "scene": name,
        "estimator": estimator,
        "sampler": sampler,
        "spp": spp,
        "images": len(cells),
        "width": {"value": found.value, "low": found.low, "high": found.high},
        "reference": reference,
        "exact": widths[0].exact,
        "similar_triangles": widths[0].similar_triangles,
        "pixels": widths[0].exact / widths[0].pixel,
    }


def _width(root: Path, cell: FinishedCell, image: str) -> Width:
    """The width in one image of the run; PenumbraError where the scene is another now, or is no straight
    edge.
    """
    job = cell.entry.job
    scene = load(job.scene, job.parameters)
    if scene.content_hash() != cell.record.scene_hash:
        raise PenumbraError(f"scene {job.scene} has changed since this run: run it again")
    try:
        return width_of(read_rgb(root / image), scene)
    except SceneError as error:
        raise PenumbraError(f"scene {job.scene}: {error}") from error


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    found, reference = row["width"], row["reference"]
    return (
        row["scene"],
        row["estimator"],
        row["sampler"],
        str(row["spp"]),
        str(row["images"]),
        f"{found['value']:.3f} ({found['low']:.3f} to {found['high']:.3f})",
        "-" if reference is None else f"{reference:.3f}",
        f"{row['exact']:.3f}",
        f"{row['similar_triangles']:.3f}",
        f"only {row['pixels']:.1f} pixels wide" if row["pixels"] < FEW else "",
    )


if __name__ == "__main__":
    script(width)
