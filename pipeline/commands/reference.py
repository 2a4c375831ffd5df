"""`penumbra reference`: one image by a reference backend, kept in the cache and added to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Cache, Define, Exposure, Quiet, SceneName, Strict, image_target
from pipeline.console.scene import open_scene
from pipeline.references import default_cache

if TYPE_CHECKING:
    from pipeline.console.console import Console
    from pipeline.references.cache import StoredReference
    from pipeline.references.protocol import ReferenceRequest
    from scenes import SceneDescription

STOPPED = 130
SPP = 1024
FIRST_SPP = 4  # a batch, to begin with, where the samples follow from a target


@command(50, ("reference soft-shadow -o reference.exr --spp 1024", ""))
def reference(
    scene: SceneName,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="A copy: .exr, or .png to look at.")
    ] = None,
    spp: Annotated[
        int | None, typer.Option(help=f"Samples a pixel in all, at least; {SPP} if there is no --target-se.")
    ] = None,
    target_se: Annotated[
        float | None,
        typer.Option(
            help=(
                "Go on until pixels have this relative standard error: the median, and the 99th "
                "percentile at most 10 times it."
            )
        ),
    ] = None,
    batches: Annotated[
        int, typer.Option(help="Runs of different seeds, at least, from whose spread the variance comes.")
    ] = 64,
    seed: Annotated[int, typer.Option(help="0 or more.")] = 0,
    backend: Annotated[str, typer.Option(help="See `penumbra list backends`.")] = "mitsuba",
    quantity: Annotated[
        str | None,
        typer.Option(help="radiance or ambient-occlusion; what the scene's integrator makes, if not given."),
    ] = None,
    cache: Cache = None,
    define: Define = None,
    strict: Strict = False,
    exposure: Exposure = 0.0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Make a reference image with the variance of its mean, or add samples to the stored one.

    It can be stopped at any moment, and the same command goes on from there. Asking for more samples later
    adds to them.

    Examples:

      penumbra reference soft-shadow --target-se 1e-3

      penumbra reference soft-shadow --spp 4096 -o reference.exr

      penumbra reference touching-light --backend closed-form -D gap=0.001
    """
    from pipeline.console.console import Console
    from pipeline.console.picture import write_picture

    console = Console(as_json=as_json, quiet=quiet)
    target, description = image_target(output) if output else None, open_scene(scene, define, console, strict)
    request = _request(description, spp, target_se, batches, seed, quantity)
    stored = _make(console, scene, description, backend, request, cache or default_cache())
    if target and target.suffix == ".png":
        write_picture(target, stored.image.mean, exposure, console)
    elif target:
        _copy(stored, target)
    _tell(console, stored, request, target)


def _request(
    scene: SceneDescription,
    spp: int | None,
    target: float | None,
    batches: int,
    seed: int,
    quantity: str | None,
) -> ReferenceRequest:
    """The request of the options; PenumbraError names a wrong option."""
    from typing import cast, get_args

    from pipeline.references.protocol import MIN_BATCHES, Quantity, ReferenceRequest
    from scenes.errors import PenumbraError

    if target is not None and not 0 < target < 1:
        raise PenumbraError(f"--target-se {target:g}: a number between 0 and 1 is needed, for example 1e-3")
    if (spp is not None and spp < 1) or seed < 0:
        raise PenumbraError(f"spp = {spp}, seed = {seed}: at least 1 and 0 are needed")
    if batches < MIN_BATCHES:
        raise PenumbraError(
            f"--batches {batches}: at least {MIN_BATCHES} are needed for a variance that tests can trust"
        )
    own = "ambient-occlusion" if scene.defaults.estimator == "ambient-occlusion" else "radiance"
    chosen = own if quantity is None else quantity
    if chosen not in get_args(Quantity):
        raise PenumbraError(f"--quantity {chosen}: there are {', '.join(get_args(Quantity))}")
    if spp is None:
        spp = SPP if target is None else FIRST_SPP * batches
    wanted = cast("Quantity", chosen)
    return ReferenceRequest(spp=max(spp, batches), batches=batches, seed=seed, quantity=wanted, target=target)


def _make(
    console: Console, name: str, scene: SceneDescription, backend: str, request: ReferenceRequest, cache: Path
) -> StoredReference:
    from pipeline import backends  # registers them all
    from pipeline.references.cache import reference_for

    try:
        with console.step(f"{backend} {name}", 1) as update:
            return reference_for(scene, backends.BACKENDS[backend].name, request, cache, update)
    except KeyboardInterrupt:
        console.note(f"stopped: finished batches are kept in {cache}; the same command goes on from there")
        raise typer.Exit(STOPPED) from None


def _copy(stored: StoredReference, target: Path) -> None:
    import shutil

    from scenes.files import replacing

    with replacing(target) as draft:
        shutil.copyfile(stored.path, draft)


def _tell(console: Console, stored: StoredReference, request: ReferenceRequest, target: Path | None) -> None:
    import math

    from pipeline.references.accumulator import TAIL, precision

    image = stored.image
    found = precision(image.mean, image.variance)
    error = math.sqrt(float(image.variance.mean()))
    sampled = image.batches > 0
    how = f"{image.spp} spp in {image.batches} batches" if sampled else "no samples"
    drawn = f"{image.spp - stored.kept} of them new" if stored.fresh else "all of them kept"
    took = f", {drawn}" if sampled else "" if stored.fresh else ", kept"
    console.line(
        f"{stored.path}: {stored.backend}, {request.quantity}, {how}{took}, {image.seconds:.1f} s in all"
    )
    what = "standard error" if sampled else "error bound"
    goal = "" if request.target is None else f" (target {request.target:g} and {TAIL * request.target:g})"
    console.line(
        f"relative {what}: median {found.median:.2g}, 99th percentile {found.p99:.2g} of pixels{goal}; rms "
        f"{error:.3g} absolute"
    )
    if stored.backend == "self":
        console.line("made by the renderer's own estimator: no independent check of it")
    if target:
        console.line(str(target))
    console.json(_figures(stored, request, target, {"median": found.median, "p99": found.p99}, error))


def _figures(
    stored: StoredReference,
    request: ReferenceRequest,
    target: Path | None,
    relative: dict[str, float],
    error: float,
) -> dict[str, Any]:
    image = stored.image
    return {
        "output": str(target) if target else None,
        "stored": str(stored.path),
        "key": stored.key,
        "backend": stored.backend,
        "quantity": request.quantity,
        "independent": stored.backend != "self",
        "spp": image.spp,
        "spp_kept": stored.kept,
        "batches": image.batches,
        "seconds": image.seconds,
        "mean": image.mean.mean(axis=(0, 1)).tolist(),
        "rms_standard_error": error,
        "relative_standard_error": relative,
        "target_se": request.target,
        "provenance": image.provenance,
    }
