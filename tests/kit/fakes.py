"""Fakes at the boundaries of a run: a reference backend, an executor, a listener.

And a sweep small enough for a test.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from pipeline.progress import Amount, Update
from pipeline.references.protocol import Continuation, Progress, Quantity, ReferenceImage, ReferenceRequest
from pipeline.run.executors.protocol import Outcome
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError

T = TypeVar("T")
R = TypeVar("R")

TINY = """
title = "tiny"
[[study]]
name = "tiny"
scenes = ["touching-light"]
metrics = ["mse", "nonfinite"]
reference = { backend = "fake", spp = 64, batches = 64 }
[study.axes]
estimator = ["area", "solid-angle"]
sampler = ["independent"]
spp = [1, 4]
seeds = 2
parameters = { xresolution = [16], yresolution = [12] }
"""
TINY_CELLS = 8


@dataclass
class FakeBackend:
    """A gray image with a little noise, and how often it was asked for."""

    name: str = "fake"
    asked: int = 0
    refused: dict[str, str] = field(default_factory=dict)

    def version(self) -> str:
        return "1"

    def refuses(self, scene: SceneDescription, quantity: Quantity = "radiance") -> str | None:
        return self.refused.get(scene.name)

    def render(
        self,
        scene: SceneDescription,
        request: ReferenceRequest,
        progress: Progress | None = None,
        continuation: Continuation | None = None,
    ) -> ReferenceImage:
        self.asked += 1
        if progress:
            progress(1.0)
        shape = (scene.film.height, scene.film.width, 3)
        return ReferenceImage(
            np.full(shape, 0.4), np.full(shape, 1e-6), request.spp, request.batches, 0.5, {"of": "fake"}
        )


@dataclass
class InlineExecutor:
    """Computes in this process, one item after the other. stop_after: raises KeyboardInterrupt after so many
    items.
    """

    workers: int = 1
    stop_after: int | None = None
    began: list[object] = field(default_factory=list)

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[Outcome[T, R]]:
        for item in items:
            if self.stop_after is not None and len(self.began) >= self.stop_after:
                raise KeyboardInterrupt
            self.began.append(item)
            try:
                yield Outcome(item, function(item))
            except PenumbraError as error:
                yield Outcome(item, None, str(error))


@dataclass
class Recorder:
    """Remembers notes, and of each step its last state: title to (done, total)."""

    notes: list[str] = field(default_factory=list)
    steps: dict[str, tuple[Amount, Amount]] = field(default_factory=dict)

    @contextmanager
    def step(self, title: str, total: Amount) -> Generator[Update]:
        self.steps[title] = (0, total)

        def update(done: Amount) -> None:
            self.steps[title] = (done, total)

        yield update

    def note(self, text: str) -> None:
        self.notes.append(text)
