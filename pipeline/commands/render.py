"""`penumbra render`: one image by Penumbra's renderer."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.console.command import command
from pipeline.console.options import (
    AsJson,
    Define,
    Exposure,
    Output,
    Quiet,
    SceneName,
    Strict,
    Substitute,
    Threads,
    image_target,
)
from pipeline.console.scene import open_scene

if TYPE_CHECKING:
    from pathlib import Path

    from pipeline.console.console import Console
    from pipeline.run.job import JobResult
    from pipeline.schema.record import Job


@command(40, ("render soft-shadow -o out.exr --estimator solid-angle --spp 64", ""))
def render(
    scene: SceneName,
    output: Output,
    estimator: Annotated[
        str | None,
        typer.Option(help="See `penumbra list estimators`; the scene's if not given, or else mis."),
    ] = None,
    sampler: Annotated[
        str | None, typer.Option(help="See `penumbra list samplers`; the scene's if not given.")
    ] = None,
    spp: Annotated[int | None, typer.Option(help="Samples a pixel; the scene's if not given.")] = None,
    seed: Annotated[int | None, typer.Option(help="0 or more; the scene's if not given.")] = None,
    define: Define = None,
    strict: Strict = False,
    substitute: Substitute = False,
    threads: Threads = 1,
    prune: Annotated[
        bool, typer.Option(help="Leave out what the scene does not call for (see `explain`).")
    ] = True,
    exposure: Exposure = 0.0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Render a scene's direct light to an EXR (mean, variance of the mean, count) or a PNG.

    Examples:

      penumbra render soft-shadow -o soft.exr --estimator solid-angle --spp 64

      penumbra render touching-light -o gap.png -D gap=0.001 --sampler sobol --json
    """
    from pipeline.console.console import Console
    from pipeline.console.picture import write_picture
    from pipeline.run.job import ReadScene, build_scene, run_job
    from pipeline.schema.record import Job
    from renderer.interfaces.estimator import ESTIMATORS, RADIANCE

    console = Console(as_json=as_json, quiet=quiet)
    target, description = image_target(output), open_scene(scene, define, console, strict, substitute)
    given = description.defaults
    estimator = estimator or given.estimator or "mis"
    sampler = given.sampler if sampler is None else sampler
    spp, seed = given.spp if spp is None else spp, given.seed if seed is None else seed
    # Not validated here: the renderer says in words of its own which value is wrong.
    job = Job.model_construct(
        scene=scene,
        parameters=dict(description.parameters),
        estimator=estimator,
        sampler=sampler,
        spp=spp,
        seed=seed,
    )
    with console.step(f"render {scene}", 1) as update:
        built = build_scene(ReadScene(description, description.content_hash(), 0.0))
        done = run_job(job, built, prune=prune, threads=threads, progress=update)
    if target.suffix == ".png":
        write_picture(target, done.render.image, exposure, console)
    else:
        _write(target, done)
    if not built.built.sources.all and ESTIMATORS[estimator].quantity == RADIANCE:
        console.note(f"{scene}: the scene has no lights: its image is black, as pbrt's")
    _tell(console, target, done)


def _write(target: Path, done: JobResult) -> None:
    from scenes.images.exr import write_estimate_exr

    record, result = done.record, done.render
    metadata = {
        "job": record.job.model_dump_json(),
        "scene": record.scene_hash,
        "provenance": record.provenance.model_dump_json(),
        "independent": str(_independent(record.job)),
        "verdict": record.statistics.verdict,
        "notes": json.dumps(record.notes),
        "substitutions": json.dumps(record.substitutions),
    }
    write_estimate_exr(target, result.image, result.variance, result.film.count, metadata)


def _independent(job: Job) -> bool:
    """Whether samples are independent, so that their spread gives the variance of the mean."""
    from renderer.interfaces.sampler import SAMPLERS

    return SAMPLERS[job.sampler].independent


def _tell(console: Console, target: Path, done: JobResult) -> None:
    record, result = done.record, done.render
    job, found = record.job, record.statistics
    seconds = result.seconds
    console.line(
        f"{target}: {result.image.shape[1]} x {result.image.shape[0]}, {job.estimator}, {job.sampler}, "
        f"{job.spp} spp, seed {job.seed}; {seconds.render:.3f} s, {result.rays.primary:,} primary and "
        f"{result.rays.shadow:,} shadow rays"
    )
    noise = f"noise {found.noise:.3g} (rms standard error of independent samples); " if job.spp > 1 else ""
    console.line(f"{noise}samples {found.verdict}: {found.reason}")
    console.json(
        {
            "output": str(target),
            "job": job.model_dump(),
            "mean": result.image.mean(axis=(0, 1)).tolist(),
            "seconds": {
                "build": seconds.build,
                "plan": seconds.plan,
                "render": seconds.render,
                "cpu": seconds.cpu,
            },
            "rays": {"primary": result.rays.primary, "shadow": result.rays.shadow},
            "statistics": found.model_dump(),
            "notes": record.notes,
            "substitutions": record.substitutions,
            "plan": [item.model_dump() for item in record.plan],
        }
    )
