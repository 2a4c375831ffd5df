"""`penumbra width`: how wide the penumbrae of a run are, held against the closed form."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline.commands.options import AsJson, Quiet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipeline.schema.record import Job
    from pipeline.store.run_folder import FinishedCell
    from pipeline.studies.penumbra_width import Width

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

      penumbra run penumbra --out runs/penumbra && penumbra width runs/penumbra
    """
    from pipeline.commands.console import Speaker
    from pipeline.store.run_folder import load_run
    from scenes.errors import PenumbraError

    speaker = Speaker(as_json=as_json, quiet=quiet)
    cells = [cell for study in load_run(run).studies for cell in study.cells]
    groups: dict[Setting, dict[int, FinishedCell]] = {}
    for cell in cells:
        groups.setdefault(_setting(cell.entry.job), {})[cell.entry.job.seed] = cell
    if not groups:
        raise PenumbraError(f"{run}: the run has no finished images")
    rows: list[dict[str, Any]] = []
    with speaker.step("widths", len(groups)) as update:
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
    speaker.table(columns, [_cells(row) for row in rows])
    speaker.json(rows)


def _setting(job: Job) -> Setting:
    shown = {
        name: value for name, value in job.parameters.items() if name not in ("xresolution", "yresolution")
    }
    name = " ".join([job.scene, *(f"{name}={value:g}" for name, value in shown.items())])
    return name, job.estimator, job.sampler, job.spp


def _row(root: Path, setting: Setting, cells: Sequence[FinishedCell]) -> dict[str, Any]:
    """The widths of replicates, and that of their reference."""
    from pipeline.statistics.intervals import replicate_interval

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
    from pipeline.studies.penumbra_width import width_of
    from scenes import load
    from scenes.errors import PenumbraError, SceneError
    from scenes.images.exr import read_rgb

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
