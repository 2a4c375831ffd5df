"""A description of this machine. It lies apart from provenance.py, which imports the renderer."""

from __future__ import annotations

import functools
import platform
from pathlib import Path


@functools.cache
def machine() -> str:
    """Processor, system and release."""
    return f"{_processor()}, {platform.system()} {platform.release()}"


def _processor() -> str:
    """The processor's name; `platform` has none on most Linux machines."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
