"""How a long piece of work tells where it stands."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol, runtime_checkable

Update = Callable[[float], None]


@runtime_checkable
class Listener(Protocol):
    """Told of steps and of what a reader should know; it shows them or not."""

    def step(self, title: str, total: float) -> AbstractContextManager[Update]:
        """A step of `total` units begins; the update is called with how many are done."""
        ...

    def note(self, text: str) -> None:
        """One line that is worth reading."""
        ...
