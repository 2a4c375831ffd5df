"""`penumbra verify`: a test of whether an estimator is unbiased on a scene, with its power."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Cache, Define, Quiet, SceneName
from pipeline.console.scene import open_scene
from pipeline.references import default_cache

if TYPE_CHECKING:
    from pipeline.console.console import Console
    from pipeline.references.cache import StoredReference
    from pipeline.studies.verify import Trial, Verification
    from scenes import SceneDescription

AT_LEAST = 1024  # samples a pixel of a reference
TIMES = 16  # the samples of the render, so that the reference's noise is a small part of the comparison's


@command(80, ("verify soft-shadow --estimator area", "is it unbiased?"))
def verify(
    scene: SceneName,
    estimator: Annotated[str, typer.Option(help="See `penumbra list estimators`.")],
    define: Define = None,
    sampler: Annotated[
        str, typer.Option(help="Others than independent are rendered 32 times over.")
    ] = "independent",
    spp: Annotated[int, typer.Option(help="Samples a pixel.")] = 64,
    seed: Annotated[int, typer.Option(help="0 or more; the reference has its own.")] = 1,
    alpha: Annotated[float, typer.Option(help="Chance of a false alarm, all tests together.")] = 1e-3,
    bias: Annotated[
        float,
        typer.Option(help="Share of the image mean that must have been caught for a verdict of unbiased."),
    ] = 0.01,
    correction: Annotated[
        str, typer.Option(help="Of the single pixels: sidak or bh (Benjamini-Hochberg).")
    ] = "sidak",
    reference: Annotated[
        str, typer.Option(metavar="BACKEND", help="See `penumbra list backends`.")
    ] = "mitsuba",
    reference_spp: Annotated[
        int | None,
        typer.Option(help="Samples a pixel of the reference; 16 times those of the render if not given."),
    ] = None,
    cache: Cache = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with 1 unless the verdict is unbiased.")
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Test an estimator against a reference: image mean, a grid, regions of the picture, single pixels.

    The verdict is unbiased, biased (exit code 1), untrustworthy (its samples have no standard error to test
    by) or inconclusive (too few samples: see --bias). Each test says the smallest bias of the whole image
    that it would have caught.

    Examples:

      penumbra verify soft-shadow --estimator solid-angle

      penumbra verify touching-light --estimator area -D gap=0.001 --reference closed-form --json
    """
    from pipeline.console.console import Console
    from pipeline.studies.verify import Trial, region_masks
    from pipeline.studies.verify import verify as run
    from renderer import build
    from renderer.interfaces.estimator import ESTIMATORS
    from scenes.errors import PenumbraError

    console = Console(as_json=as_json, quiet=quiet)
    if correction not in ("sidak", "bh"):
        raise PenumbraError(f"unknown correction {correction!r}; allowed: sidak, bh")
    trial = Trial(estimator, sampler, spp, seed, alpha, bias, correction)  # pyright: ignore[reportArgumentType]
    description = open_scene(scene, define, console)
    why = ESTIMATORS[estimator].refuses(description)
    if why:
        raise PenumbraError(f"estimator {estimator!r} does not apply to scene {scene!r}: {why}")
    built, threads = build(description), os.cpu_count() or 1
    stored = _reference(description, trial, reference, reference_spp, cache or default_cache(), console)
    parts = region_masks(built, threads)
    with console.step(f"render {scene}", 1) as update:
        found = run(built, trial, stored.image, parts, threads, update)
    _tell(console, scene, trial, found, stored)
    if found.verdict == "biased" or (strict and found.verdict != "unbiased"):
        raise typer.Exit(1)


def _reference(
    scene: SceneDescription, trial: Trial, backend: str, spp: int | None, folder: Path, console: Console
) -> StoredReference:
    """The reference, from the cache `folder`; PenumbraError if the estimator itself would make it."""
    from pipeline.backends import BACKENDS
    from pipeline.references.cache import reference_for
    from pipeline.references.protocol import ReferenceRequest
    from pipeline.self_reference import judges_itself
    from renderer.interfaces.estimator import ESTIMATORS
    from scenes.errors import PenumbraError

    why = judges_itself(BACKENDS[backend].name, trial.estimator)
    if why:
        raise PenumbraError(why)
    wanted = max(AT_LEAST, TIMES * trial.spp) if spp is None else spp
    quantity: Any = ESTIMATORS[trial.estimator].quantity
    with console.step(f"{backend} {scene.name}", 1) as update:
        return reference_for(scene, backend, ReferenceRequest(wanted, quantity=quantity), folder, update)


def _tell(console: Console, scene: str, trial: Trial, found: Verification, stored: StoredReference) -> None:
    from pipeline.console.verdicts import plain_tests, tell_tests

    tell_tests(console, found.tests)
    console.line(f"{scene}, {trial.estimator}: {found.verdict}: {found.reason}")
    image = stored.image
    console.json(
        {
            "scene": scene,
            "estimator": trial.estimator,
            "verdict": found.verdict,
            "reason": found.reason,
            "tests": plain_tests(found.tests),
            "level": found.level,
            "sampler": trial.sampler,
            "spp": trial.spp,
            "seed": trial.seed,
            "reference": {"backend": stored.backend, "spp": image.spp, "batches": image.batches},
        }
    )
