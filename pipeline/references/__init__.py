"""Reference images: backends that see the scene's description and never our renderer."""

from __future__ import annotations

import os
from pathlib import Path


def default_cache() -> Path:
    """The folder of references: in PENUMBRA_CACHE, or in penumbra/ of the user's cache folder."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(os.environ.get("PENUMBRA_CACHE") or Path(base) / "penumbra") / "references"
