"""Colours in image files: channels, encodings, and the precision in which pbrt-v4 keeps them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenes.errors import PenumbraError

Array = NDArray[np.float64]

MOST_HALF = 65504.0  # the largest number of 16 bits


def colour_planes(path: Path, names: Sequence[str], alpha: bool) -> tuple[str, tuple[int, ...]]:
    """The layer of an image, "" for none, and the numbers of its channels R, G and B, or of its only channel.
    With `alpha`, A follows if there is one.

    Upper and lower case are the same. Among several layers none is chosen. PenumbraError, naming `path`, if
    the colours are ambiguous.
    """
    named = {name.upper(): i for i, name in enumerate(names)}
    if all(name in named for name in "RGB"):
        return "", tuple(named[name] for name in ("RGBA" if alpha and "A" in named else "RGB"))
    gray = [i for name, i in named.items() if name not in ("A", "ALPHA")]
    if len(gray) == 1:
        return "", (gray[0],)
    layers = [
        name[:-2] for name in names
        if name[-2:].upper() == ".R" and all(f"{name[:-2]}.{one}".upper() in named for one in "GB")
    ]  # fmt: skip
    if len(layers) != 1:
        several = f"R, G and B in {len(layers)} layers" if layers else "neither R, G and B nor one channel"
        raise PenumbraError(f"{path}: {several}; there are: {', '.join(names)}")
    own = {one: named.get(f"{layers[0]}.{one}".upper()) for one in ("RGBA" if alpha else "RGB")}
    return layers[0], tuple(i for i in own.values() if i is not None)


def checked_encoding(encoding: str) -> float | None:
    """The exponent of "gamma 2.2", None for "sRGB" and 1 for "linear"; PenumbraError for any other word."""
    words = encoding.split()
    if words == ["sRGB"]:
        return None
    if words == ["linear"]:
        return 1.0
    try:
        gamma = float(words[1]) if len(words) == 2 and words[0] == "gamma" else 0.0
    except ValueError:
        gamma = 0.0
    if not 0 < gamma < np.inf:
        raise PenumbraError(
            f'unknown encoding "{encoding}"; there are: sRGB, linear, gamma with its exponent'
        )
    return gamma


def decoded(encoded: Array, encoding: str) -> Array:
    """Linear values of encoded ones, an array in [0, 1]. sRGB is that of IEC 61966-2-1."""
    gamma = checked_encoding(encoding)
    if gamma is None:
        return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return encoded if gamma == 1 else encoded**gamma


def encoded(linear: Array, encoding: str) -> Array:
    """The inverse of `decoded`."""
    gamma = checked_encoding(encoding)
    if gamma is None:
        return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return linear if gamma == 1 else linear ** (1 / gamma)


def as_stored(linear: Array, storage: str, encoding: str) -> Array:
    """Values >= 0 in the precision in which pbrt-v4 keeps an image. storage: "bytes" for 8 bits of
    `encoding`, "half", or "float" for no rounding.

    For "gamma" pbrt uses a table of 1024 linear values, too coarse for the darkest bytes: with gamma 2.2
    those up to 10 become black. Here they are rounded exactly.
    """
    if storage == "bytes":
        codes = np.floor(255.0 * encoded(np.minimum(linear, 1.0), encoding) + 0.5).astype(np.int64)
        return decoded(np.arange(256) / 255.0, encoding).take(codes)
    if storage == "half":
        return np.minimum(linear, MOST_HALF).astype(np.float16).astype(np.float64)
    return linear
