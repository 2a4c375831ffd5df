"""The grid of a sweep: its scenes are read, and its cells laid out without those that do not apply."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, cast

import numpy as np

from pipeline.backends import BACKENDS
from pipeline.baseline import entry as baseline
from pipeline.references.protocol import Quantity, ReferenceRequest, refusal
from pipeline.run.job import ReadScene, read_scene
from pipeline.schema.manifest import LeftOut
from pipeline.schema.record import Job
from pipeline.schema.sweep import Study, Sweep
from pipeline.scoring.metric import METRICS
from pipeline.self_reference import judges_itself
from pipeline.store.keys import cell_key
from renderer import image_fingerprint
from renderer.interfaces.estimator import ESTIMATORS
from renderer.interfaces.sampler import SAMPLERS
from scenes import SceneDescription, plugins
from scenes.errors import PenumbraError

T = TypeVar("T")
Reader = Callable[[str, tuple[tuple[str, float], ...]], ReadScene]


@dataclass(frozen=True, eq=False)
class SceneVariant:
    """A scene with one set of parameter values, as a study names it."""

    name: str
    parameters: dict[str, float]
    read: ReadScene

    @property
    def scene(self) -> SceneDescription:
        """The description of the scene."""
        return self.read.description

    @property
    def hash(self) -> str:
        """The hash of the scene's content."""
        return self.read.hash

    def __str__(self) -> str:
        return " ".join([self.name, *(f"{name}={value:g}" for name, value in self.parameters.items())])


@dataclass(frozen=True, eq=False)
class Cell:
    """One render to make. key: its content address."""

    key: str
    job: Job
    variant: SceneVariant


@dataclass(frozen=True, eq=False)
class StudyPlan:
    """The grid of one study without what does not apply.

    cells: in the order of the axes, seeds outermost; the baselines are last.
    """

    study: Study
    variants: tuple[SceneVariant, ...]
    cells: tuple[Cell, ...]
    left_out: tuple[LeftOut, ...]

    @property
    def request(self) -> ReferenceRequest:
        """The request for the study's references."""
        reference, quantity = self.study.reference, quantity_of(self.study.axes.estimator, self.study.name)
        return ReferenceRequest(
            spp=reference.spp, batches=reference.batches, seed=reference.seed, quantity=quantity
        )


def lay_out(sweep: Sweep, source: str) -> list[StudyPlan]:
    """Import the plug-ins of a sweep, read its scenes and lay out its grids. source: its name, for messages.

    PenumbraError if a name is unknown, a scene cannot be read, or no cell is left.
    """
    for plugin in sweep.plugins:
        plugins.use(Path(plugin))
    problems = list(_unknown_names(sweep))
    if problems:
        raise PenumbraError("\n".join(f"{source}: {line}" for line in problems))

    @functools.cache
    def read(name: str, values: tuple[tuple[str, float], ...]) -> ReadScene:
        return read_scene(name, dict(values))

    return [_plan(study, f"{source}: study[{i}]", read) for i, study in enumerate(sweep.study)]


def _unknown_names(sweep: Sweep) -> Iterator[str]:
    """Yield a line for each name that no registry knows, with its key path."""
    for i, study in enumerate(sweep.study):
        for key, names, registry in (
            ("axes.estimator", study.axes.estimator, ESTIMATORS),
            ("axes.sampler", study.axes.sampler, SAMPLERS),
            ("metrics", study.metrics, METRICS),
            ("reference.backend", [study.reference.backend], BACKENDS),
        ):
            for name in names:
                if name not in registry.names():
                    there = ", ".join(registry.names())
                    yield f"study[{i}].{key}: unknown {registry.kind} {name!r}; there are: {there}"


def quantity_of(estimators: Sequence[str], study: str) -> Quantity:
    """The quantity that all estimators of a study estimate.

    PenumbraError if they differ, since one reference serves a study.
    """
    quantities = {name: ESTIMATORS[name].quantity for name in estimators}
    if len(set(quantities.values())) > 1:
        given = ", ".join(f"{name} estimates {quantity}" for name, quantity in quantities.items())
        raise PenumbraError(f"study {study}: {given}: give each quantity a study of its own")
    return cast("Quantity", quantities[estimators[0]])


def _plan(study: Study, path: str, read: Reader) -> StudyPlan:
    variants, without_reference = _split(study, list(_variants(study, path, read)))
    estimators, without_estimator = _applicable(study, variants)
    cells = tuple(
        Cell(cell_key(variant.hash, job, image_fingerprint(job.estimator, job.sampler)), job, variant)
        for variant, job in _jobs(study, variants)
        if job.estimator in estimators[str(variant)]
    )
    pictures, without_picture = _baselines(study, variants)
    left_out = tuple(_distinct([*without_reference, *without_estimator, *without_picture]))
    if not cells:
        raise PenumbraError(
            f"{path}: nothing is left to render: {'; '.join(describe(item) for item in left_out)}"
        )
    return StudyPlan(study, tuple(variants), (*cells, *pictures), left_out)


