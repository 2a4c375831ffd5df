"""Which code made an image: the key that keeps a cached result from outliving the code behind it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path

LIBRARIES = (
    "numpy",
    "scipy",
    "embreex",
    "trimesh",
)  # what the images' bits depend on besides our own sources


@cache
def fingerprint() -> str:
    """SHA-256 over the Python sources of `renderer` and `scenes`, and the versions of the libraries they
    compute with.
    """
    return fingerprint_of(Path(__file__).parent.parent, {name: version(name) for name in LIBRARIES})


def fingerprint_of(root: Path, versions: Mapping[str, str]) -> str:
    """The fingerprint of the sources below a folder, with some versions of libraries."""
    digest = hashlib.sha256(repr(sorted(versions.items())).encode())
    for path in sorted([*(root / "renderer").rglob("*.py"), *(root / "scenes").rglob("*.py")]):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
