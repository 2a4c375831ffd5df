"""Provenance of a record: the versions, the commit and the machine that made it, and the time."""

from __future__ import annotations

import functools
import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from pipeline.schema.record import Provenance
from pipeline.store.machine import machine
from scenes.hashing import versions

PACKAGES = (
    "numpy",
    "scipy",
    "embreex",
    "trimesh",
    "mitsuba",
    "openimageio",
    "scikit-image",
    "flip-evaluator",
)


def provenance() -> Provenance:
    """The provenance of this process, now."""
    return _of_this_process().model_copy(update={"created": datetime.now(UTC).isoformat(timespec="seconds")})


@functools.cache
def _of_this_process() -> Provenance:
    from renderer import fingerprint

    return Provenance(
        penumbra=metadata.version("penumbra"),
        renderer=fingerprint(),
        commit=_commit(),
        versions={name: found for name, found in versions(PACKAGES).items() if found},
        python=platform.python_version(),
        machine=machine(),
        cores=os.cpu_count() or 1,
        created="",
    )


def _commit() -> str | None:
    """The commit of the checkout that runs, with `+` if its files differ; None outside a checkout."""
    here = str(Path(__file__).parent)
    try:
        # A virtual environment may lie in another project's checkout.
        _git(here, "ls-files", "--error-unmatch", Path(__file__).name)
        head = _git(here, "rev-parse", "HEAD")
        return head + ("+" if _git(here, "status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.SubprocessError):
        return None


def _git(folder: str, *arguments: str) -> str:
    command = ["git", "-C", folder, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
