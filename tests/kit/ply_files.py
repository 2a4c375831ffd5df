"""PLY files for tests, written row by row with struct: slow, and nothing in common with the reader."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

CODES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",  # noqa: E501
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d",  # noqa: E501
}  # fmt: skip
FORMATS = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}

Table = tuple[
    str, Sequence[str], Sequence[Sequence[object]]
]  # name, properties as "float x" or "list uchar int i", rows

POINTS: Table = (
    "vertex",
    ["float x", "float y", "float z"],
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.25, -2, 7)],
)
CORNERS = "list uchar int vertex_indices"


def ply_bytes(encoding: str, *tables: Table, newline: str = "\n", notes: Sequence[str] = ()) -> bytes:
    """A file of these tables, in order; notes: header lines behind the format."""
    lines = ["ply", f"format {encoding} 1.0", *notes]
    for name, properties, rows in tables:
        lines += [f"element {name} {len(rows)}", *(f"property {text}" for text in properties)]
    head = newline.join([*lines, "end_header", ""]).encode()
    order = FORMATS[encoding]
    if order is None:
        texts = [
            " ".join(word for cell in row for word in _words(cell)) for _, _, rows in tables for row in rows
        ]
        return head + newline.join([*texts, ""]).encode()
    return head + b"".join(_packed(order, properties, row) for _, properties, rows in tables for row in rows)


def _words(cell: object) -> list[str]:
    return [str(len(cell)), *map(str, cell)] if isinstance(cell, Sequence) else [str(cell)]


def _packed(order: str, properties: Sequence[str], row: Sequence[object]) -> bytes:
    parts: list[bytes] = []
    for text, cell in zip(properties, row, strict=True):
        types = text.split()[:-1]
        if isinstance(cell, Sequence):
            parts.append(struct.pack(order + CODES[types[1]], len(cell)))
            parts += [struct.pack(order + CODES[types[2]], item) for item in cell]
        else:
            parts.append(struct.pack(order + CODES[types[0]], cell))
    return b"".join(parts)


def written(folder: Path, data: bytes, name: str = "m.ply") -> Path:
    """The path of a file with this content."""
    path = folder / name
    path.write_bytes(data)
    return path
