"""What a reference backend is asked and what it answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from scenes.description import SceneDescription
from scenes.registry import Registry

Image = NDArray[np.float64]
Progress = Callable[[float], None]  # the share done, 0..1


@dataclass(frozen=True)
class ReferenceRequest:
    """spp: samples a pixel in all, dealt to `batches` runs of different seeds, from whose spread the variance comes."""

    spp: int = 4096
    batches: int = 64
    seed: int = 0


@dataclass(frozen=True, eq=False)
class ReferenceImage:
    """mean, variance (of the mean): (h, w, 3) float64; provenance: what made it, as strings."""

    mean: Image
    variance: Image
    spp: int
    batches: int
    seconds: float
    provenance: dict[str, str]


@runtime_checkable
class ReferenceBackend(Protocol):
    """One way of making reference images."""

    name: str

    def version(self) -> str:
        """Everything about the backend that its images depend on: it goes into the cache key."""
        ...

    def refuses(self, scene: SceneDescription) -> str | None:
        """Why the scene is out of its reach, in one sentence, or None."""
        ...

    def render(
        self, scene: SceneDescription, request: ReferenceRequest, progress: Progress | None = None
    ) -> ReferenceImage:
        """The reference. PenumbraError where it refuses or fails."""
        ...


BACKENDS: Registry[ReferenceBackend] = Registry("reference backend", "pipeline.references")
