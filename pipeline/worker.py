"""What a worker process does: render a cell, or score one, and store it. Scenes and references are kept between items."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.job import JobResult, PreparedScene, prepare, run_job
from pipeline.metrics.protocol import Estimate, Reference
from pipeline.record import Job, ReferenceInfo, ScoreCard
from pipeline.references.cache import STATE
from pipeline.scoring import score
from pipeline.store import Store
from renderer import render
from renderer.film import Film
from renderer.samplers.protocol import SAMPLERS
from scenes.errors import PenumbraError
from scenes.images import write_estimate_exr, write_exr

SCENES_KEPT = 16
REFERENCES_KEPT = 4


@dataclass(frozen=True)
class RenderTask:
    """A cell to render into the run folder `root`. scene_hash: what the scene was when the sweep was laid out."""

    root: Path
    key: str
    job: Job
    scene_hash: str


@dataclass(frozen=True)
class ScoreTask:
    """A rendered cell to score. reference: its folder in the cache of references."""

    root: Path
    key: str
    cell: str
    job: Job
    metrics: tuple[str, ...]
    reference: Path
    info: ReferenceInfo


def render_cell(task: RenderTask) -> str:
    """Render a cell, warmed up and with one thread, and store it. Returns its key."""
    job = task.job
    parameters = tuple(job.parameters.items())
    scene = _scene(job.scene, parameters, task.scene_hash)
    _warm_up(job.scene, parameters, task.scene_hash, job.estimator, job.sampler)
    result = run_job(job, scene)
    if result.record.key != task.key:
        raise PenumbraError("the renderer's sources changed while the run was at work; run it again")
    _store(Store(task.root), result)
    return task.key


def _store(store: Store, result: JobResult) -> None:
    record, film = result.record, result.render.film
    metadata = {"record": record.model_dump_json()}
    store.write_cell(
        record,
        lambda path: write_estimate_exr(path, film.mean, result.render.variance, film.count, metadata),
        {
            "count": film.count,
            "mean": film.mean,
            "m2": film.m2,
            "maximum": film.maximum,
            "tail": result.render.tail,
        },
    )


@functools.lru_cache(maxsize=SCENES_KEPT)
def _scene(name: str, parameters: tuple[tuple[str, float], ...], scene_hash: str) -> PreparedScene:
    """The scene, built once a worker; its record tells the seconds that this took, also where it is found here."""
    scene = prepare(name, dict(parameters))
    if scene.hash != scene_hash:
        raise PenumbraError(f"scene {name} changed while the run was at work; run it again")
    return scene


@functools.cache
def _warm_up(
    name: str, parameters: tuple[tuple[str, float], ...], scene_hash: str, estimator: str, sampler: str
) -> None:
    """Render once, untimed: the first render pays for imports, page faults and look-up tables."""
    render(_scene(name, parameters, scene_hash).built, estimator=estimator, sampler=sampler, spp=1, threads=1)


def score_cell(task: ScoreTask) -> str:
    """Score a cell by every metric of its study and store the card with its maps. Returns its key."""
    store = Store(task.root)
    measured = score(_estimate(store, task), _reference(task.reference, task.info.batches), task.metrics)
    maps = {name: found.map for name, found in measured.items() if found.map is not None}
    card = ScoreCard(
        cell=task.cell,
        reference=task.info,
        scores={name: found.score for name, found in measured.items()},
        error_map=f"scores/{task.key}/error.exr" if maps else None,
    )
    store.write_score(task.key, card, (lambda path: write_exr(path, maps)) if maps else None)
    return task.key


def _estimate(store: Store, task: ScoreTask) -> Estimate:
    """The image; its variance only where the samples tell it: two or more of a sampler whose samples are independent."""
    state = store.read_state(task.cell)
    film = Film(state["count"], state["mean"], state["m2"], state["maximum"])
    known = SAMPLERS[task.job.sampler].independent and task.job.spp > 1
    return Estimate(film.mean, film.variance_of_mean() if known else None)


@functools.lru_cache(maxsize=REFERENCES_KEPT)
def _reference(folder: Path, batches: int) -> Reference:
    with np.load(folder / STATE, allow_pickle=False) as state:
        return Reference(state["mean"], state["variance"], batches)
