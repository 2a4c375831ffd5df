"""Numbers and directives of pbrt-v4 text, written so that reading them gives the same float64."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from scenes.errors import PenumbraError
from scenes.pbrt.transforms import ROUNDING

Array = NDArray[np.float64]

WRAP = 12  # numbers a line


def comment(text: str) -> str:
    """`text` on one line; "scene" if it is empty."""
    return " ".join(text.split()) or "scene"


def quoted(text: str) -> str:
    """A string in pbrt's quotes."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\r", "\\r")
    return f'"{escaped}"'


def numbers(values: Array) -> str:
    """Numbers, separated by spaces."""
    return " ".join(repr(value) for value in values.ravel().tolist())


def block(name: str, values: list[float] | list[int]) -> list[str]:
    """A parameter with many values, over several lines."""
    rows: Iterable[str] = (" ".join(map(repr, values[i : i + WRAP])) for i in range(0, len(values), WRAP))
    return [f"  {name} [", *(f"    {row}" for row in rows), "  ]"]


def matrix(directive: str, linear: Array) -> str:
    """A linear map (3, 3), or an affine one (3, 4), column after column as pbrt reads it."""
    full = np.eye(4)
    full[:3, : linear.shape[1]] = linear
    columns = (" ".join(repr(value) for value in column) for column in (full.T + 0.0).tolist())
    return f"{directive} [ {'  '.join(columns)} ]"


def rotation(linear: Array, what: str) -> str:
    """`ConcatTransform` of orthonormal axes, which are read back bit for bit. PenumbraError, naming `what`,
    for other axes.
    """
    check_orthonormal(linear, what)
    return matrix("ConcatTransform", linear)


def is_orthonormal(linear: Array) -> bool:
    """Whether columns (3, 3) are orthonormal up to rounding."""
    return bool(np.abs(linear.T @ linear - np.eye(3)).max() <= ROUNDING)


def check_orthonormal(linear: Array, what: str) -> None:
    """Raise PenumbraError unless the columns are orthonormal up to rounding, as those of every scene file
    are.
    """
    if not is_orthonormal(linear):
        raise PenumbraError(f"{what} axes are not orthonormal: there is no exact pbrt text for them")
