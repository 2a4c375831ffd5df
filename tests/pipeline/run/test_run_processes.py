"""Runs in processes of their own, with nothing faked: the same bits for any number of workers, and death at
any moment.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from pipeline.run.driver import run_sweep
from pipeline.run.executors.local import LocalExecutor
from pipeline.schema.sweep import parse_sweep
from pipeline.store.run_folder import load_run
from pipeline.store.sealed_folder import damage
from tests.kit.fakes import Recorder
from tests.pipeline.run.test_local_executor import PATIENCE, ROOT, alive, wait_until

SWEEP = """
title = "processes"
[[study]]
name = "gap"
scenes = ["touching-light"]
metrics = ["mse"]
over = "gap"
reference = { backend = "closed-form" }
[study.axes]
estimator = ["area", "solid-angle"]
spp = [SPP]
seeds = 3
parameters = { gap = [1, 0.1], xresolution = [24], yresolution = [18] }
"""
CELLS = 12


@pytest.fixture
def sweep(tmp_path: Path) -> Path:
    """Each cell of it takes a few tenths of a second: time to be interrupted in."""
    path = tmp_path / "sweep.toml"
    path.write_text(SWEEP.replace("SPP", "1024"))
    return path


def command(sweep: Path, out: Path) -> list[str]:
    return [sys.executable, "-m", "pipeline.cli", "run", str(sweep), "--out", str(out), "--workers", "2"]


def finish(sweep: Path, out: Path) -> str:
    done = subprocess.run(command(sweep, out), cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@contextmanager
def started(sweep: Path, out: Path, cells: int) -> Iterator[subprocess.Popen[str]]:
    """A run in a session of its own, once it has finished so many cells."""
    with subprocess.Popen(
        command(sweep, out),
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as run:
        assert wait_until(lambda: len(finished(out)) >= cells or run.poll() is not None)
        yield run
        if run.poll() is None:
            os.killpg(run.pid, signal.SIGKILL)


def finished(out: Path) -> dict[str, int]:
    cells = out / "cells"
    return {path.name: path.stat().st_mtime_ns for path in cells.iterdir()} if cells.is_dir() else {}


def children(pid: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


@pytest.mark.usefixtures("processes")
def test_a_run_killed_at_work_resumes_with_what_is_missing(sweep: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    with started(sweep, out, cells=3) as run:
        workers = children(run.pid)
        run.kill()
        run.wait(PATIENCE)
        assert wait_until(lambda: not any(alive(pid) for pid in workers))
        before = finished(out)
    assert 0 < len(before) < CELLS
    assert not any(damage(out / "cells" / key) for key in before)
    assert f"{CELLS - len(before)} cells" in finish(sweep, out)
    assert before.items() <= finished(out).items(), "a finished cell was rendered again"
    (study,) = load_run(out).studies
    assert (len(study.cells), study.missing) == (CELLS, 0)
    assert all(cell.card for cell in study.cells)
    assert not (out / ".scratch").exists()


@pytest.mark.usefixtures("processes")
def test_ctrl_c_keeps_what_is_finished_and_leaves_no_process(sweep: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    with started(sweep, out, cells=3) as run:
        workers = children(run.pid)
        os.killpg(run.pid, signal.SIGINT)  # as a terminal sends it: to workers too
        _, said = run.communicate(timeout=PATIENCE)
        assert wait_until(lambda: not any(alive(pid) for pid in workers))
    assert run.returncode == 130
    assert (
        said.strip().splitlines()[-1]
        == f"stopped: what was finished is kept in {out}; the same command goes on from there"
    )
    assert "Traceback" not in said
    assert 3 <= len(finished(out)) < CELLS
    assert not any(damage(out / "cells" / key) for key in finished(out))


@pytest.mark.usefixtures("processes")
def test_bits_do_not_depend_on_the_number_of_workers(tmp_path: Path) -> None:
    sweep = parse_sweep(SWEEP.replace("SPP", "16"), "sweep.toml", tmp_path)
    films: list[dict[str, bytes]] = []
    for workers in (1, 2):
        root = tmp_path / str(workers)
        with LocalExecutor(workers) as executor:
            assert not run_sweep("sweep.toml", sweep, root, executor, Recorder()).failures
        films.append({path.parent.name: path.read_bytes() for path in root.glob("cells/*/state.npz")})
    assert len(films[0]) == CELLS
    assert films[0] == films[1]
