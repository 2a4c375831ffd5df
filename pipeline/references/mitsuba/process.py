"""Mitsuba's worker process: start it on a task and yield the batches that it renders."""

from __future__ import annotations

import importlib.metadata
import os
import pickle
import subprocess
import tempfile
from collections.abc import Generator
from pathlib import Path

import numpy as np

from pipeline.references.mitsuba import worker as mitsuba_worker
from pipeline.references.mitsuba.worker import BATCH, LIFT, TASK, Task, batch_file
from pipeline.references.protocol import Image
from pipeline.references.subprocesses import last_words, worker_command, worker_environment
from scenes.errors import PenumbraError

MOST_LIFT = 0.25  # pixels: the error of a shadow's edge that is accepted


def llvm_library() -> str | None:
    """The path of the LLVM library for Dr.Jit: DRJIT_LIBLLVM_PATH, else that of the wheel
    karellen-llvm-core.
    """
    if os.environ.get("DRJIT_LIBLLVM_PATH"):
        return os.environ["DRJIT_LIBLLVM_PATH"]
    try:
        files = importlib.metadata.files("karellen-llvm-core") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    found = sorted(
        Path(str(file.locate())).resolve() for file in files if file.name in ("libLLVM.so", "libLLVM.dylib")
    )
    return str(found[0]) if found else None


def command(folder: Path) -> list[str]:
    """The command that renders the task in `folder`."""
    return worker_command(mitsuba_worker.__name__, folder)


def run_task(task: Task) -> Generator[Image]:
    """Yield the batches (h, w, 3) of a task as they are finished; the worker ends with the generator.

    PenumbraError with the worker's last lines if it fails, and if rays start too far off the surfaces in
    view.
    """
    with tempfile.TemporaryDirectory(prefix="penumbra-mitsuba-") as name:
        folder = Path(name)
        (folder / TASK).write_bytes(pickle.dumps(task))
        with (folder / "stderr.txt").open("w+") as stderr:
            said: list[str] = []
            with subprocess.Popen(
                command(folder), stdout=subprocess.PIPE, stderr=stderr, text=True, env=_environment()
            ) as process:
                try:
                    yield from _batches(process, folder, said)
                except BaseException:
                    process.kill()
                    raise
            stderr.seek(0)
            last = last_words("".join(said) + stderr.read()) or "it said nothing"
        if process.returncode != 0:
            raise PenumbraError(f"Mitsuba ({task.variant}) failed with code {process.returncode}: {last}")


def _batches(process: subprocess.Popen[str], folder: Path, said: list[str]) -> Generator[Image]:
    """Yield each image that the worker announces by a line; its other lines go to `said`."""
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith(BATCH):
            path = batch_file(folder, int(line.split()[1]))
            image = np.load(path).astype(np.float64)
            path.unlink()
            yield image
        elif line.startswith(LIFT):
            _check_lift(float(line.split()[1]))
        else:
            said.append(line)


def _check_lift(lift: float) -> None:
    if lift > MOST_LIFT:
        raise PenumbraError(
            f"Mitsuba's rays start up to {lift:.2g} pixels off the surfaces in view "
            f"(at most {MOST_LIFT} is accepted): this view is too close, "
            "or too far from the lights, for its float32"
        )


def _environment() -> dict[str, str]:
    library = llvm_library()
    return worker_environment(**({"DRJIT_LIBLLVM_PATH": library} if library else {}))
