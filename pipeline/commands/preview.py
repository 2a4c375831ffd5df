"""`penumbra preview`: a scene from outside, with the samples of an estimator at one pixel."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Define, Quiet, SceneName, Strict, Substitute, image_target
from pipeline.console.scene import open_scene

if TYPE_CHECKING:
    from pipeline.preview.samples import Tried
    from scenes import SceneDescription


@command(110, ("preview soft-shadow -o preview.png --pixel 150,180", ""))
def preview(
    scene: SceneName,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="Where to write: .png.")],
    pixel: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y",
            help="The pixel whose samples are shown, from the top left; the middle if not given.",
        ),
    ] = None,
    estimator: Annotated[
        str | None,
        typer.Option(help="See `penumbra list estimators`; the scene's if not given, or else mis."),
    ] = None,
    sampler: Annotated[str, typer.Option(help="See `penumbra list samplers`.")] = "independent",
    spp: Annotated[int, typer.Option(help="Samples of the pixel that are shown.")] = 32,
    seed: Annotated[int, typer.Option(help="0 or more.")] = 0,
    define: Define = None,
    strict: Strict = False,
    substitute: Substitute = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Draw geometry, camera and lights from outside, with one pixel's shadow rays coloured by their outcome.

    The camera's frustum ends in a screen with its image. Needs OpenGL off screen (see `penumbra doctor`), but
    no display.

    Examples:

      penumbra preview soft-shadow -o preview.png --pixel 150,180

      penumbra preview touching-light -o area.png -D gap=0.1 --estimator hemisphere --spp 100
    """
    from pipeline.console.console import Console
    from pipeline.extras import require_extra
    from pipeline.preview.drawing import REMEDY, draw, off_screen
    from pipeline.preview.samples import try_pixel
    from pipeline.preview.view import extent_of, look
    from renderer import build
    from scenes.errors import PenumbraError

    console = Console(as_json=as_json, quiet=quiet)
    target = image_target(output)
    if target.suffix != ".png":
        raise PenumbraError(f"{target}: a preview is a .png")
    description = open_scene(scene, define, console, strict, substitute)
    place = _pixel(pixel, description)
    require_extra("preview")
    how = off_screen()
    if not how.works:
        raise PenumbraError(f"no picture can be drawn off screen here: {how.detail}; {REMEDY}")
    chosen = estimator or description.defaults.estimator or "mis"
    with console.step(f"preview {scene}", 3) as update:
        built = build(description)
        low, high = extent_of(built)
        tried = try_pixel(
            built, chosen, place, spp, seed, 0.5 * float(((high - low) ** 2).sum() ** 0.5), sampler
        )
        update(1)
        view = look(built, place, tried, chosen)
        update(2)
        draw(built, view, tried, _title(scene, place, chosen, spp, tried), target, how)
    console.line(f"{target}: pixel {place[0]},{place[1]} by {chosen}, {_outcome(tried)}")
    console.json({"output": str(target), "pixel": list(place), "estimator": chosen, **_counts(tried)})


def _pixel(text: str | None, scene: SceneDescription) -> tuple[int, int]:
    """The pixel of --pixel, or the middle one; PenumbraError for malformed text."""
    from scenes.errors import PenumbraError

    if text is None:
        return scene.film.width // 2, scene.film.height // 2
    x, _, y = text.partition(",")
    try:
        return int(x), int(y)
    except ValueError:
        raise PenumbraError(f"--pixel {text}: write it as x,y, for example --pixel 150,180") from None


def _title(scene: str, pixel: tuple[int, int], estimator: str, spp: int, tried: Tried) -> str:
    rays = "one camera ray" if spp == 1 else f"{spp} camera rays"
    return (
        f"{Path(scene).stem}: {rays} through pixel {pixel[0]},{pixel[1]}, estimator {estimator}, "
        f"{len(tried.state)} samples"
    )


def _counts(tried: Tried) -> dict[str, int]:
    from pipeline.preview.samples import HIDDEN, IDLE, SEEN

    return {"arrive": tried.count(SEEN), "hidden": tried.count(HIDDEN), "of_no_use": tried.count(IDLE)}


def _outcome(tried: Tried) -> str:
    found = _counts(tried)
    if not len(tried.state):
        return "which sees no surface that light could be sampled for"
    return (
        f"{len(tried.state)} samples: {found['arrive']} arrive, {found['hidden']} hidden, "
        f"{found['of_no_use']} of no use"
    )
