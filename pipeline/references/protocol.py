"""The protocol of a reference backend, with its requests and the images that it returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.references.accumulator import Accumulator
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError
from scenes.registry import Registry

Image = NDArray[np.float64]
Progress = Callable[[float], None]  # the share done, 0..1
Quantity = Literal["radiance", "ambient-occlusion"]

MIN_BATCHES = 64
"""Welch tests per pixel need so many: measured, 65 % of runs with 32 batches raise a false alarm, not 5 %."""


@dataclass(frozen=True)
class ReferenceRequest:
    """At least `spp` samples a pixel, in at least `batches` runs that differ in their seed.

    The spread of the runs gives the variance. quantity: radiance, or the cosine-weighted share of the
    hemisphere that is unoccluded within the scene's occlusion distance. target: relative standard error to
    render on to, by `accumulator.Precision`; None stops at `spp` and `batches`.
    """

    spp: int = 4096
    batches: int = MIN_BATCHES
    seed: int = 0
    quantity: Quantity = "radiance"
    target: float | None = None


@dataclass(frozen=True, eq=False)
class ReferenceImage:
    """mean, variance (of the mean): (h, w, 3) float64. batches: 0 for a deterministic image.

    provenance: its origin, by name.
    """

    mean: Image
    variance: Image
    spp: int
    batches: int
    seconds: float
    provenance: dict[str, str]


def _forget(_: Accumulator) -> None:
    """Keep no batches."""


@dataclass(frozen=True, eq=False)
class Continuation:
    """Batches to go on from. start: those of an earlier call for the same key. keep: called after each
    batch.
    """

    start: Accumulator | None = None
    keep: Callable[[Accumulator], None] = _forget


@runtime_checkable
class ReferenceBackend(Protocol):
    """One way of making reference images."""

    name: str

    def version(self) -> str:
        """Everything about the backend that its images depend on; a part of the cache key."""
        ...

    def refuses(self, scene: SceneDescription, quantity: Quantity = "radiance") -> str | None:
        """Say in one sentence why the backend cannot render the scene; None if it can."""
        ...

    def render(
        self,
        scene: SceneDescription,
        request: ReferenceRequest,
        progress: Progress | None = None,
        continuation: Continuation | None = None,
    ) -> ReferenceImage:
        """Render the reference; PenumbraError if the backend refuses the scene or fails."""
        ...


BACKENDS: Registry[ReferenceBackend] = Registry("reference backend", "pipeline.references.backends")


def unlit(scene: SceneDescription) -> str | None:
    """Why a scene without lights is refused; None for a scene with lights."""
    if scene.lights or any(shape.emission for shape in scene.shapes):
        return None
    return "it has no lights, so that its reference would be black"


def require(backend: ReferenceBackend, scene: SceneDescription, quantity: Quantity) -> None:
    """Raise PenumbraError if the backend refuses the scene."""
    if reason := substituted(scene) or backend.refuses(scene, quantity):
        raise PenumbraError(f"scene {scene.name}: {reason}")


def substituted(scene: SceneDescription) -> str | None:
    """Why a scene has no reference whose materials or lights were substituted; None if none were."""
    if not scene.substitutions:
        return None
    return f"a reference is of the file, and this is not: {'; '.join(scene.substitutions)}"


def supporting_backends(scene: SceneDescription, quantity: Quantity, without: str = "") -> list[str]:
    """The names of all backends but `without` that can render the scene."""
    return [
        name
        for name, backend in BACKENDS.items()
        if name != without and backend.refuses(scene, quantity) is None
    ]


def refusal(backend: ReferenceBackend, scene: SceneDescription, quantity: Quantity) -> str | None:
    """Why the backend refuses the scene, and which others take it; None if it does not refuse."""
    if reason := substituted(scene):
        return reason
    reason = backend.refuses(scene, quantity)
    if reason is None:
        return None
    others = supporting_backends(scene, quantity, without=backend.name)
    there = f"backends that take it: {', '.join(others)}" if others else "no other backend takes it"
    return f"{reason}; {there}"
