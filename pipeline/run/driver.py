"""A run makes references, then cells, then scores, and keeps all that is already in its folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from pipeline.backends import BACKENDS
from pipeline.progress import Progress
from pipeline.references.cache import StoredReference, key_for, reference_for, to_info
from pipeline.references.protocol import ReferenceRequest
from pipeline.run.executors.protocol import Executor
from pipeline.run.grid import Cell, SceneVariant, StudyPlan, describe, fair_order, lay_out
from pipeline.run.job import save_scene
from pipeline.run.worker import RenderTask, ScoreTask, render_cell, score_cell
from pipeline.schema.manifest import CellEntry, LeftOut, Manifest, StudyEntry, replaces
from pipeline.schema.record import Job
from pipeline.schema.sweep import Sweep
from pipeline.scoring.metric import METRICS
from pipeline.store.keys import metrics_fingerprint, score_key
from pipeline.store.provenance import provenance
from pipeline.store.run_folder import DamagedEntryError, Store, create_store
from scenes.errors import PenumbraError

T = TypeVar("T", RenderTask, ScoreTask)
REFERENCES = "references"
SCENES = "scenes"


@dataclass(frozen=True)
class Summary:
    """The outcome of a run. made: the numbers of new references, cells and scores. failures: in words."""

    cells: int
    made: dict[str, int]
    left_out: tuple[LeftOut, ...]
    failures: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RunContext:
    """The parts of a run that all its steps share."""

    name: str
    sweep: Sweep
    plans: Sequence[StudyPlan]
    store: Store
    executor: Executor
    progress: Progress
    requests: Mapping[str, ReferenceRequest]
    failures: list[str] = field(default_factory=list[str])


def run_sweep(name: str, sweep: Sweep, root: Path, executor: Executor, progress: Progress) -> Summary:
    """Run a sweep in the folder `root`, and keep all that is already there.

    name: of the sweep, for messages and the manifest. A cell that fails is listed in the summary and does not
    stop the others. PenumbraError if a scene cannot be read, before anything is written; if the folder cannot
    be written, holds another sweep's run, or is in use by another run; or if a reference cannot be made.
    """
    plans = lay_out(sweep, name)
    store = create_store(root)
    left_out = tuple(item for plan in plans for item in plan.left_out)
    for item in left_out:
        progress.note(describe(item))
    context = RunContext(name, sweep, plans, store, executor, progress, _requests(plans))
    with store.locked():
        manifest = _manifest(context)
        _check_folder(store, manifest)
        store.write_manifest(manifest)
        _hand_on(context)
        references = _references(context)
        cells = _cells(context)
        scores = _scores(context, references)
    fresh = sum(stored.fresh for stored in references.values())
    keys = {cell.key for plan in plans for cell in plan.cells}
    made = {"references": fresh, "cells": cells, "scores": scores}
    return Summary(len(keys), made, left_out, tuple(context.failures))


def _manifest(context: RunContext) -> Manifest:
    studies = [
        StudyEntry(
            name=plan.study.name,
            cells=[
                CellEntry(key=cell.key, job=cell.job, score=_score_key(context, plan, cell))
                for cell in plan.cells
            ],
            left_out=list(plan.left_out),
        )
        for plan in context.plans
    ]
    return Manifest(name=context.name, sweep=context.sweep, studies=studies, provenance=provenance())


def _reference_key(plan: StudyPlan, variant: SceneVariant) -> str:
    backend = plan.study.reference.backend
    return key_for(variant.hash, backend, _version(backend), plan.request)


@cache
def _version(backend: str) -> str:
    return BACKENDS[backend].version()


def _requests(plans: Sequence[StudyPlan]) -> dict[str, ReferenceRequest]:
    """The request for each reference, by key: the largest of any study, so that all studies share one
    image.
    """
    requests: dict[str, ReferenceRequest] = {}
    for plan in plans:
        for key in {_reference_key(plan, variant) for variant in plan.variants}:
            one, other = plan.request, requests.get(key, plan.request)
            requests[key] = replace(one, spp=max(one.spp, other.spp), batches=max(one.batches, other.batches))
    return requests


def _check_folder(store: Store, manifest: Manifest) -> None:
    """Raise PenumbraError if `manifest` would replace one that names other cells."""
    try:
        lost = replaces(store.read_manifest(), manifest)
    except PenumbraError:  # none yet, or of a version whose cells this one could not read anyway
        return
    if lost:
        raise PenumbraError(f"{store.root}: {lost}; name another folder")


def _score_key(context: RunContext, plan: StudyPlan, cell: Cell) -> str:
    """The content address of a cell's scores: it depends on image, reference, metrics and their code."""
    reference = _reference_key(plan, cell.variant)
    wanted = context.requests[reference]
    metrics = plan.study.scored
    code = "".join([metrics_fingerprint(), *map(METRICS.code, metrics)])
    return score_key(cell.key, reference, wanted, metrics, code)


