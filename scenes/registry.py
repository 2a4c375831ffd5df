"""Registries of named things, one file each: lights, estimators, samplers, metrics, backends.

A module ends with `LIGHTS.add("rectangle", RectangleLights)`. The registry imports every module of its
package at the first look-up, so that a new entry touches one new file. Plug-ins of a user's own
(`scenes.plugins`) follow and add entries by the same call.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any, Generic, TypeVar

from scenes import plugins
from scenes.errors import PenumbraError

T = TypeVar("T")


class Registry(Generic[T]):
    """Entries of one kind by name, found in the modules of one package."""

    def __init__(self, kind: str, package: str) -> None:
        self.kind = kind
        self.package = package
        self._entries: dict[str, T] = {}
        self._files: dict[str, Path | None] = {}
        self._loaded = False

    def add(self, name: str, entry: T) -> T:
        """Register `entry` for the module that is running. ValueError if another module has the name; a
        module that runs again replaces its own entry.
        """
        module = _running_module()
        if module["__name__"].split(".")[0] != self.package.split(".")[0]:
            self._load()  # ours first: of two of one name the plug-in's is the second
        file = Path(module["__file__"]).resolve() if "__file__" in module else None
        if name in self._entries and (file is None or self._files.get(name) != file):
            raise ValueError(f"{self.kind} {name!r} is registered twice")
        self._entries[name] = entry
        self._files[name] = file
        return entry

    def file(self, name: str) -> Path:
        """The file that registered `name`. PenumbraError for an entry from a notebook or a prompt."""
        self[name]
        file = self._files.get(name)
        if file is None:
            raise PenumbraError(
                f"{self.kind} {name!r} comes from no file, so that its results could outlive its code: "
                "write it to a .py file and name that file as a plug-in"
            )
        return file

    def __getitem__(self, name: str) -> T:
        """The entry called `name`. PenumbraError with all names if there is none."""
        self._load()
        if name not in self._entries:
            raise PenumbraError(
                f"unknown {self.kind} {name!r}; there are: {', '.join(self.names())}, and those of plug-ins "
                "(penumbra --plugin FILE.py COMMAND ...)"
            )
        return self._entries[name]

    def code(self, name: str) -> str:
        """SHA-256 of the plug-in that registered `name`; empty for an entry of this project."""
        file, (package, *_) = self.file(name), importlib.import_module(self.package).__path__
        return "" if file.parent == Path(package).resolve() else plugins.code(file)

    def names(self) -> list[str]:
        """All names, sorted."""
        self._load()
        return sorted(self._entries)

    def items(self) -> Iterator[tuple[str, T]]:
        """All entries, sorted by name."""
        return ((name, self._entries[name]) for name in self.names())

    def _load(self) -> None:
        if self._loaded:
            return
        package = importlib.import_module(self.package)
        for module in pkgutil.iter_modules(package.__path__):
            importlib.import_module(f"{self.package}.{module.name}")
        self._loaded = True
        plugins.load_all()


def _running_module() -> dict[str, Any]:
    """The globals of the innermost module whose top-level code is running."""
    frame: FrameType | None = inspect.currentframe()
    while frame is not None and frame.f_code.co_name != "<module>":
        frame = frame.f_back
    return frame.f_globals if frame is not None else {"__name__": ""}
