"""`penumbra export`: a scene as text for pbrt-v4 or Mitsuba 3, its parameters filled in."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.console.command import command
from pipeline.console.options import Define, SceneName, Strict, Substitute, definitions

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from scenes.description.scene import SceneDescription


class Target(StrEnum):
    """The program to export to."""

    PBRT = "pbrt"
    MITSUBA = "mitsuba"


@command(100, ("export touching-light -D gap=0.001 -o gap.pbrt", ""))
def export(
    scene: SceneName,
    to: Annotated[Target, typer.Option("--to", help="Whose format.")] = Target.PBRT,
    define: Define = None,
    strict: Strict = False,
    substitute: Substitute = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Where to write; stdout if not given. Meshes and images go beside it.",
        ),
    ] = None,
) -> None:
    """Write a scene as a pbrt-v4 file that pbrt-v4 itself renders, or as Mitsuba 3 XML.

    Differences that the other program makes are noted on stderr and in the file.

    Examples:

      penumbra export touching-light -D gap=0.001 -o gap.pbrt

      penumbra export soft-shadow --to mitsuba -o soft-shadow.xml
    """
    from scenes import load
    from scenes.errors import PenumbraError

    if output is not None and not output.parent.is_dir():
        raise PenumbraError(f"{output}: there is no folder {output.parent}")
    loaded = load(scene, definitions(define), strict=strict, substitute=substitute)
    text, images, meshes, notes = _exported(loaded, to, output.stem if output else "scene")
    if output is None and (images or meshes):
        raise PenumbraError(
            f"scene {loaded.name}: its meshes and images go into files beside the text: give an output "
            "file, -o FILE"
        )
    if output is None:
        sys.stdout.write(text)
    else:
        _write(output, text, images, meshes)
    for note in (*loaded.notes, *loaded.substitutions, *notes):
        sys.stderr.write(f"penumbra: {note}\n")


def _exported(
    scene: SceneDescription, to: Target, stem: str
) -> tuple[str, Mapping[str, NDArray[np.float64]], Mapping[str, bytes], tuple[str, ...]]:
    """Text, images, meshes and notes."""
    if to is Target.MITSUBA:
        from pipeline.references.mitsuba.xml import to_xml

        made = to_xml(scene, stem)
        return made.text, made.images, made.meshes, made.notes
    from scenes.pbrt.write.scene import export as to_pbrt

    exported = to_pbrt(scene, stem)
    return exported.text, exported.images, {}, exported.notes


def _write(
    output: Path, text: str, images: Mapping[str, NDArray[np.float64]], meshes: Mapping[str, bytes]
) -> None:
    """Write all files under other names, and rename them once every one is whole, the text last."""
    from scenes.errors import PenumbraError
    from scenes.files import replacing
    from scenes.images.exr import write_exr

    names = {output.name, *images, *meshes}
    if len(names) != 1 + len(images) + len(meshes):
        raise PenumbraError(f"{output}: a file beside it would have its name")
    with ExitStack() as stack:
        temporary = stack.enter_context(replacing(output))
        for name, image in images.items():
            channels = ("R", "G", "B") if image.shape[2] == 3 else ("Y",)
            path = stack.enter_context(replacing(output.with_name(name)))
            write_exr(path, {channel: image[..., i] for i, channel in enumerate(channels)})
        for name, mesh in meshes.items():
            path = stack.enter_context(replacing(output.with_name(name)))
            path.write_bytes(mesh)
        temporary.write_text(text, encoding="utf-8")
