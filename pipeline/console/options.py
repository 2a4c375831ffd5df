"""Options and arguments that commands share."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

SceneName = Annotated[
    str,
    typer.Argument(
        metavar="SCENE", help="A library name (see `penumbra list scenes`) or the path of a .pbrt file."
    ),
]
Define = Annotated[
    list[str] | None,
    typer.Option(
        "-D", "--define", metavar="NAME=VALUE", help="Set a parameter of the scene; may be repeated."
    ),
]
Strict = Annotated[
    bool, typer.Option("--strict", help="Refuse a scene whose image would not be the one that pbrt makes.")
]
Substitute = Annotated[
    bool,
    typer.Option(
        "--substitute", help="Render what is not simulated as the nearest that is, and list it on stderr."
    ),
]
Output = Annotated[
    Path, typer.Option("-o", "--output", metavar="FILE", help="Where to write: .exr, or .png to look at.")
]
Exposure = Annotated[
    float,
    typer.Option(metavar="STOPS", help="Brighten a .png by so many stops; an .exr holds radiance as it is."),
]
Threads = Annotated[int, typer.Option(help="Threads; images are the same for any number.")]
Cache = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Where references are kept; the user's cache folder if not given."),
]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print JSON, and nothing else, on stdout; null for what is not finite.")
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no notes on stderr.")]


def definitions(
    pairs: Sequence[str] | None, option: str = "-D", example: str = "gap=0.001"
) -> dict[str, float]:
    """The values of a repeated option `name=value`; PenumbraError names a malformed or repeated one."""
    from scenes.errors import PenumbraError

    values: dict[str, float] = {}
    for pair in pairs or ():
        name, equals, text = pair.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = None
        if not name or not equals or value is None:
            raise PenumbraError(f"{option} {pair}: write it as name=number, for example {option} {example}")
        if name in values:
            raise PenumbraError(f"{option} {pair}: {name} is set twice")
        values[name] = value
    return values


def image_target(path: Path) -> Path:
    """Check that an image can be written to `path`, and return it; PenumbraError if not."""
    from scenes.errors import PenumbraError
    from scenes.files import utf8_name

    utf8_name(path)
    if path.suffix not in (".exr", ".png"):
        raise PenumbraError(f"{path}: cannot tell the format; allowed: .exr, .png")
    if not path.parent.is_dir():
        raise PenumbraError(f"{path}: there is no folder {path.parent}")
    try:  # before a long render, not after it
        with tempfile.TemporaryFile(dir=path.parent):
            return path
    except OSError as error:
        raise PenumbraError(f"{path}: cannot be written: {error.strerror}") from error
