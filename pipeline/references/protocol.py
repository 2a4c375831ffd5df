"""What a reference backend is asked and what it answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.references.accumulator import Tally
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError
from scenes.registry import Registry

Image = NDArray[np.float64]
Progress = Callable[[float], None]  # the share done, 0..1
Quantity = Literal["radiance", "ambient-occlusion"]

MIN_BATCHES = 64
"""Below that, Welch tests per pixel are wrong: measured, 65 % of runs with 32 batches raise a false alarm that 5 % should."""  # noqa: E501


@dataclass(frozen=True)
class ReferenceRequest:
    """At least `spp` samples a pixel in at least `batches` runs of different seeds, from whose spread the
    variance comes.

    quantity: light, or the share of the cosine-weighted hemisphere that nothing within the scene's occlusion
    distance hides. target: the relative standard error to go on to, see `tally.Precision`; None: `spp` and
    `batches` alone decide.
    """

    spp: int = 4096
    batches: int = MIN_BATCHES
    seed: int = 0
    quantity: Quantity = "radiance"
    target: float | None = None


@dataclass(frozen=True, eq=False)
class ReferenceImage:
    """mean, variance (of the mean): (h, w, 3) float64; batches: 0 where nothing was sampled; provenance: what
    made it, as strings.
    """

    mean: Image
    variance: Image
    spp: int
    batches: int
    seconds: float
    provenance: dict[str, str]


def _forget(_: Tally) -> None:
    """Keep nothing."""


@dataclass(frozen=True, eq=False)
class Continuation:
    """start: batches of the same scene, backend, version, quantity and seed, to be added to; keep: told of
    every batch that is finished.
    """

    start: Tally | None = None
    keep: Callable[[Tally], None] = _forget


@runtime_checkable
class ReferenceBackend(Protocol):
    """One way of making reference images."""

    name: str

    def version(self) -> str:
        """Everything about the backend that its images depend on: it goes into the cache key."""
        ...

    def refuses(self, scene: SceneDescription, quantity: Quantity = "radiance") -> str | None:
        """Why the scene is out of its reach, in one sentence, or None."""
        ...

    def render(
        self,
        scene: SceneDescription,
        request: ReferenceRequest,
        progress: Progress | None = None,
        continuation: Continuation | None = None,
    ) -> ReferenceImage:
        """The reference. PenumbraError where it refuses or fails."""
        ...


BACKENDS: Registry[ReferenceBackend] = Registry("reference backend", "pipeline.references.backends")


def unlit(scene: SceneDescription) -> str | None:
    """That a scene has no lights, or None."""
    if scene.lights or any(shape.emission for shape in scene.shapes):
        return None
    return "it has no lights, so that its reference would be black"


def require(backend: ReferenceBackend, scene: SceneDescription, quantity: Quantity) -> None:
    """PenumbraError where the backend refuses the scene."""
    if reason := backend.refuses(scene, quantity):
        raise PenumbraError(f"scene {scene.name}: {reason}")


def takers(scene: SceneDescription, quantity: Quantity, without: str = "") -> list[str]:
    """The backends that take the scene, other than `without`."""
    return [
        name
        for name, backend in BACKENDS.items()
        if name != without and backend.refuses(scene, quantity) is None
    ]


def refusal(backend: ReferenceBackend, scene: SceneDescription, quantity: Quantity) -> str | None:
    """Why the backend does not take the scene, and which ones do; None if it does."""
    reason = backend.refuses(scene, quantity)
    if reason is None:
        return None
    others = takers(scene, quantity, without=backend.name)
    there = f"backends that take it: {', '.join(others)}" if others else "no other backend takes it"
    return f"{reason}; {there}"
