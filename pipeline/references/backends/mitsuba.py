"""Mitsuba 3 as a reference: this process's side; mitsuba/worker.py renders in a process of its own.

Batches of different seeds are accumulated in float64. The spread of their means gives the variance of the
mean, which no single Mitsuba render does; and more than about 10,000 samples a pixel in one call lose
float32's precision.
"""

from __future__ import annotations

import functools
import importlib.metadata
import time
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.references.ambient import ambient_scene
from pipeline.references.batches import Batches, accumulate, to_image
from pipeline.references.mitsuba import limits as mitsuba_limits
from pipeline.references.mitsuba import scene as mitsuba_scene
from pipeline.references.mitsuba.process import llvm_library, run_task
from pipeline.references.mitsuba.seeds import seeds_for
from pipeline.references.mitsuba.worker import MitsubaScene, Task
from pipeline.references.protocol import (
    BACKENDS,
    Continuation,
    Image,
    Progress,
    Quantity,
    ReferenceImage,
    ReferenceRequest,
    require,
)
from pipeline.store.keys import imported_code
from scenes.description.materials import Diffuse
from scenes.description.scene import Film, PerspectiveCamera, SceneDescription
from scenes.description.shapes import BilinearMesh, Emission, ShapeDescription
from scenes.errors import PenumbraError, SceneError

VARIANTS = ("llvm_ad_rgb", "scalar_rgb")  # by preference: the first is six times as fast here
SPP_A_CALL = 10_000
SAMPLES_A_CALL = 2**24  # of all pixels together; measured, one such call takes 0.3 GB


@dataclass(frozen=True)
class Probe:
    """The outcome of trying one variant. detail: its LLVM and time, or the reason of its failure."""

    variant: str
    ok: bool
    detail: str


class MitsubaBackend:
    """Direct light by multiple importance sampling, lights visible, as pbrt's `path` with maxdepth 1."""

    name = "mitsuba"

    def version(self) -> str:
        """Mitsuba's version, the variant that works here, and a hash of the code that converts and
        renders.
        """
        version = importlib.metadata.version("mitsuba")
        return f"mitsuba {version} {working_variant()} {imported_code(Path(__file__))}"

    def refuses(self, scene: SceneDescription, quantity: Quantity = "radiance") -> str | None:
        if quantity == "ambient-occlusion" and np.isfinite(scene.occlusion_distance):
            return (
                "Mitsuba has no ambient occlusion that ends, and this scene's does, after "
                f"{scene.occlusion_distance:g}"
            )
        try:
            return mitsuba_limits.reason(_what_to_render(scene, quantity))
        except SceneError as error:
            return str(error)

    def render(
        self,
        scene: SceneDescription,
        request: ReferenceRequest,
        progress: Progress | None = None,
        continuation: Continuation | None = None,
    ) -> ReferenceImage:
        require(self, scene, request.quantity)
        converted = mitsuba_scene.convert(_what_to_render(scene, request.quantity))
        variant = working_variant()

        def draw(wanted: Batches) -> Generator[Image]:
            seeds = seeds_for(request.seed, scene.film, variant, wanted.first, wanted.count)
            hidden = request.quantity == "ambient-occlusion"
            return run_task(Task(variant, converted, wanted.spp, seeds, hide_lights=hidden))

        accumulator = accumulate(
            draw, scene.film, request, most_spp(scene.film, variant), continuation, progress
        )
        return to_image(accumulator, self._provenance(converted, request, variant))

    def _provenance(self, converted: MitsubaScene, request: ReferenceRequest, variant: str) -> dict[str, str]:
        sky = (
            ", white surfaces under a white sky that is hidden"
            if request.quantity == "ambient-occlusion"
            else ""
        )
        return {
            "backend": self.name,
            "version": self.version(),
            "variant": variant,
            "integrator": f"direct, 1 emitter and 1 BSDF sample, MIS{sky}",
            "seeds": (
                f"batch k: number k of numpy's default_rng({request.seed}), without replacement "
                "(mitsuba/seeds.py)"
            ),
        } | converted.notes


def _what_to_render(scene: SceneDescription, quantity: Quantity) -> SceneDescription:
    return ambient_scene(scene) if quantity == "ambient-occlusion" else scene


def most_spp(film: Film, variant: str) -> int:
    """The most samples a pixel in one call that float32 and the memory allow."""
    if variant.startswith("scalar"):
        return SPP_A_CALL
    return max(1, min(SPP_A_CALL, SAMPLES_A_CALL // (film.width * film.height)))


def probe_variants() -> list[Probe]:
    """Try every variant, each by a tiny render in a process of its own."""
    return [_probe(variant) for variant in VARIANTS]


def working_variant() -> str:
    """The fastest variant that works here, tried once a process; PenumbraError with the reasons if none."""
    failures: list[str] = []
    for variant in VARIANTS:
        probe = _probe(variant)
        if probe.ok:
            return variant
        failures.append(f"{variant}: {probe.detail}")
    raise PenumbraError(f"Mitsuba does not work here: {'; '.join(failures)}")


@functools.cache
def _probe(variant: str) -> Probe:
    start, scene = time.perf_counter(), _probe_scene()
    try:
        seeds = seeds_for(0, scene.film, variant, 0, 1)
        (image,) = run_task(Task(variant, mitsuba_scene.convert(scene), 4, seeds))
    except PenumbraError as error:
        return Probe(variant, False, str(error))
    # The wall fills the view: every pixel reads its radiance.
    if not np.allclose(image, (1.0, 2.0, 3.0), rtol=1e-5):
        return Probe(variant, False, f"reads {image.mean(axis=(0, 1))} where the radiance is 1, 2, 3")
    llvm = f"LLVM {llvm_library() or 'found by Dr.Jit'}; " if variant.startswith("llvm") else ""
    return Probe(variant, True, f"{llvm}start and a tiny render took {time.perf_counter() - start:.1f} s")


def _probe_scene() -> SceneDescription:
    corners = np.array([[-2.0, -2.0, 1.0], [-2.0, 2.0, 1.0], [2.0, -2.0, 1.0], [2.0, 2.0, 1.0]])
    wall = BilinearMesh(corners, np.arange(4)[None])
    light = ShapeDescription(wall, Diffuse(np.full(3, 0.5)), Emission(np.array([1.0, 2.0, 3.0])))
    return SceneDescription("probe", PerspectiveCamera(np.eye(4), 60.0), Film(8, 8), (light,))


BACKENDS.add("mitsuba", MitsubaBackend())
