"""A reference backend of nothing but noise, and a scene for it: batches of uniform numbers, each a function
of its number.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Generator
from pathlib import Path

import numpy as np
import pytest

from pipeline.references import cache, protocol
from pipeline.references.batches import Batches, accumulate, to_image
from pipeline.references.cache import StoredReference, reference_for
from pipeline.references.protocol import (
    Continuation,
    Image,
    Progress,
    Quantity,
    ReferenceImage,
    ReferenceRequest,
)
from scenes.description.materials import Diffuse
from scenes.description.scene import SceneDescription
from tests.kit.mitsuba_scenes import above, floor, rectangle, scene, shape, vector

REQUEST = ReferenceRequest(spp=8, batches=4, seed=3)


def small(albedo: float = 0.5) -> SceneDescription:
    """6 x 5 pixels of a floor under a light."""
    light = shape(rectangle(vector(0, 2, 0), vector(1, 0, 0), vector(0, 0, 1)), 0.0, (1, 2, 3))
    ground = dataclasses.replace(floor(), material=Diffuse(np.full(3, albedo)))
    return scene([ground, light], *above(vector(0.1, 0, 0.2), 0.5), 6, 5)


class FakeBackend:
    """Counts its renders and notes the sizes of the batches it draws; `during` runs before each batch."""

    name = "fake"

    def __init__(self, during: Callable[[], None] = lambda: None) -> None:
        self.renders = 0
        self.drawn: list[int] = []
        self.revision = "1"
        self.during = during

    def version(self) -> str:
        return self.revision

    def refuses(self, scene: SceneDescription, quantity: Quantity = "radiance") -> str | None:
        return "it is too small" if scene.film.width < 2 else None

    def render(
        self,
        scene: SceneDescription,
        request: ReferenceRequest,
        progress: Progress | None = None,
        continuation: Continuation | None = None,
    ) -> ReferenceImage:
        self.renders += 1

        def draw(wanted: Batches) -> Generator[Image]:
            for number in range(wanted.first, wanted.first + wanted.count):
                self.during()
                self.drawn.append(wanted.spp)
                size = (wanted.spp, scene.film.height, scene.film.width, 3)
                yield np.random.default_rng(number).random(size).mean(axis=0)

        accumulator = accumulate(draw, scene.film, request, 1000, continuation, progress)
        return to_image(accumulator, {"note": "\u03bb = 1"})


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeBackend:
    """The only backend there is."""
    backend = FakeBackend()
    monkeypatch.setattr(cache, "BACKENDS", {"fake": backend})
    monkeypatch.setattr(protocol, "BACKENDS", {"fake": backend})
    return backend


def ask(
    root: Path, given: SceneDescription | None = None, request: ReferenceRequest = REQUEST
) -> StoredReference:
    """The fake's reference from the cache in `root`."""
    return reference_for(given or small(), "fake", request, root)
