"""How a long piece of work tells where it stands."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, runtime_checkable

Amount = int | float  # spelled out: run-time type checks take no int for a float
Update = Callable[[Amount], None]


@runtime_checkable
class Progress(Protocol):
    """Told of steps and of what a reader should know; it shows them or not."""

    def step(self, title: str, total: Amount) -> AbstractContextManager[Update]:
        """A step of `total` units begins; the update is called with how many are done."""
        ...

    def note(self, text: str) -> None:
        """One line that is worth reading."""
        ...


class Silence:
    """Progress that shows nothing."""

    def step(self, title: str, total: Amount) -> AbstractContextManager[Update]:
        del title, total
        return nullcontext(_unheard)

    def note(self, text: str) -> None:
        del text


def _unheard(_: Amount) -> None:
    """Nobody asked."""
