"""What Penumbra and its tests need of the machine beyond Python: found by trying it, installed with apt where
that is possible.

`python tests/system_parts.py run` sees to what the program needs and `... dev` to what the tools of the tests
need besides; both fail where it stays missing. `... test` sees to what some tests need, which are skipped
where it stays missing. conftest.py imports this for the reason of the skip.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass


def chromium() -> str | None:
    """Path of a Chromium or Chrome that can be driven headless, or None."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def _starts_chromium() -> bool:
    path = chromium()
    return (
        path is not None
        and subprocess.run([path, "--version"], capture_output=True, timeout=60).returncode == 0
    )


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


# In a process of its own: drivers are known to end the process that asks them.
DISPLAY = """
import ctypes, sys
egl = ctypes.CDLL("libEGL.so.1")
egl.eglGetDisplay.restype = egl.eglGetPlatformDisplay.restype = ctypes.c_void_p
egl.eglGetDisplay.argtypes = [ctypes.c_void_p]
egl.eglGetPlatformDisplay.argtypes = [ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p]
egl.eglInitialize.argtypes = [ctypes.c_void_p] * 3
handles = egl.eglGetPlatformDisplay(0x31DD, None, None), egl.eglGetDisplay(None)  # 0x31DD: without a surface, Mesa's
sys.exit(not any(handle and egl.eglInitialize(handle, None, None) for handle in handles))
"""  # noqa: E501


def _draws() -> bool:
    """A display without a screen, which takes a driver, and desktop OpenGL."""
    desktop = _loads("libOpenGL.so.0") or _loads("libGL.so.1")
    return (
        desktop
        and subprocess.run([sys.executable, "-c", DISPLAY], capture_output=True, timeout=60).returncode == 0
    )


@dataclass(frozen=True)
class Part:
    """A part of the system. package: Debian's names for it, spaces between; works: tries it."""

    title: str
    package: str
    works: Callable[[], bool]

    def missing(self) -> str:
        """One line: what is missing and the command that installs it."""
        return f"{self.title} is missing: sudo apt-get install {self.package}"


RUN = (Part("libatomic (Mitsuba's wheel links it)", "libatomic1", lambda: _loads("libatomic.so.1")),)
DEV = (
    *RUN,
    Part("a C++ compiler (simpleimageio comes as source)", "g++", lambda: shutil.which("c++") is not None),
)

TEST = {  # by the marker of the tests that need it
    "browser": Part("Chromium (browser test)", "chromium", _starts_chromium),
    "opengl": Part("OpenGL without a screen", "libegl1 libopengl0 libgl1-mesa-dri", _draws),
}


def _install(packages: list[str]) -> None:
    """Install with apt. A failure is apt's to explain; the caller tries the part again."""
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for command in (
        ["apt-get", "update", "-q"],
        ["apt-get", "install", "-y", "-q", "--no-install-recommends", *packages],
    ):
        if subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, stdout=sys.stderr).returncode:
            print(f"failed: {' '.join(command)}", file=sys.stderr)
            return


def main(what: str) -> int:
    """Install what is missing, where root and apt allow it, and say what still is."""
    needed = {"run": RUN, "dev": DEV, "test": tuple(TEST.values())}[what]
    missing = [part for part in needed if not part.works()]
    if missing and os.geteuid() == 0 and shutil.which("apt-get"):
        print(
            f"installing with apt: {' '.join(part.package for part in missing)}", file=sys.stderr, flush=True
        )
        _install([name for part in missing for name in part.package.split()])
    missing = [part for part in missing if not part.works()]
    for part in missing:
        print(
            part.missing() + ("  (until then its tests are skipped)" if what == "test" else ""),
            file=sys.stderr,
        )
    return 1 if missing and what != "test" else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
