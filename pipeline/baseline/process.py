"""The baseline's worker process: start it on some scenes and read its images."""

from __future__ import annotations

import pickle
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.baseline import worker
from pipeline.baseline.entry import REMEDY
from pipeline.baseline.scene import convert
from pipeline.baseline.task import Array, Task
from pipeline.baseline.worker import TASKS, result_file
from pipeline.extras import require_extra, version_of
from pipeline.references.subprocesses import attempt, last_words, worker_command, worker_environment
from pipeline.store.npz import from_npz
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError

PLATFORMS = ("egl", "osmesa")  # OpenGL without a screen, in the order in which they are tried
SECONDS = 600

_Found = dict[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Raster:
    """An image that pyrender drew.

    image: (h, w, 3) linear radiance. depth: (h, w), along the view in the scene's units, infinite in the
    background. near, far: depths of the clipping planes. seconds, cpu: of drawing and reading back, warm.
    seconds_convert: of making triangles. seconds_process: this picture's share of the whole process.
    """

    image: Array
    depth: Array
    near: float
    far: float
    seconds: float
    cpu: float
    seconds_convert: float
    seconds_process: float
    provenance: dict[str, str]


def rasterise(scenes: Sequence[SceneDescription]) -> list[Raster]:
    """Draw scenes without shadows, a point in place of each area light, one sample in each pixel's middle.

    One process draws them all: its start takes a second or two, a picture a few hundredths. PenumbraError
    if the extra is missing, a scene is refused, or OpenGL does not work here.
    """
    require_extra("baseline")
    start = time.perf_counter()
    tasks = tuple(convert(scene) for scene in scenes)
    converted = time.perf_counter()
    found, platform = _run(tasks)
    shared = (converted - start) / len(tasks), (time.perf_counter() - converted) / len(tasks)
    return [_raster(task, one, platform, *shared) for task, one in zip(tasks, found, strict=True)]


def _raster(task: Task, found: _Found, platform: str, converting: float, process: float) -> Raster:
    return Raster(
        image=found["image"].astype(np.float64),
        depth=found["depth"].astype(np.float64) * task.unit,
        near=float(found["near"]) * task.unit,
        far=float(found["far"]) * task.unit,
        seconds=float(found["seconds"]),
        cpu=float(found["cpu"]),
        seconds_convert=converting,
        seconds_process=process,
        provenance=versions() | {"device": str(found["device"]), "platform": platform},
    )


def versions() -> dict[str, str]:
    """Versions of the libraries that the image depends on."""
    return {"pyrender": version_of("pyrender"), "pyopengl": version_of("OpenGL")}


def _run(tasks: tuple[Task, ...]) -> tuple[list[_Found], str]:
    """The worker's results and its platform; PenumbraError with each platform's last words if none works."""
    said: list[str] = []
    with tempfile.TemporaryDirectory(prefix="penumbra-pyrender-") as name:
        folder = Path(name)
        (folder / TASKS).write_bytes(pickle.dumps(tasks))
        for platform in PLATFORMS:
            failure = _try(folder, platform)
            if failure is None:
                found = (result_file(folder, number).read_bytes() for number in range(len(tasks)))
                return [from_npz(content) for content in found], platform
            said.append(f"{platform}: {failure}")
    raise PenumbraError(f"pyrender cannot draw here ({'; '.join(said)}); {REMEDY}")


def _try(folder: Path, platform: str) -> str | None:
    """Draw on a platform of OpenGL; returns the worker's last words if that fails."""
    # One thread of Mesa's llvmpipe, as for all times of a run.
    environment = worker_environment(PYOPENGL_PLATFORM=platform, LP_NUM_THREADS="0")
    done = attempt(worker_command(worker.__name__, folder), SECONDS, environment)
    if isinstance(done, str):
        return done
    if done.returncode == 0:
        return None
    return last_words(done.stderr, lines=1) or f"ended with code {done.returncode}"
