"""Named arrays as the bytes of an .npz file, and back; never pickled objects."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np


def to_npz(arrays: Mapping[str, Any]) -> bytes:
    """The bytes of an .npz file that holds the arrays."""
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getvalue()


def from_npz(content: bytes) -> dict[str, Any]:
    """The arrays of an .npz file, by name."""
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return dict(arrays)
