"""Mitsuba 3 as a reference: the parent's side. Rendering is in `mitsuba_worker`, in a process of its own.

Batches of different seeds, accumulated in float64: the spread of their means gives the variance of the mean, which
nothing inside one Mitsuba render does; and more than about 10,000 samples a pixel in one call lose float32's precision.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import os
import pickle
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.references import mitsuba_limits, mitsuba_scene, mitsuba_worker
from pipeline.references.mitsuba_worker import PROGRESS, RESULT, TASK, Task
from pipeline.references.protocol import BACKENDS, Progress, ReferenceImage, ReferenceRequest
from scenes.description import (
    Array,
    Diffuse,
    Disk,
    Emission,
    Film,
    PerspectiveCamera,
    SceneDescription,
    ShapeDescription,
)
from scenes.errors import PenumbraError, SceneError

VARIANTS = ("llvm_ad_rgb", "scalar_rgb")  # by preference: the first is six times as fast here
SPP_A_CALL = 10_000
SAMPLES_A_CALL = 2**24  # of all pixels together; measured, one such call takes 0.3 GB
MOST_LIFT = 0.25  # pixels; a shadow's edge may be that far off
BLOCK = 32 * 32  # the scalar variant counts seeds in blocks of this many pixels


@dataclass(frozen=True)
class Probe:
    """What trying one variant gave: `detail` is its LLVM and time, or why it failed."""

    variant: str
    ok: bool
    detail: str


@dataclass(frozen=True, eq=False)
class _Result:
    """What a worker leaves: mean, m2 (h, w, 3); lift in pixels; seconds of rendering."""

    mean: Array
    m2: Array
    lift: float
    seconds: float


class MitsubaBackend:
    """Direct light by multiple importance sampling, lights visible, box filter: what pbrt's `path` with maxdepth 1 gives."""

    name = "mitsuba"

    def version(self) -> str:
        """Mitsuba's version, the variant that works here, and a hash of the code that converts and renders."""
        sources = (mitsuba_scene.__file__, mitsuba_worker.__file__, __file__)
        digest = hashlib.sha256(b"".join(Path(source).read_bytes() for source in sources)).hexdigest()[:16]
        return f"mitsuba {importlib.metadata.version('mitsuba')} {working_variant()} {digest}"

    def refuses(self, scene: SceneDescription) -> str | None:
        """No lights, two-sided lights, a camera or a patch without counterpart, or a gap that Mitsuba's rays overlook."""
        try:
            return mitsuba_limits.reason(scene)
        except SceneError as error:
            return str(error)

    def render(
        self, scene: SceneDescription, request: ReferenceRequest, progress: Progress | None = None
    ) -> ReferenceImage:
        """Render at least `request.spp` samples a pixel, rounded up to whole batches; PenumbraError if refused or if Mitsuba fails."""
        refusal = self.refuses(scene)
        if refusal:
            raise PenumbraError(f"scene {scene.name}: {refusal}")
        variant, start = working_variant(), time.perf_counter()
        task = _plan(scene, request, variant)
        result = _run(task, progress)
        spp = task.batches * task.passes * task.spp
        return ReferenceImage(
            mean=result.mean,
            variance=result.m2 / (task.batches * (task.batches - 1)),
            spp=spp,
            batches=task.batches,
            seconds=time.perf_counter() - start,
            provenance={
                "backend": self.name,
                "version": self.version(),
                "variant": variant,
                "integrator": "direct, 1 emitter and 1 BSDF sample, MIS",
                "seed": str(request.seed),
                "passes": f"{task.batches} batches x {task.passes} calls x {task.spp} spp",
                "render_seconds": f"{result.seconds:.3f}",
                "ray_lift": f"{result.lift:.2g} pixels at most",
            },
        )


def probe_variants() -> list[Probe]:
    """Try every variant, each by a tiny render in a process of its own."""
    return [_probe(variant) for variant in VARIANTS]


def working_variant() -> str:
    """The fastest variant that works here, found out once a process; PenumbraError with the reasons if none does."""
    failures: list[str] = []
    for variant in VARIANTS:
        probe = _probe(variant)
        if probe.ok:
            return variant
        failures.append(f"{variant}: {probe.detail}")
    raise PenumbraError(f"Mitsuba does not work here: {'; '.join(failures)}")


def llvm_library() -> str | None:
    """The LLVM that Dr.Jit shall use: DRJIT_LIBLLVM_PATH where it is set, else the one of the wheel karellen-llvm-core."""
    if os.environ.get("DRJIT_LIBLLVM_PATH"):
        return os.environ["DRJIT_LIBLLVM_PATH"]
    try:
        files = importlib.metadata.files("karellen-llvm-core") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    found = sorted(Path(str(file.locate())).resolve() for file in files if file.name in ("libLLVM.so", "libLLVM.dylib"))
    return str(found[0]) if found else None


