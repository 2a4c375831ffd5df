"""The protocol of an executor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar, runtime_checkable

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Outcome(Generic[T, R]):
    """The outcome of one item: its result, or in words why there is none."""

    item: T
    result: R | None
    failure: str | None = None


@runtime_checkable
class Executor(Protocol):
    """Computes a function of many items, `workers` at a time."""

    workers: int

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[Outcome[T, R]]:
        """Outcomes as they come, begun in the order of `items`. A function that raises fails its own item
        only.

        `function` and `items` must pickle. Closing the iterator early abandons what has not finished.
        """
        ...
