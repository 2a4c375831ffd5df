"""Keys of content: SHA-256 over values, files and code.

Every cache of this project is addressed by such keys, so that no result outlives what it was made from.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

SCALARS: tuple[type, ...] = (str, int, float, np.number, np.bool_, type(None))


def hash_values(*values: object) -> str:
    """SHA-256 of some values, in 64 hexadecimal digits.

    Each value enters with its type and its length, so that different values never feed the same bytes. A
    field of a dataclass is left out if its metadata say `content: False`. TypeError for types other than
    dataclasses, arrays, tuples, lists, mappings, bytes, texts, numbers and None.
    """
    digest = hashlib.sha256()
    for value in values:
        _feed(digest, value)
    return digest.hexdigest()


def hash_file(path: Path) -> str:
    """SHA-256 of a file's bytes, in 64 hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def hash_bytes(content: bytes) -> str:
    """SHA-256 of bytes, in 64 hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def hash_code(root: Path, files: Iterable[Path], libraries: Iterable[str]) -> str:
    """SHA-256 of source files, each under its name relative to `root`, and of the libraries' versions."""
    sources = {path.relative_to(root).as_posix(): path.read_bytes() for path in files}
    return hash_values(versions(libraries), sources)


def versions(libraries: Iterable[str]) -> dict[str, str | None]:
    """The installed version of each distribution, None if it is not installed."""
    found: dict[str, str | None] = {}
    for name in libraries:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = None
    return found


def _feed(digest: Any, value: object) -> None:
    if isinstance(value, np.ndarray):
        array = cast("NDArray[Any]", value)
        digest.update(f"[{array.dtype.str}{array.shape}]".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    elif isinstance(value, bytes):
        digest.update(f"bytes:{len(value)}:".encode() + value)
    elif isinstance(value, SCALARS):
        text = repr(value).encode()
        digest.update(f"{type(value).__name__}:{len(text)}:".encode() + text)
    else:
        mark, items = _items(value)
        digest.update(mark.encode())
        for item in items:
            _feed(digest, item)


def _items(value: object) -> tuple[str, list[object]]:
    """The kind and length of a compound value as a mark, and its items in order."""
    if is_dataclass(value) and not isinstance(value, type):
        content = [item.name for item in fields(value) if item.metadata.get("content", True)]
        pairs = {name: getattr(value, name) for name in content}
        return f"<{type(value).__name__} {len(pairs)}>", [part for pair in pairs.items() for part in pair]
    if isinstance(value, Mapping):
        named = cast("Mapping[str, object]", value)
        return f"{{{len(named)}}}", [part for name in sorted(named) for part in (name, named[name])]
    if isinstance(value, tuple | list):
        items = list(cast("tuple[object, ...] | list[object]", value))
        return f"({len(items)})", items
    raise TypeError(f"a {type(value).__name__} has no content hash")
