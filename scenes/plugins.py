"""Plug-ins: Python files of a user's own that register an estimator, a sampler, a metric or a backend.

Their paths stand in an environment variable, so that every process of a run reads the same ones. A package
that is installed names its module in the entry-point group `penumbra.plugins` instead.
"""

from __future__ import annotations

import os
import sys
import traceback
from importlib import util
from importlib.metadata import entry_points
from pathlib import Path

from scenes.errors import PenumbraError
from scenes.hashing import hash_bytes

VARIABLE = "PENUMBRA_PLUGINS"
GROUP = "penumbra.plugins"

_imported: dict[Path, str] = {}  # file -> SHA-256 of the text that was run


def use(path: Path) -> None:
    """Import the plug-in in file `path`, here and in every process started from now on.

    A file that is used again after an edit takes its old entries' place. PenumbraError where it cannot be
    read or fails, with the line.
    """
    file = path.resolve()
    _run(file)
    named = _named()
    if file not in named:
        os.environ[VARIABLE] = os.pathsep.join(map(str, [*named, file]))


def load_all() -> None:
    """Import every plug-in that the environment or an installed package names and that is not here yet."""
    for file in _named():
        if file not in _imported:
            _run(file)
    for point in entry_points(group=GROUP):
        try:
            point.load()
        except Exception as error:
            raise PenumbraError(f"plug-in {point.name} ({point.value}): {_told(error)}") from error


def code(file: Path) -> str:
    """SHA-256 of a plug-in's text: of the one that was run, whatever the file holds now."""
    return _imported.get(file) or hash_bytes(file.read_bytes())


def _named() -> list[Path]:
    return [Path(text) for text in os.environ.get(VARIABLE, "").split(os.pathsep) if text]


def _run(file: Path) -> None:
    try:
        text = file.read_bytes()
    except OSError as error:
        raise PenumbraError(f"plug-in {file}: {error.strerror}") from error
    digest = hash_bytes(text)
    if _imported.get(file) == digest:
        return
    _imported[file] = digest
    name = f"penumbra_plugin_{file.stem}_{digest[:8]}"
    spec = util.spec_from_file_location(name, file)
    if spec is None:
        raise PenumbraError(f"plug-in {file}: give a Python file, whose name ends in .py")
    module = util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickle look their module up
    try:
        exec(compile(text, file, "exec"), vars(module))
    except Exception as error:
        del _imported[file], sys.modules[name]
        raise PenumbraError(f"plug-in {file}{_line(file, error)}: {_told(error)}") from error


def _told(error: Exception) -> str:
    return str(error) if isinstance(error, PenumbraError) else f"{type(error).__name__}: {error}"


def _line(file: Path, error: Exception) -> str:
    """`:line` of the file at which it failed."""
    if isinstance(error, SyntaxError):
        return f":{error.lineno}"
    lines = [one.lineno for one in traceback.extract_tb(error.__traceback__) if one.filename == str(file)]
    return f":{lines[-1]}" if lines else ""
