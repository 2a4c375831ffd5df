"""A test that starts a process unmarked fails, and PENUMBRA_FAST=1 leaves out the marked ones."""

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

def test_by_opengl():
    import OpenGL

def test_by_browser():
    import playwright

def test_without_a_process():
    pass

def test_that_asks_for_the_commit():
    subprocess.run(["git", "--version"], check=True)

def test_marked_process(processes):
    subprocess.run([sys.executable, "-c", ""], check=True)

def test_marked_mitsuba(mitsuba):
    import mitsuba

def test_marked_opengl(opengl):
    import OpenGL

def test_marked_statistical(statistical):
    pass
"""


@pytest.mark.parametrize(
    ("fast", "outcome"),
    [("1", "6 failed, 2 passed, 4 deselected"), ("0", "6 failed, 6 passed")],
    ids=["fast", "whole"],
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
    for fixture, failed in {"processes": 3, "mitsuba": 1, "opengl": 1, "browser": 1}.items():
        assert done.stdout.count(f"let it request the fixture `{fixture}`") >= failed
