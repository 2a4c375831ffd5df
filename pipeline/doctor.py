"""Checks of the parts of the system that Penumbra stands on, each with its finding and a remedy."""

from __future__ import annotations

import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.extras import missing_extra
from pipeline.references.subprocesses import attempt, last_words
from scenes.errors import PenumbraError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
PAGE = "<p>penumbra</p>"
SECONDS = 60  # a browser's first start on a slow disk

TRIANGLE = """
Camera "perspective" "float fov" [ 90 ]
Film "rgb" "integer xresolution" [ 9 ] "integer yresolution" [ 9 ]
WorldBegin
Shape "trianglemesh" "point3 P" [ -1 -1 2  1 -1 2  0 1 2 ]
"""

# A display is made in a process of its own: drivers are known to end the process that asks them.
EGL = """
import ctypes, sys
egl = ctypes.CDLL("libEGL.so.1")
egl.eglGetDisplay.restype = egl.eglGetPlatformDisplay.restype = egl.eglQueryString.restype = ctypes.c_void_p
egl.eglGetDisplay.argtypes = [ctypes.c_void_p]
egl.eglGetPlatformDisplay.argtypes = [ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p]
egl.eglInitialize.argtypes = [ctypes.c_void_p] * 3
egl.eglQueryString.argtypes = [ctypes.c_void_p, ctypes.c_int]
EGL_PLATFORM_SURFACELESS_MESA, EGL_VENDOR = 0x31DD, 0x3053
for kind, display in (
    ("default display", lambda: egl.eglGetDisplay(None)),
    ("no display, surfaceless", lambda: egl.eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, None, None)),
):
    major, minor = ctypes.c_int(), ctypes.c_int()
    handle = display()
    if handle and egl.eglInitialize(handle, ctypes.byref(major), ctypes.byref(minor)):
        vendor = ctypes.cast(egl.eglQueryString(handle, EGL_VENDOR), ctypes.c_char_p).value
        print(f"EGL {major.value}.{minor.value}, {(vendor or b'?').decode()}, {kind}")
        sys.exit(0)
sys.exit("libEGL loads and no display can be initialised")
"""


@dataclass(frozen=True)
class Part:
    """One part of the system. needed: the group of parts of which a run needs one; empty if it needs none."""

    name: str
    works: bool
    detail: str
    remedy: str
    needed: str = ""


def verdict(parts: Sequence[Part]) -> list[str]:
    """The needed groups of which no part works."""
    groups = dict.fromkeys(part.needed for part in parts if part.needed)
    return [group for group in groups if not any(part.works for part in parts if part.needed == group)]


def system() -> list[Part]:
    """Report Python and the machine, for bug reports."""
    from pipeline.store.provenance import provenance

    made = provenance()
    text = f"{made.python} on {made.machine}, {made.cores} cores; penumbra {made.penumbra}"
    return [Part("Python", True, text, "", "Python")]


def embree() -> list[Part]:
    """Trace one ray that hits a triangle and one that misses."""
    return [Part("Embree", *_outcome(_trace), "pip install --force-reinstall embreex", "Embree")]


def _trace() -> str:
    from renderer.geometry.triangles import make_triangles

    corners = np.array([[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [0.0, 1.0, 2.0]])
    face = np.array([[0, 1, 2]])
    triangles = make_triangles(corners, face, np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.bool_))
    directions = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, -1.0]])
    distance, index = triangles.closest(np.zeros((3, 1)), directions)
    if not np.allclose(distance[0], 2.0) or index.tolist() != [0, -1]:
        raise PenumbraError(f"wrong hits: {distance}, {index}")
    return "a ray hits a triangle at its distance, another misses"


def images() -> list[Part]:
    """Write and read back an EXR."""
    remedy = "pip install --force-reinstall openimageio"
    return [Part("OpenImageIO", *_outcome(_write_and_read), remedy, "OpenImageIO")]


def _write_and_read() -> str:
    from scenes.images.exr import read_exr, write_exr

    plane = np.linspace(-1.0, 1e6, 12).reshape(3, 4).astype(np.float32).astype(np.float64)
    with tempfile.TemporaryDirectory(prefix="penumbra-") as folder:
        write_exr(Path(folder) / "probe.exr", {"R": plane})
        if not np.array_equal(read_exr(Path(folder) / "probe.exr").channels["R"], plane):
            raise PenumbraError("an EXR is not read back as written")
    return "an EXR is read back as written"


