"""The tasks of a worker process: render a cell or score one, and store it.

A worker keeps scenes and references from one task to the next.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.baseline.entry import NAME as BASELINE
from pipeline.references.cache import STATE
from pipeline.run.job import PreparedScene, open_scene, run_job
from pipeline.run.rasterised import run_baseline
from pipeline.run.region_maps import region_map
from pipeline.schema.record import Job, Record, ReferenceInfo, RegionMap, ScoreCard
from pipeline.scoring.metric import Estimate, Reference
from pipeline.scoring.scores import score, score_regions
from pipeline.self_reference import judges_itself
from pipeline.store.run_folder import Store
from pipeline.studies.regions import Regions
from renderer import render
from renderer.film import Film
from renderer.interfaces.estimator import ESTIMATORS, RADIANCE
from renderer.interfaces.sampler import SAMPLERS
from renderer.math.vectors import Floats
from scenes.errors import PenumbraError
from scenes.images.exr import write_estimate_exr, write_exr

SCENES_KEPT = 16
REFERENCES_KEPT = 4


@dataclass(frozen=True)
class RenderTask:
    """A cell to render into the run folder `root`. scene: the file of the scene that the run saved."""

    root: Path
    key: str
    job: Job
    scene: Path


@dataclass(frozen=True)
class ScoreTask:
    """A rendered cell to score. reference: its folder in the cache of references."""

    root: Path
    key: str
    cell: str
    job: Job
    scene: Path
    metrics: tuple[str, ...]
    reference: Path
    info: ReferenceInfo


def render_cell(task: RenderTask) -> str:
    """Render a cell with one thread, after a warm-up, and store it. Returns its key."""
    job = task.job
    scene = _scene(task.scene)
    if job.estimator == BASELINE:
        record, film = run_baseline(job, scene)
        tail = np.zeros(0)
    else:
        _warm_up(task.scene, job.estimator, job.sampler)
        result = run_job(job, scene)
        record, film, tail = result.record, result.render.film, result.render.tail
    if record.key != task.key:
        raise PenumbraError("the renderer's sources changed while the run was at work; run it again")
    _store(Store(task.root), record, film, tail)
    return task.key


def _store(store: Store, record: Record, film: Film, tail: Floats) -> None:
    metadata = {"record": record.model_dump_json()}
    store.write_cell(
        record,
        lambda path: write_estimate_exr(path, film.mean, film.variance_of_mean(), film.count, metadata),
        {
            "count": film.count,
            "mean": film.mean,
            "m2": film.m2,
            "maximum": film.maximum,
            "tail": tail,
        },
    )


@functools.lru_cache(maxsize=SCENES_KEPT)
def _scene(path: Path) -> PreparedScene:
    """The scene, built once a worker, with the seconds that this took."""
    return open_scene(path)


@functools.cache
def _warm_up(scene: Path, estimator: str, sampler: str) -> None:
    """Render once, untimed: the first render pays for imports, page faults and look-up tables."""
    render(_scene(scene).built, estimator=estimator, sampler=sampler, spp=1, threads=1)


def score_cell(task: ScoreTask) -> str:
    """Score a cell by every metric of its study, whole and by region, and store the card with its maps.

    Returns its key.
    """
    why = judges_itself(task.info.backend, task.job.estimator)
    if why:
        raise PenumbraError(why)
    store = Store(task.root)
    described, regions = _regions(task)
    reference = _with_umbra(_reference(task.reference, task.info.batches), regions)
    measured = score(_estimate(store, task), reference, task.metrics)
    maps = {name: found.map for name, found in measured.items() if found.map is not None}
    card = ScoreCard(
        cell=task.cell,
        reference=task.info,
        scores={name: found.score for name, found in measured.items()},
        error_map=f"scores/{task.key}/error.exr" if maps else None,
        regions=score_regions(measured, regions.masks()) if regions else {},
        region_map=described,
    )
    store.write_score(task.key, card, (lambda path: write_exr(path, maps)) if maps else None)
    return task.key


def _estimate(store: Store, task: ScoreTask) -> Estimate:
    """The image of a cell with its samples' statistics; a baseline has none.

    The variance is known from two or more independent samples a pixel.
    """
    state = store.read_state(task.cell)
    if task.job.estimator == BASELINE:
        return Estimate(state["mean"])
    film = Film(state["count"], state["mean"], state["m2"], state["maximum"])
    known = task.job.spp > 1 and SAMPLERS[task.job.sampler].independent
    variance = film.variance_of_mean() if known else None
    return Estimate(film.mean, variance, film.count.astype(np.float64), film.maximum)


def _regions(task: ScoreTask) -> tuple[RegionMap | None, Regions | None]:
    """The regions of the cell's picture; none for a quantity other than light."""
    light = task.job.estimator == BASELINE or ESTIMATORS[task.job.estimator].quantity == RADIANCE
    if not light:
        return None, None
    return region_map(task.root, _scene(task.scene)) or (None, None)


def _with_umbra(reference: Reference, regions: Regions | None) -> Reference:
    """Set the umbra: the pixels that are dark both in the visibility pass and in the reference."""
    if regions is None or regions.dark.shape != reference.mean.shape[:2]:
        return reference
    return replace(reference, umbra=regions.dark & ~np.any(reference.mean != 0, axis=-1))


@functools.lru_cache(maxsize=REFERENCES_KEPT)
def _reference(folder: Path, batches: int) -> Reference:
    with np.load(folder / STATE, allow_pickle=False) as state:
        return Reference(state["mean"], state["variance"], batches)
