"""Numbers of an ASCII PLY file: all of its words in one array, read piece by piece."""

from __future__ import annotations

import re
import warnings

import numpy as np
from numpy.typing import NDArray

from scenes.ply.header import PlyError

PIECE = 2**20  # bytes read at a time
_SPACE = b" \t\n\v\f\r"
_NUMBER = re.compile(
    rb"[+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?|[+-]?(?:nan|inf|infinity)", re.IGNORECASE
)


def read_numbers(data: bytes, start: int) -> memoryview:
    """The numbers of the text from `start` on, as the bytes of float64; PlyError at the first word that is
    none.

    Besides the text there is the result and one piece: 8 bytes a number, of which no two take fewer than 3
    bytes.
    """
    pieces = _pieces(data, start)
    numbers = np.zeros(sum(_words(data[first:end]) for first, end in pieces))
    done = 0
    for first, end in pieces:
        found = _parse(data, first, end)
        numbers[done : done + len(found)] = found
        done += len(found)
    return memoryview(numbers.data).cast("B")


def _pieces(data: bytes, start: int) -> list[tuple[int, int]]:
    """The offsets at which to cut the text, each before a space."""
    pieces: list[tuple[int, int]] = []
    while start < len(data):
        end = min(start + PIECE, len(data))
        if end < len(data):
            end = max(data.rfind(bytes([space]), start, end) for space in _SPACE)
        if end <= start:  # a word that is longer than a piece
            raise _no_number(data, start, data[start : start + 40].lstrip())
        pieces.append((start, end))
        start = end
    return pieces


def _words(piece: bytes) -> int:
    """The number of words of a piece that begins and ends with whole ones."""
    codes = np.frombuffer(piece, dtype=np.uint8)
    space = (codes == 32) | (codes - np.uint8(9) < 5)  # a subtraction below 0 wraps to large numbers
    return int(np.count_nonzero(space[:-1] & ~space[1:])) + int(len(space) > 0 and not space[0])


def _parse(data: bytes, first: int, end: int) -> NDArray[np.float64]:
    piece = data[first:end]
    words = _words(piece)
    if not words:  # of which fromstring makes one number
        return np.zeros(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            numbers = np.fromstring(piece, dtype=np.float64, sep=" ")
        except (ValueError, DeprecationWarning):  # the latter in older NumPy
            numbers = np.zeros(0)
    if len(numbers) == words:
        return numbers
    wrong = next(
        (word for word in re.finditer(rb"[^ \t\n\v\f\r]+", piece) if not _NUMBER.fullmatch(word[0])), None
    )
    raise _no_number(data, first + (wrong.start() if wrong else 0), wrong[0] if wrong else piece)


def _no_number(data: bytes, at: int, word: bytes) -> PlyError:
    line = data.count(b"\n", 0, at) + 1
    return PlyError(
        f"is no PLY file that can be read: line {line}: {word[:40].decode('latin-1')!r} is no number"
    )
