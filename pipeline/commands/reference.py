"""`penumbra reference`: one image by a reference backend."""

from __future__ import annotations

from typing import Annotated

import typer

from pipeline.commands.options import AsJson, Define, Output, Quiet, SceneName, definitions, image_target


def reference(
    scene: SceneName,
    output: Output,
    spp: Annotated[int, typer.Option(help="Samples a pixel in all, dealt to the batches.")] = 1024,
    batches: Annotated[int, typer.Option(help="Runs of different seeds, from whose spread the variance comes.")] = 64,
    seed: Annotated[int, typer.Option(help="0 or more.")] = 0,
    backend: Annotated[str, typer.Option(help="See `penumbra list backends`.")] = "mitsuba",
    define: Define = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Make a reference image with the variance of its mean: EXR with provenance, or a PNG to look at.

    Examples:

      penumbra reference soft-shadow -o reference.exr --spp 1024

      penumbra reference touching-light -o exact.exr --backend closed-form -D gap=0.001
    """
    from pipeline.commands.console import Speaker
    from pipeline.references.protocol import BACKENDS, ReferenceRequest
    from scenes import load
    from scenes.errors import PenumbraError
    from scenes.images import write_estimate_exr, write_png

    speaker = Speaker(as_json=as_json, quiet=quiet)
    target, description = image_target(output), load(scene, definitions(define))
    if spp < 1 or batches < 1 or seed < 0:
        raise PenumbraError(f"spp = {spp}, batches = {batches}, seed = {seed}: at least 1, 1 and 0 are needed")
    chosen = BACKENDS[backend]
    with speaker.step(f"{backend} {scene}", 1) as update:
        image = chosen.render(description, ReferenceRequest(spp, batches, seed), update)
    if target.suffix == ".png":
        write_png(target, image.mean)
    else:
        known = {
            "scene": description.content_hash(),
            "backend": backend,
            "batches": str(image.batches),
            "spp": str(image.spp),
        }
        write_estimate_exr(target, image.mean, image.variance, float(image.spp), image.provenance | known)
    error = float(image.variance.mean() ** 0.5)
    how = f"{image.spp} spp in {image.batches} batches" if image.batches else "no samples"
    sure = f"rms {'standard error' if image.batches else 'error bound'} {error:.3g}"
    speaker.line(f"{target}: {backend}, {how}, {image.seconds:.1f} s; {sure}")
    speaker.json(
        {
            "output": str(target),
            "backend": backend,
            "spp": image.spp,
            "batches": image.batches,
            "seconds": image.seconds,
            "mean": image.mean.mean(axis=(0, 1)).tolist(),
            "rms_standard_error": error,
            "provenance": image.provenance,
        }
    )