def _scene_file(store: Store, scene_hash: str) -> Path:
    return store.scratch / SCENES / scene_hash


def _hand_on(context: RunContext) -> None:
    """Save every scene, which was read once, for the workers."""
    for variant in {v.hash: v for plan in context.plans for v in plan.variants}.values():
        save_scene(_scene_file(context.store, variant.hash), variant.read)


def _references(context: RunContext) -> dict[str, StoredReference]:
    """Make the sweep's distinct references one after the other, each on the whole machine; returns them
    by key.
    """
    wanted = {_reference_key(plan, v): (plan, v) for plan in context.plans for v in plan.variants}
    made: dict[str, StoredReference] = {}
    with context.progress.step("references", len(wanted)) as update:
        for key, (plan, variant) in wanted.items():
            done = len(made)
            made[key] = reference_for(
                variant.scene,
                plan.study.reference.backend,
                context.requests[key],
                context.store.root / REFERENCES,
                lambda share, done=done: update(done + share),
            )
            update(len(made))
    return made


def _cells(context: RunContext) -> int:
    """Render the cells that are missing; returns their number."""
    cells = fair_order(cell for plan in context.plans for cell in plan.cells)
    missing = [cell for cell in cells if _missing(context, cell.key, context.store.read_cell)]
    tasks = [
        RenderTask(context.store.root, cell.key, cell.job, _scene_file(context.store, cell.variant.hash))
        for cell in missing
    ]
    return _compute(context, "cells", render_cell, tasks, len(cells))


def _scores(context: RunContext, references: Mapping[str, StoredReference]) -> int:
    """Score the rendered cells that have no scores; returns their number."""
    tasks = {task.key: task for task in _score_tasks(context, references)}
    there = [task for task in tasks.values() if (context.store.root / "cells" / task.cell).is_dir()]
    missing = [task for task in there if _missing(context, task.key, context.store.read_score)]
    return _compute(context, "scores", score_cell, missing, len(tasks))


def _score_tasks(context: RunContext, references: Mapping[str, StoredReference]) -> Iterator[ScoreTask]:
    """Yield a task for each cell of each study, those of one reference together."""
    root = context.store.root
    for plan in context.plans:
        for cell in sorted(plan.cells, key=lambda cell: cell.variant.hash):
            stored = references[_reference_key(plan, cell.variant)]
            metrics = tuple(plan.study.scored)
            info = to_info(stored, root)
            yield ScoreTask(
                root,
                _score_key(context, plan, cell),
                cell.key,
                cell.job,
                _scene_file(context.store, cell.variant.hash),
                metrics,
                stored.path.parent,
                info,
            )


def _missing(context: RunContext, key: str, read: Callable[[str], BaseModel | None]) -> bool:
    try:
        return read(key) is None
    except DamagedEntryError as error:
        context.progress.note(f"{error}; it will be made again")
        return True


def _compute(
    context: RunContext, title: str, function: Callable[[T], str], tasks: Sequence[T], total: int
) -> int:
    """Compute the `tasks` that are left of `total` items; returns the number that succeeded."""
    done = 0
    with context.progress.step(title, total) as update:
        update(total - len(tasks))
        for number, outcome in enumerate(context.executor.map(function, tasks), start=1):
            update(total - len(tasks) + number)
            if outcome.failure is None:
                done += 1
            else:
                context.failures.append(f"{title}: {_name(outcome.item.job)}: {outcome.failure}")
    return done


def _name(job: Job) -> str:
    return f"{job.scene} {job.parameters or ''} {job.estimator} {job.sampler} spp={job.spp} seed={job.seed}"
