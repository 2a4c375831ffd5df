"""Which sources made an image: the key that keeps a cached result from outliving the code behind it."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path


@cache
def fingerprint() -> str:
    """SHA-256 over the Python sources of `renderer` and `scenes`, in the order of their names."""
    root = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for path in sorted([*(root / "renderer").rglob("*.py"), *(root / "scenes").rglob("*.py")]):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
