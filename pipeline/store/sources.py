"""Which of our sources an image depends on: those of its backend, found by its imports, so that none can be
forgotten.

Imports are read, not run: `import` and `from ... import` anywhere in a file, of modules of
`pipeline.references` and of `scenes`, and theirs in turn. What is imported for a type alone counts as well; a
reference made again for nothing is the lesser evil.
"""

from __future__ import annotations

import ast
import functools
import hashlib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLLOWED = ("pipeline.references", "scenes")
# whose packages run with each of their modules; `scenes` as a whole is in the scene's hash
OWN = "pipeline/references"


@functools.cache
def digest(*files: Path) -> str:
    """16 digits of the SHA-256 of these files and of all that they import, each with its name; once a
    process.
    """
    total = hashlib.sha256()
    for path in sources(*files):
        total.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return total.hexdigest()[:16]


def sources(*files: Path) -> list[Path]:
    """The files and all of FOLLOWED that they import, directly or not, sorted."""
    found, waiting = set[Path](), {path.resolve() for path in files}
    while waiting:
        path = waiting.pop()
        found.add(path)
        waiting |= {*_imported(path), *_packages(path)} - found
    return sorted(found)


def _imported(path: Path) -> Iterator[Path]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        for name in names:
            if any(f"{name}.".startswith(f"{package}.") for package in FOLLOWED):
                yield from _file(name)


def _file(module: str) -> Iterator[Path]:
    """The module's file, if it is one and no name within one; of a package its __init__."""
    path = ROOT.joinpath(*module.split("."))
    yield from (one for one in (path.with_suffix(".py"), path / "__init__.py") if one.is_file())


def _packages(path: Path) -> Iterator[Path]:
    """The `__init__.py` of each package of OWN that holds a file: it runs before the file does."""
    folders = [folder for folder in path.parents if folder.is_relative_to(ROOT / OWN)]
    yield from (folder / "__init__.py" for folder in folders if (folder / "__init__.py").is_file())
