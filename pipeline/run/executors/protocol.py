"""The protocol of an executor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar, runtime_checkable

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Outcome(Generic[T, R]):
    """The outcome of one item: its result, or the reason of its failure in words."""

    item: T
    result: R | None
    failure: str | None = None


@runtime_checkable
class Executor(Protocol):
    """Computes a function of many items, `workers` at a time."""

    workers: int

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[Outcome[T, R]]:
        """Yield outcomes as they come; items are begun in order. An exception fails its own item only.

        `function` and `items` must pickle. Closing the iterator early abandons unfinished items.
        """
        ...
