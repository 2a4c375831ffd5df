"""`penumbra baseline`: a scene rasterised by pyrender, the cheap end of charts of error against time."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
    image_target,
)
from pipeline.console.scene import open_scene

if TYPE_CHECKING:
    from pathlib import Path

    from pipeline.baseline.process import Raster


@command(60, ("baseline soft-shadow -o cheap.exr", "rasterised, no shadows"))
def baseline(
    scene: SceneName,
    output: Output,
    define: Define = None,
    strict: Strict = False,
    substitute: Substitute = False,
    exposure: Exposure = 0.0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Rasterise a scene without shadows: a point for each area light, one sample in the middle of each pixel.

    An EXR has the linear image and its depth along the view (channel Z, infinite in the background). The
    image is biased: compare it with a reference to see what the missing shadows cost.

    Examples:

      penumbra baseline soft-shadow -o rasterised.exr

      penumbra baseline sphere-light -o rasterised.png --json
    """
    from pipeline.baseline.entry import BIAS
    from pipeline.baseline.process import rasterise
    from pipeline.console.console import Console
    from pipeline.console.picture import write_picture

    console = Console(as_json=as_json, quiet=quiet)
    target, description = image_target(output), open_scene(scene, define, console, strict, substitute)
    with console.step(f"rasterise {scene}", 1) as update:
        (drawn,) = rasterise([description])
        update(1)
    if target.suffix == ".png":
        write_picture(target, drawn.image, exposure, console)
    else:
        _write(target, drawn, description.content_hash())
    height, width = drawn.depth.shape
    device = drawn.provenance["device"]
    console.line(
        f"{target}: {width} x {height} by pyrender on {device}; {drawn.seconds:.4f} s drawn, "
        f"{drawn.seconds_process:.1f} s with its start"
    )
    console.line(BIAS)
    console.json(
        {
            "output": str(target),
            "scene": scene,
            "mean": drawn.image.mean(axis=(0, 1)).tolist(),
            "seconds": {
                "render": drawn.seconds,
                "cpu": drawn.cpu,
                "convert": drawn.seconds_convert,
                "process": drawn.seconds_process,
            },
            "clip": {"near": drawn.near, "far": drawn.far},
            "bias": BIAS,
            "provenance": drawn.provenance,
        }
    )


def _write(target: Path, drawn: Raster, scene_hash: str) -> None:
    from scenes.images.exr import write_exr

    channels = {name: drawn.image[..., c] for c, name in enumerate("RGB")} | {"Z": drawn.depth}
    write_exr(target, channels, {"scene": scene_hash, **drawn.provenance})
