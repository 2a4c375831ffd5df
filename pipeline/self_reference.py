"""The renderer's own best estimator at many samples, as a reference for scenes that no other backend takes.

It shares the renderer with the images that it judges: a fault of camera, geometry or materials is in both,
and not in their difference. It lies outside `pipeline.references`, which never sees the renderer, and is
never the reference of its own estimator.
"""

from __future__ import annotations

import os
from collections.abc import Generator
from pathlib import Path

import numpy as np

from pipeline.references.batches import Batches, accumulate, to_image
from pipeline.references.protocol import (
    BACKENDS,
    Continuation,
    Image,
    Progress,
    Quantity,
    ReferenceImage,
    ReferenceRequest,
    require,
    unlit,
)
from pipeline.store.keys import imported_code
from renderer import build, fingerprint, render
from renderer.interfaces.estimator import ESTIMATORS
from scenes.description.scene import SceneDescription

NAME = "self"
ESTIMATOR_OF: dict[Quantity, str] = {"radiance": "mis", "ambient-occlusion": "ambient-occlusion"}
SPP_A_BATCH = 4096
SERIES = 0x5E1F  # sets the seeds of batches apart from any that a cell has


class SelfBackend:
    """Our own best estimator (mis; light by solid angle where it can be) at many samples: no independent
    check of the renderer.
    """

    name = NAME

    def version(self) -> str:
        """The renderer's sources, and a hash of the code that draws its batches and adds them up."""
        return f"penumbra {fingerprint()} {imported_code(Path(__file__))}"

    def refuses(self, scene: SceneDescription, quantity: Quantity = "radiance") -> str | None:
        """The estimator's own reason, or that no estimator has the quantity."""
        estimator = ESTIMATOR_OF[quantity]
        if estimator not in ESTIMATORS.names():
            return f"there is no estimator of {quantity} here"
        if quantity == "radiance" and (why := unlit(scene)):
            return why
        return ESTIMATORS[estimator].refuses(scene)

    def render(
        self,
        scene: SceneDescription,
        request: ReferenceRequest,
        progress: Progress | None = None,
        continuation: Continuation | None = None,
    ) -> ReferenceImage:
        require(self, scene, request.quantity)
        built, estimator = build(scene), ESTIMATOR_OF[request.quantity]

        def draw(wanted: Batches) -> Generator[Image]:
            for number in range(wanted.first, wanted.first + wanted.count):
                seed, cores = batch_seed(request.seed, number), os.cpu_count() or 1
                yield render(built, estimator=estimator, spp=wanted.spp, seed=seed, threads=cores).image

        accumulator = accumulate(draw, scene.film, request, SPP_A_BATCH, continuation, progress)
        provenance = {
            "backend": self.name,
            "version": self.version(),
            "estimator": estimator,
            "sampler": "independent",
            "independence": "none: made by the renderer under test",
            "seeds": f"batch k: SeedSequence([{SERIES:#x}, {request.seed}, k])",
        }
        return to_image(accumulator, provenance)


def batch_seed(seed: int, number: int) -> int:
    """The renderer's seed for batch `number` of a series: 2^63 or more, where no cell's seed is."""
    return int(np.random.SeedSequence([SERIES, seed, number]).generate_state(1, np.uint64)[0]) | 2**63


def judges_itself(backend: str, estimator: str) -> str | None:
    """Why images by `estimator` cannot be scored against references of `backend`; None if they can."""
    if backend != NAME or estimator not in ESTIMATOR_OF.values():
        return None
    return (
        f"the reference {backend!r} is made by {estimator!r} itself, and what they have in common it "
        "cannot see"
    )


BACKENDS.add(NAME, SelfBackend())
