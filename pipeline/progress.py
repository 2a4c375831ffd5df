"""The protocol by which long work reports its progress."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, runtime_checkable

Amount = int | float  # spelled out: run-time type checks take no int for a float
Update = Callable[[Amount], None]


@runtime_checkable
class Progress(Protocol):
    """Receives the steps of long work, and notes for its reader."""

    def step(self, title: str, total: Amount) -> AbstractContextManager[Update]:
        """Begin a step of `total` units; its update is called with the number done."""
        ...

    def note(self, text: str) -> None:
        """Show one line of text."""
        ...


class Silence:
    """Progress that is not shown."""

    def step(self, title: str, total: Amount) -> AbstractContextManager[Update]:
        del title, total
        return nullcontext(_unheard)

    def note(self, text: str) -> None:
        del text


def _unheard(_: Amount) -> None:
    """Show nothing."""
