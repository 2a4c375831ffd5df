"""Scenes by name: those of the library, and any .pbrt file by its path."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError
from scenes.pbrt.parser import parse_file
from scenes.pbrt.text.lexer import read_source
from scenes.pbrt.text.template import TemplateParameter, Values, read_header

ALLOW_OUTSIDE = "PENUMBRA_ALLOW_OUTSIDE"
LIBRARY = Path(__file__).parent / "library"


@dataclass(frozen=True)
class LibraryScene:
    """A built-in scene. title: the first line of its header comment. doc: the whole header comment."""

    name: str
    path: Path
    title: str
    doc: str
    parameters: tuple[TemplateParameter, ...]


def library() -> list[LibraryScene]:
    """All built-in scenes, by name."""
    return [_library_scene(path) for path in sorted(LIBRARY.glob("*.pbrt"))]


def _library_scene(path: Path) -> LibraryScene:
    header = read_header(read_source(path))
    return LibraryScene(path.stem, path, header.title, header.doc, header.parameters)


def load(
    name_or_path: str,
    parameters: Values | None = None,
    allow_outside: bool | None = None,
    strict: bool = False,
    substitute: bool = False,
    progress: Callable[[float], None] | None = None,
) -> SceneDescription:
    """Read a scene by library name or by the path of a .pbrt file.

    parameters: values of the template's `$name`s, finite numbers. allow_outside: whether the scene may name
    files outside its own folder; None asks the environment variable ALLOW_OUTSIDE, which the processes of a
    run inherit. strict: refuse a scene whose image would differ from pbrt's. substitute: render the nearest
    thing that is simulated in place of one that is not; the scene's `substitutions` list each. progress:
    called with the share of the text that is read, if reading takes more than a second.

    PenumbraError for an unknown scene or parameter. SceneError with file, line and column for wrong text.
    """
    path = find(name_or_path)
    allow_outside = bool(os.environ.get(ALLOW_OUTSIDE)) if allow_outside is None else allow_outside
    name = name_or_path if path.parent == LIBRARY else None
    return parse_file(path, parameters, name, allow_outside, strict, substitute, progress)


def find(name_or_path: str) -> Path:
    """The file of a scene. Raises PenumbraError with the names that exist."""
    names = [path.stem for path in sorted(LIBRARY.glob("*.pbrt"))]
    if name_or_path in names:
        return LIBRARY / f"{name_or_path}.pbrt"
    path = Path(name_or_path)
    try:
        if path.is_file():
            return path
        exists = path.exists()
    except (OSError, ValueError):
        exists = False
    if exists:
        raise PenumbraError(f"{name_or_path!r} is no file")
    if path.suffix == ".pbrt" or len(path.parts) > 1:
        raise PenumbraError(f"there is no scene file {name_or_path!r}")
    raise PenumbraError(
        f"unknown scene {name_or_path!r}; there are: {', '.join(names)}, or give the path of a .pbrt file"
    )
