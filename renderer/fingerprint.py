"""The key of the code that makes images, which keeps a cached image from outliving that code."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from scenes.hashing import hash_code

ROOT = Path(__file__).parent.parent
LIBRARIES = ("numpy", "scipy", "embreex", "trimesh")  # an image's bits depend on them as on our sources


@cache
def fingerprint() -> str:
    """SHA-256 over the Python sources of `renderer` and `scenes`, and the versions of LIBRARIES."""
    return fingerprint_of(ROOT)


def fingerprint_of(root: Path) -> str:
    """The fingerprint of the sources in folder `root`."""
    sources = [*(root / "renderer").rglob("*.py"), *(root / "scenes").rglob("*.py")]
    return hash_code(root, sources, LIBRARIES)
