"""The files that a Python file imports, found by parsing it without running it."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path


def imported_files(files: Iterable[Path], root: Path, followed: Sequence[str]) -> list[Path]:
    """The files and all that they import, directly or not, of the packages `followed` below `root`, sorted.

    `import` and `from ... import` count anywhere in a file, also for a type alone. A module brings along the
    `__init__.py` of its packages, which run before it does.
    """
    found, waiting = set[Path](), {path.resolve() for path in files}
    while waiting:
        path = waiting.pop()
        found.add(path)
        waiting |= {*_imported(path, root, followed), *_packages(path, root, followed)} - found
    return sorted(found)


def _imported(path: Path, root: Path, followed: Sequence[str]) -> Iterator[Path]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        for name in names:
            if any(f"{name}.".startswith(f"{package}.") for package in followed):
                module = root.joinpath(*name.split("."))
                files = (module.with_suffix(".py"), module / "__init__.py")
                yield from (one for one in files if one.is_file())


def _packages(path: Path, root: Path, followed: Sequence[str]) -> Iterator[Path]:
    """The `__init__.py` of each followed package that holds a file."""
    tops = [root.joinpath(*package.split(".")) for package in followed]
    folders = [one for one in path.parents if any(one.is_relative_to(top) for top in tops)]
    yield from (one / "__init__.py" for one in folders if (one / "__init__.py").is_file())
