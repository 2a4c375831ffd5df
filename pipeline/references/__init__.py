"""Reference images: backends that see the scene's description and never our renderer."""

from __future__ import annotations

import os
from pathlib import Path


def default_cache() -> Path:
    """PENUMBRA_CACHE, or penumbra/ in the user's cache folder (XDG_CACHE_HOME, ~/.cache)."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(os.environ.get("PENUMBRA_CACHE") or Path(base) / "penumbra") / "references"
