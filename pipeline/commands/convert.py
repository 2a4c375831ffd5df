"""`penumbra convert`: a scene of another program as a pbrt-v4 file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Quiet

if TYPE_CHECKING:
    from pipeline.convert.document import Document

KINDS = (".xml", ".gltf", ".glb")


@command(105, ("convert scene.xml -o scene.pbrt", "Mitsuba's XML, or glTF 2.0"))
def convert(
    source: Annotated[
        Path, typer.Argument(metavar="IN", help="Mitsuba 3 XML, or glTF 2.0 as .gltf or .glb.")
    ],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="OUT.pbrt", help="Where to write; images go beside it."),
    ],
    define: Annotated[
        list[str] | None,
        typer.Option("-D", "--define", metavar="NAME=VALUE", help="What $NAME stands for; may be repeated."),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write a scene of Mitsuba 3 or of glTF 2.0 as a pbrt-v4 file of its direct light.

    Everything that cannot be kept is listed on stderr, one line for each kind.

    Examples:

      penumbra convert cornell.xml -D spp=64 -o cornell.pbrt

      penumbra convert chair.glb -o chair.pbrt --json
    """
    from pipeline.console.console import Console
    from pipeline.convert.document import write
    from scenes.errors import PenumbraError

    console = Console(as_json=as_json, quiet=quiet)
    if output.suffix != ".pbrt":
        raise PenumbraError(f"{output}: the name of a scene file ends in .pbrt")
    if not output.parent.is_dir():
        raise PenumbraError(f"{output}: there is no folder {output.parent}")
    document = _document(source, output.stem, define or ())
    scene = write(document, source.name, output)
    lost = document.losses.lines()
    for line in lost:
        console.note(f"lost: {line}")
    shapes, lights = len(scene.shapes), len(scene.lights)
    console.line(
        f"{output}: {shapes} shapes, {lights} lights that are no shapes, {len(document.images)} images"
    )
    console.json(
        {
            "output": str(output),
            "images": [str(output.with_name(name)) for name in document.images],
            "shapes": shapes,
            "lights": lights,
            "lost": list(lost),
        }
    )


def _document(source: Path, stem: str, define: Sequence[str]) -> Document:
    from scenes.catalog import ALLOW_OUTSIDE
    from scenes.errors import PenumbraError

    pairs = [pair.partition("=") for pair in define]
    if any(not name or not equals for name, equals, _ in pairs):
        raise PenumbraError(
            f"-D {next(p for p in define if not p.partition('=')[1] or p[0] == '=')}: write NAME=VALUE"
        )
    given = {name: value for name, _, value in pairs}
    outside = bool(os.environ.get(ALLOW_OUTSIDE))
    if source.suffix.lower() not in KINDS:
        raise PenumbraError(f"{source}: cannot tell the format; there are: {', '.join(KINDS)}")
    if source.suffix.lower() == ".xml":
        from pipeline.convert.mitsuba.scene import convert as from_mitsuba

        return from_mitsuba(source, given, stem, outside)
    from pipeline.convert.gltf.scene import convert as from_gltf

    if given:
        raise PenumbraError("-D is for Mitsuba's XML: glTF has no parameters")
    return from_gltf(source, stem, outside)