@functools.cache
def _probe(variant: str) -> Probe:
    start = time.perf_counter()
    try:
        mean = _run(_plan(_probe_scene(), ReferenceRequest(spp=2, batches=2), variant), None).mean
    except PenumbraError as error:
        return Probe(variant, False, str(error))
    # The disk fills the view: every pixel reads its radiance.
    if not np.allclose(mean, (1.0, 2.0, 3.0), rtol=1e-5):
        return Probe(variant, False, f"reads {mean.mean(axis=(0, 1))} where the radiance is 1, 2, 3")
    llvm = f"LLVM {llvm_library() or 'found by Dr.Jit'}; " if variant.startswith("llvm") else ""
    return Probe(variant, True, f"{llvm}start and a tiny render took {time.perf_counter() - start:.1f} s")


def _probe_scene() -> SceneDescription:
    disk = Disk(center=np.array([0.0, 0.0, 1.0]), normal=np.array([0.0, 0.0, -1.0]), radius=2.0)
    light = ShapeDescription(disk, Diffuse(np.full(3, 0.5)), Emission(np.array([1.0, 2.0, 3.0])))
    return SceneDescription("probe", PerspectiveCamera(np.eye(4), 60.0), Film(8, 8), (light,))


def _plan(scene: SceneDescription, request: ReferenceRequest, variant: str) -> Task:
    """Whole batches of equal calls, each small enough for float32 and for memory, each with a seed of its own."""
    if request.batches < 2:
        raise PenumbraError("a Mitsuba reference needs at least 2 batches: its variance comes from their spread")
    pixels = scene.film.width * scene.film.height
    wanted = -(-request.spp // request.batches)
    most = SPP_A_CALL if variant.startswith("scalar") else max(1, min(SPP_A_CALL, SAMPLES_A_CALL // pixels))
    passes = -(-wanted // most)
    seeds = _seeds(request, passes, scene.film, variant)
    return Task(variant, mitsuba_scene.convert(scene), request.batches, passes, -(-wanted // passes), seeds)


def _seeds(request: ReferenceRequest, passes: int, film: Film, variant: str) -> tuple[int, ...]:
    """One 32-bit seed a call, drawn without replacement.

    The LLVM variant hashes seeds: any that differ will do. The scalar variant does not. It gives pixel i of a call the
    stream seed * pixels + i, counting in whole blocks, of which there are more pixels than the image has: neighbouring
    seeds share streams, so that a slot of `stride` seeds holds one. And streams whose numbers are evenly spaced are
    lattices of one generator: measured, evenly spaced seeds made the spread of the batches overstate the variance by 14 %.
    """
    pixels = film.width * film.height
    blocks = -(-film.width // 32) * -(-film.height // 32)
    stride = -(-blocks * BLOCK // pixels)
    scalar, count = variant.startswith("scalar"), request.batches * passes
    slots = 2**32 // (stride * pixels) if scalar else 2**32
    if slots < count:
        raise PenumbraError(
            f"{film.width} x {film.height} pixels are too many for {count} calls of Mitsuba's {variant}"
        )
    drawn = np.random.default_rng(request.seed).choice(slots, count, replace=False)
    return tuple(int(slot) * (stride if scalar else 1) for slot in drawn)


def _run(task: Task, progress: Progress | None) -> _Result:
    """Hand the task to a worker and wait; PenumbraError with the worker's last lines if it fails, or if its image is not to be trusted."""
    with tempfile.TemporaryDirectory(prefix="penumbra-mitsuba-") as name:
        folder = Path(name)
        (folder / TASK).write_bytes(pickle.dumps(task))
        with (folder / "stderr.txt").open("w+") as stderr:
            code, said = _watch(_command(folder), stderr.fileno(), progress)
            stderr.seek(0)
            lines = [line.strip() for line in (*said, *stderr.readlines()) if line.strip()]
        if code != 0:
            raise PenumbraError(
                f"Mitsuba ({task.variant}) failed with code {code}: {' | '.join(lines[-4:]) or 'it said nothing'}"
            )
        with np.load(folder / RESULT) as arrays:
            result = _Result(arrays["mean"], arrays["m2"], float(arrays["lift"]), float(arrays["seconds"]))
    broken = int(np.count_nonzero(~np.isfinite(result.mean)))
    if broken:
        raise PenumbraError(
            f"Mitsuba ({task.variant}) gave {broken} non-finite values: no reference can be made of them"
        )
    if result.lift > MOST_LIFT:
        raise PenumbraError(
            f"Mitsuba's rays start up to {result.lift:.2g} pixels off the surfaces in view (at most {MOST_LIFT} is accepted): "
            "this view is too close, or too far from the lights, for its float32; use the closed-form reference"
        )
    return result


def _command(folder: Path) -> list[str]:
    return [sys.executable, "-m", mitsuba_worker.__name__, str(folder)]


def _watch(command: list[str], stderr: int, progress: Progress | None) -> tuple[int, list[str]]:
    """Run `command`, passing its progress lines on; returns its exit code and the other lines it printed."""
    path = (str(Path(mitsuba_worker.__file__).parents[2]), os.environ.get("PYTHONPATH", ""))
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, path))}
    library = llvm_library()
    if library:
        environment["DRJIT_LIBLLVM_PATH"] = library
    said: list[str] = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, text=True, env=environment) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                if not line.startswith(PROGRESS):
                    said.append(line)
                elif progress:
                    progress(float(line.split()[1]))
        except BaseException:
            process.kill()
            raise
    return process.returncode, said


BACKENDS.add("mitsuba", MitsubaBackend())