def mitsuba() -> list[Part]:
    """Try each variant by a tiny render in a process of its own."""
    from pipeline.references.backends.mitsuba import probe_variants

    llvm = (
        "pip install karellen-llvm-core, or point DRJIT_LIBLLVM_PATH at an LLVM that works (19, 23; not 15)"
    )
    found: list[Part] = []
    for probe in probe_variants():
        remedy = llvm if probe.variant == "llvm_ad_rgb" else "pip install --force-reinstall mitsuba"
        found.append(Part(f"Mitsuba {probe.variant}", probe.ok, probe.detail, remedy, "Mitsuba, any variant"))
    return found


def opengl() -> list[Part]:
    """Initialise an EGL display, with or without a screen."""
    remedy = "install EGL, for example: apt install libegl1"
    if platform.system() != "Linux":
        return [Part("EGL", False, f"not looked for on {platform.system()}", "none needed for runs")]
    done = attempt([sys.executable, "-c", EGL], SECONDS)
    if isinstance(done, str):
        return [Part("EGL", False, done, remedy)]
    works = done.returncode == 0
    said = done.stdout if works else done.stderr or f"ended with code {done.returncode}"
    return [Part("EGL", works, last_words(said, 1), remedy)]


def rasteriser() -> list[Part]:
    """Draw a triangle with pyrender and measure its depth."""
    from pipeline.baseline.entry import REMEDY

    if why := missing_extra("baseline"):
        return [_absent("pyrender", why)]
    return [Part("pyrender", *_outcome(_rasterise), REMEDY)]


def _rasterise() -> str:
    from pipeline.baseline.process import rasterise
    from scenes.pbrt.parser import parse

    (drawn,) = rasterise([parse(TRIANGLE)])
    device = f"{drawn.provenance['device']}, {drawn.provenance['platform']}"
    if not np.allclose(drawn.depth[4, 4], 2.0, rtol=1e-5) or not np.isinf(drawn.depth[0, 0]):
        raise PenumbraError(f"wrong depths ({device})")
    return f"a triangle is drawn at its depth ({device})"


def preview() -> list[Part]:
    """Draw a ball off screen with VTK."""
    from pipeline.preview.drawing import REMEDY, off_screen

    if why := missing_extra("preview"):
        return [_absent("preview", why)]
    found = off_screen()
    return [Part("preview", found.works, found.detail, REMEDY)]


def _absent(name: str, why: str) -> Part:
    detail, _, remedy = why.partition(": ")
    return Part(name, False, detail, remedy)


def browser() -> list[Part]:
    """Let a headless browser print a page of our own."""
    remedy = "install a browser, for example: apt install chromium"
    path = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if path is None:
        return [Part("browser", False, f"none of {', '.join(BROWSERS)} on the PATH", remedy)]
    with tempfile.TemporaryDirectory(prefix="penumbra-") as profile:
        command = [
            path,
            "--headless",
            "--disable-gpu",
            f"--user-data-dir={profile}",
            "--dump-dom",
            f"data:text/html,{PAGE}",
        ]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            command.insert(1, "--no-sandbox")  # Chromium's sandbox does not start as root
        done = attempt(command, SECONDS)
    if isinstance(done, str):
        return [Part("browser", False, f"{path}: {done}", remedy)]
    works = done.returncode == 0 and PAGE in done.stdout
    shown = "shows a page" if works else f"ended with code {done.returncode} and did not show a page"
    return [Part("browser", works, f"{path} {shown}", remedy)]


def _outcome(check: Callable[[], str]) -> tuple[bool, str]:
    """Whether a check passes, with the detail that it returns or the error that it raises."""
    try:
        return True, check()
    except PenumbraError as error:
        return False, str(error)
    except Exception as error:  # whatever it is, the part does not work here
        return False, f"{type(error).__name__}: {error}"


CHECKS = (system, embree, images, mitsuba, opengl, rasteriser, preview, browser)
