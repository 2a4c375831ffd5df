"""The baseline's name in studies and records, its fingerprint, and whether it works on this machine.

It stands beside a study's estimators, but has no samples, and no time makes its error less.
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path

from pipeline.baseline.scene import refuses as refuses_scene
from pipeline.extras import missing_extra
from scenes.description.scene import SceneDescription
from scenes.hashing import hash_code

NAME = "pyrender"
SAMPLER = "pixel-middle"
BIAS = "rasterised: biased by the shadows and the sizes of lights that it leaves out"
LIBRARIES = ("pyrender2", "pyrender", "pyopengl", "trimesh", "numpy", "scipy")
PIPELINE = Path(__file__).parents[1]
SHARED = PIPELINE / "references" / "mitsuba" / "environment.py"  # reads environments

# What each platform of OpenGL without a screen needs: one library of each group.
NEEDED = {
    "EGL": (("libEGL.so.1",), ("libOpenGL.so.0", "libGL.so.1")),
    "OSMesa": (("libOSMesa.so.8", "libOSMesa.so.6"),),
}
REMEDY = "apt install libegl1 libopengl0 libgl1-mesa-dri"


def refuses(scene: SceneDescription) -> str | None:
    """Say in one sentence why the scene cannot be rasterised here; None if it can.

    Libraries are only looked for: whether they can draw is found out when they do.
    """
    return missing() or refuses_scene(scene)


@cache
def missing() -> str | None:
    """The libraries that this machine lacks, and how to get them; None if it lacks none.

    First those of the extra, then those of one platform of OpenGL without a screen.
    """
    if why := missing_extra("baseline"):
        return why
    lacking = [" or ".join(group) for group in NEEDED["EGL"] if not any(map(_loads, group))]
    if not lacking or all(any(map(_loads, group)) for group in NEEDED["OSMesa"]):
        return None
    return f"{' and '.join(lacking)} cannot be loaded: {REMEDY}"


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


@cache
def fingerprint() -> str:
    """SHA-256 over the sources of the baseline, its shaders, and the versions of its libraries."""
    own = [path for path in Path(__file__).parent.rglob("*") if path.suffix in (".py", ".vert", ".frag")]
    return hash_code(PIPELINE, [*own, SHARED], LIBRARIES)
