"""Workers in processes of their own: their command, their environment, and the end of their output."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]  # holds the packages, installed or not


def worker_command(module: str, folder: Path) -> list[str]:
    """The command that runs a worker module on the task in a folder."""
    # -P keeps packages of the current folder from hiding ours.
    return [sys.executable, "-P", "-m", module, str(folder)]


def worker_environment(**variables: str) -> dict[str, str]:
    """This process's environment, with our packages importable and `variables` set."""
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    return os.environ | {"PYTHONPATH": path} | variables


def attempt(
    command: Sequence[str], seconds: int, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str] | str:
    """Run a command, capturing its output; returns the finished process, or in words why there is none."""
    try:
        return subprocess.run(
            command, capture_output=True, text=True, timeout=seconds, check=False, env=environment
        )
    except subprocess.TimeoutExpired:
        return f"no answer in {seconds} s"
    except OSError as error:
        return str(error.strerror)


def last_words(text: str, lines: int = 4) -> str:
    """The last lines of a process's output, joined to one; empty if it wrote nothing."""
    return " | ".join([line.strip() for line in text.splitlines() if line.strip()][-lines:])
