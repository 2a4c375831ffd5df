"""Checks of PNG files, with a one-line reason for a broken one.

libpng writes errors of its own to the standard error stream before it returns one, so that faults are found
before it runs.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SIGNATURE = b"\x89PNG\r\n\x1a\n"
MOST_SIDE = 1_000_000  # libpng's own limit
PIECE = 2**20  # bytes inflated at a time
_SAMPLES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # of a pixel, by colour type
_DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
RGBA = 6  # the colour type


class Unsound(Exception):
    """The reason why a PNG file is broken."""


@dataclass(frozen=True)
class PngHeader:
    """The first chunk of a PNG file. colour: its colour type, 6 for RGBA."""

    width: int
    height: int
    depth: int
    colour: int
    interlaced: bool


def png_header(path: Path) -> PngHeader | None:
    """The header of a PNG file, None if `path` is no PNG. Unsound if a chunk before its pixels is broken."""
    with path.open("rb") as file:
        if file.read(len(SIGNATURE)) != SIGNATURE:
            return None
        header: PngHeader | None = None
        palette = False
        for kind, data in _chunks(file):
            if (kind == b"IHDR") != (header is None):
                raise Unsound("its header is missing" if header is None else "it has two headers")
            if header is None:
                header = _header(data)
            elif kind == b"PLTE":
                if header.colour == 3 and (
                    palette or len(data) % 3 or not 3 <= len(data) <= 3 << header.depth
                ):
                    raise Unsound("its palette is broken")
                palette = True
            elif kind == b"IDAT":
                if header.colour == 3 and not palette:
                    raise Unsound("its palette is missing")
                return header
    raise Unsound("it ends before its pixels")


def check_png_pixels(path: Path, header: PngHeader) -> None:
    """Raise Unsound if the compressed pixels, or a chunk after them, are broken or end too soon."""
    rows = _rows(header)
    wanted = sum(count * stride for count, stride in rows)
    inflating, done, ended = zlib.decompressobj(), 0, False
    with path.open("rb") as file:
        file.seek(len(SIGNATURE))
        for kind, data in _chunks(file):
            ended = ended or (done > 0 and kind != b"IDAT")
            while kind == b"IDAT" and not (ended or inflating.eof):
                try:
                    piece = inflating.decompress(data, PIECE)
                except zlib.error as error:
                    raise Unsound(f"its pixels cannot be inflated: {error}") from None
                if not piece and not inflating.unconsumed_tail:
                    break
                _check_filters(np.frombuffer(piece, np.uint8), done, rows)
                data, done = inflating.unconsumed_tail, done + len(piece)
    if done < wanted or not inflating.eof:
        raise Unsound("it ends before the last pixel")


def _check_filters(piece: NDArray[np.uint8], start: int, rows: list[tuple[int, int]]) -> None:
    """Raise Unsound if a row in this piece of the pixels has none of the five filters. start: the piece's
    first byte.
    """
    begin = -start  # of the pass, in the piece
    for count, stride in rows:
        end = begin + count * stride
        first = begin if begin >= 0 else begin % stride
        if end > 0 and np.any(piece[first:end:stride] > 4):
            raise Unsound("a row of it is filtered in an unknown way")
        begin = end


def _chunks(file: BufferedReader) -> Iterator[tuple[bytes, bytes]]:
    """Kind and data of each chunk, with checksums checked where they matter."""
    while True:
        length, kind = int.from_bytes(file.read(4), "big"), file.read(4)
        if len(kind) < 4 or length >= 2**31:
            raise Unsound("it ends too soon" if len(kind) < 4 else "a chunk of it is too long")
        if not (kind.isalpha() and kind[2:3].isupper()):
            raise Unsound("a chunk of it has no name")
        data, checksum = file.read(length), file.read(4)
        if len(data) < length or len(checksum) < 4:
            raise Unsound("it ends too soon")
        if kind[:1].isupper():
            if zlib.crc32(kind + data) != int.from_bytes(checksum, "big"):
                raise Unsound(f"the checksum of its chunk {kind.decode()} is wrong")
            if kind not in (b"IHDR", b"PLTE", b"IDAT", b"IEND"):
                raise Unsound(f"its chunk {kind.decode()} is unknown")
        if kind == b"IEND":
            return
        yield kind, data


def _header(data: bytes) -> PngHeader:
    if len(data) != 13:
        raise Unsound("its header has the wrong length")
    width, height = int.from_bytes(data[:4], "big"), int.from_bytes(data[4:8], "big")
    depth, colour, packing, filters, interlace = data[8:]
    if not (0 < width <= MOST_SIDE and 0 < height <= MOST_SIDE):
        raise Unsound(f"its header says {width} x {height} pixels")
    if depth not in _DEPTHS.get(colour, ()) or packing or filters or interlace > 1:
        raise Unsound("its header asks for what no PNG has")
    return PngHeader(width, height, depth, colour, interlace == 1)


def _rows(header: PngHeader) -> list[tuple[int, int]]:
    """The number of rows and the bytes of a row with its filter byte; of each of the seven passes if
    interlaced.
    """
    bits = header.depth * _SAMPLES[header.colour]
    if not header.interlaced:
        return [(header.height, 1 + (header.width * bits + 7) // 8)]
    passes = [
        (0, 0, 8, 8),
        (4, 0, 8, 8),
        (0, 4, 4, 8),
        (2, 0, 4, 4),
        (0, 2, 2, 4),
        (1, 0, 2, 2),
        (0, 1, 1, 2),
    ]
    sizes = [
        ((header.width - x + dx - 1) // dx, (header.height - y + dy - 1) // dy) for x, y, dx, dy in passes
    ]
    return [(rows, 1 + (columns * bits + 7) // 8) for columns, rows in sizes if columns > 0 and rows > 0]
