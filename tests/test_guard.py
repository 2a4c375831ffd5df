"""PENUMBRA_FAST=1 fails a test that starts a process, unless a fixture says that it does."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
STARTS = """
import multiprocessing, os, subprocess, sys

def test_by_subprocess():
    subprocess.run([sys.executable, "-c", ""])

def test_by_multiprocessing():
    try:
        multiprocessing.get_context("spawn").Process(target=print).start()
    except Exception:
        pass

def test_by_fork():
    os.fork() or os._exit(0)

def test_by_mitsuba():
    import mitsuba

def test_without_a_process():
    pass

def test_marked(processes):
    subprocess.run([sys.executable, "-c", ""], check=True)
"""


@pytest.mark.parametrize(
    ("fast", "outcome"), [("1", "4 failed, 1 passed, 1 deselected"), ("0", "6 passed")], ids=["fast", "whole"]
)
def test_a_start_of_a_process_fails_unless_a_fixture_marks_it(
    fast: str, outcome: str, tmp_path: Path, processes: None
) -> None:
    (tmp_path / "test_starts.py").write_text(STARTS, encoding="utf-8")
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "no:xdist",
        "-p",
        "tests.conftest",
        "-p",
        "no:cacheprovider",
    ]
    command += ["-c", str(ROOT / "pyproject.toml"), f"--rootdir={tmp_path}", "-q", str(tmp_path)]
    environment = os.environ | {"PENUMBRA_FAST": fast}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300)
    assert f"{outcome} in " in done.stdout, done.stdout[-3000:]
    assert done.stdout.count("let it request the fixture `processes`") >= (4 if fast == "1" else 0)
