"""`penumbra export`: a scene as pbrt-v4 text, its parameters filled in."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from pipeline.commands.options import Define, SceneName, definitions


def export(
    scene: SceneName,
    define: Define = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Where to write; stdout if not given.")
    ] = None,
) -> None:
    """Write a scene as one self-contained pbrt-v4 file, which pbrt-v4 itself renders.

    Examples:

      penumbra export touching-light -D gap=0.001 -o gap.pbrt
    """
    from scenes import load
    from scenes.errors import PenumbraError
    from scenes.export import to_pbrt
    from scenes.images import replacing

    text = to_pbrt(load(scene, definitions(define)))
    if output is None:
        sys.stdout.write(text)
        return
    if not output.parent.is_dir():
        raise PenumbraError(f"{output}: there is no folder {output.parent}")
    with replacing(output) as temporary:
        temporary.write_text(text, encoding="utf-8")
