"""Named things, one file each: lights, estimators, samplers, metrics, backends.

A module ends with `LIGHTS.add("rectangle", RectangleLights)`; the registry imports every module of its
package at the first look-up, so that a new entry is one new file and no other is touched.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from typing import Generic, TypeVar

from scenes.errors import PenumbraError

T = TypeVar("T")


class Registry(Generic[T]):
    """Entries of one kind by name, found in the modules of one package."""

    def __init__(self, kind: str, package: str) -> None:
        self.kind = kind
        self.package = package
        self._entries: dict[str, T] = {}
        self._loaded = False

    def add(self, name: str, entry: T) -> T:
        """Register `entry`; a second entry of the same name is a bug and raises ValueError."""
        if name in self._entries:
            raise ValueError(f"{self.kind} {name!r} is registered twice")
        self._entries[name] = entry
        return entry

    def __getitem__(self, name: str) -> T:
        """The entry called `name`; PenumbraError naming what there is, if there is none."""
        self._load()
        if name not in self._entries:
            raise PenumbraError(f"unknown {self.kind} {name!r}; there are: {', '.join(self.names())}")
        return self._entries[name]

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
