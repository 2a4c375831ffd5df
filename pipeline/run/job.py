"""Jobs: renders to be made, each a pure function of the job and its scene."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from pipeline.schema.record import Job, PlanDecision, RayCounts, Record, SampleStatistics, Seconds
from pipeline.statistics.samples import sample_statistics
from pipeline.store.keys import cell_key
from pipeline.store.provenance import provenance
from renderer import RenderResult, build, image_fingerprint, render
from renderer.build import RenderScene
from scenes import SceneDescription, load
from scenes.files import write_file


@dataclass(frozen=True, eq=False)
class ReadScene:
    """A scene as it was read, the hash of its content, and the seconds that reading took."""

    description: SceneDescription
    hash: str
    seconds_load: float


@dataclass(frozen=True, eq=False)
class PreparedScene:
    """A scene built for rendering, the hash of its content, and the seconds that reading took."""

    built: RenderScene
    hash: str
    seconds_load: float


@dataclass(frozen=True, eq=False)
class JobResult:
    """The record of a job, and the render itself."""

    record: Record
    render: RenderResult


def read_scene(name: str, parameters: Mapping[str, float]) -> ReadScene:
    """Read a scene by library name or path; PenumbraError if that fails."""
    start = time.perf_counter()
    description = load(name, parameters)
    return ReadScene(description, description.content_hash(), time.perf_counter() - start)


def save_scene(path: Path, scene: ReadScene) -> None:
    """Save a scene for the processes of this run."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, pickle.dumps(scene))


def open_scene(path: Path) -> PreparedScene:
    """Read and build a scene that `save_scene` saved."""
    read: ReadScene = pickle.loads(path.read_bytes())
    return build_scene(read)


def build_scene(scene: ReadScene) -> PreparedScene:
    """Build a scene that was read."""
    return PreparedScene(build(scene.description), scene.hash, scene.seconds_load)


def run_job(
    job: Job,
    scene: PreparedScene,
    *,
    prune: bool = True,
    threads: int = 1,
    progress: Callable[[float], None] | None = None,
) -> JobResult:
    """Render a job and make its record, for commands as for workers.

    The image is a function of `job` and `scene`. PenumbraError as `renderer.render` raises it.
    """
    result = render(
        scene.built,
        estimator=job.estimator,
        sampler=job.sampler,
        spp=job.spp,
        seed=job.seed,
        prune=prune,
        threads=threads,
        progress=progress,
    )
    return JobResult(_record(job, scene, result), result)


def _record(job: Job, scene: PreparedScene, result: RenderResult) -> Record:
    key = cell_key(scene.hash, job, image_fingerprint(job.estimator, job.sampler))
    height, width = result.film.count.shape
    return Record(
        key=key,
        job=job,
        scene_hash=scene.hash,
        width=width,
        height=height,
        seconds=Seconds(
            load=scene.seconds_load,
            build=scene.built.seconds_build,
            plan=result.seconds.plan,
            render=result.seconds.render,
            cpu=result.seconds.cpu,
        ),
        rays=RayCounts(primary=result.rays.primary, shadow=result.rays.shadow),
        statistics=statistics(result),
        plan=[PlanDecision(effect=d.effect, needed=d.needed, reason=d.reason) for d in result.plan.decisions],
        notes=list(scene.built.description.notes),
        substitutions=list(scene.built.description.substitutions),
        image=f"cells/{key}/image.exr",
        provenance=provenance(),
    )


def statistics(result: RenderResult) -> SampleStatistics:
    """The statistics of a render's samples."""
    film = result.film
    return sample_statistics(
        mean=film.mean,
        m2=film.m2,
        count=film.count,
        tail=result.tail,
        reflected=result.reflected,
        reflected_sum=result.reflected_sum,
        nonfinite=result.nonfinite,
        maximum=film.maximum,
    )