def describe(item: LeftOut) -> str:
    """The left-out cells in one line."""
    return f"{item.what} left out for {item.scene}: {item.reason}"


def _variants(study: Study, path: str, read: Reader) -> Iterator[SceneVariant]:
    names, values = list(study.axes.parameters), study.axes.parameters.values()
    for name, point in itertools.product(study.scenes, itertools.product(*values)):
        parameters = dict(zip(names, point, strict=True))
        try:
            found = read(name, tuple(parameters.items()))
        except PenumbraError as error:
            given = ", ".join(f"{key} = {value:g}" for key, value in parameters.items())
            raise PenumbraError(
                f"{path}: scene {name}{f' with {given}' if given else ''}: {error}"
            ) from error
        scene = found.description
        lit = scene.lights or any(shape.emission for shape in scene.shapes)
        if not lit and quantity_of(study.axes.estimator, study.name) == "radiance":
            raise PenumbraError(f"{path}: scene {name} has no lights: nothing in it would be lit or seen")
        yield SceneVariant(name, parameters, found)


def _split(study: Study, variants: Sequence[SceneVariant]) -> tuple[list[SceneVariant], list[LeftOut]]:
    """The variants that the reference backend takes, and those that it refuses, as left out."""
    backend, quantity = BACKENDS[study.reference.backend], quantity_of(study.axes.estimator, study.name)
    refusals = [(variant, refusal(backend, variant.scene, quantity)) for variant in variants]
    kept = [variant for variant, reason in refusals if reason is None]
    what = f"reference {study.reference.backend}"
    return kept, [
        LeftOut(study=study.name, scene=str(variant), what=what, reason=reason)
        for variant, reason in refusals
        if reason
    ]


def _applicable(study: Study, variants: Sequence[SceneVariant]) -> tuple[dict[str, set[str]], list[LeftOut]]:
    """The estimators that apply to each variant, by its text, and the others as left out."""
    applicable: dict[str, set[str]] = {str(variant): set() for variant in variants}
    notes: list[LeftOut] = []
    for variant, estimator in itertools.product(variants, study.axes.estimator):
        reason = ESTIMATORS[estimator].refuses(variant.scene) or judges_itself(
            study.reference.backend, estimator
        )
        if reason is None:
            applicable[str(variant)].add(estimator)
        else:
            notes.append(LeftOut(study=study.name, scene=variant.name, what=estimator, reason=reason))
    return applicable, notes


def _baselines(study: Study, variants: Sequence[SceneVariant]) -> tuple[list[Cell], list[LeftOut]]:
    """The baseline of each variant, if the study asks for it, and those that are left out."""
    cells: list[Cell] = []
    notes: list[LeftOut] = []
    shading = quantity_of(study.axes.estimator, study.name) == "radiance"
    for variant in variants if study.baseline else ():
        reason = baseline.refuses(variant.scene) if shading else "this study is not about light"
        if reason is None:
            job = Job(
                scene=variant.name,
                parameters=variant.parameters,
                estimator=baseline.NAME,
                sampler=baseline.SAMPLER,
                spp=1,
                seed=0,
            )
            cells.append(Cell(cell_key(variant.hash, job, baseline.fingerprint()), job, variant))
        else:
            notes.append(
                LeftOut(study=study.name, scene=str(variant), what=f"baseline {baseline.NAME}", reason=reason)
            )
    return cells, notes


def _jobs(study: Study, variants: Sequence[SceneVariant]) -> Iterator[tuple[SceneVariant, Job]]:
    axes = study.axes
    grid = itertools.product(axes.seeds, variants, axes.spp, axes.sampler, axes.estimator)
    for seed, variant, spp, sampler, estimator in grid:
        yield (
            variant,
            Job(
                scene=variant.name,
                parameters=variant.parameters,
                estimator=estimator,
                sampler=sampler,
                spp=spp,
                seed=seed,
            ),
        )


def fair_order(cells: Iterable[Cell]) -> list[Cell]:
    """Order cells for rendering: one round for each seed, shuffled within the round, each key once.

    Randomised blocks: a machine that is slow for a while then slows all estimators alike, and no estimator
    always falls to one worker. The shuffle is a function of the cells alone.
    """
    rounds: dict[int, dict[str, Cell]] = {}
    seen: set[str] = set()
    for cell in cells:
        if cell.key not in seen:
            seen.add(cell.key)
            rounds.setdefault(cell.job.seed, {})[cell.key] = cell
    order: list[Cell] = []
    for seed, block in rounds.items():
        shuffled = np.random.default_rng(seed).permutation(np.array(sorted(block)))
        order += [block[str(key)] for key in shuffled]
    return order


def _distinct(items: Sequence[T]) -> list[T]:
    return [item for i, item in enumerate(items) if item not in items[:i]]
