"""Rows of a PLY element: where they lie, and the values in their columns.

Rows with lists differ in size, so that one must be read to find the next. Nearly all files have long runs of
one size: a run is found by comparing the lengths at equal distances, all at once. Single rows that differ
take about a microsecond each.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.ply.header import Element, PlyError, Property

STREAK = (
    16  # equal rows after which a run is looked for: finding its end costs about as much as so many steps
)
WINDOW = 256  # rows that are compared first, and twice as many each time
STEP_LIMIT = 2**23  # lengths read one by one in one element: some 10 s
LENGTH_LIMIT = 2**30  # of a list; no content is that long

Lengths = tuple[int, ...]  # of the lists of a row, in the order of their columns
Read = tuple[int | float, ...]  # the same as they stand in the content, maybe as floats, maybe nonsense
Check = Callable[[Element, int, Lengths], None]


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of an element in runs of equal lengths of lists. runs: (r, 3) int64, of each run the first
    row, its offset, and its entry in `lengths`. end: the end of the last row.
    """

    element: Element
    content: memoryview
    runs: NDArray[np.int64]
    lengths: list[Lengths]
    end: int

    def values(self, column: Property) -> NDArray[Any]:
        """A column without lists: (n,), of its declared type. PlyError if text holds a number outside this
        type.
        """
        return self._cells(column, list(range(len(self.lengths))), 1)[:, 0]

    def lists(self, column: Property, length: int) -> NDArray[Any]:
        """The lists of one length, in order: (k, length), of their declared type. PlyError as of `values`."""
        which = self.element.lists.index(column)
        kinds = [kind for kind, lengths in enumerate(self.lengths) if lengths[which] == length]
        return self._cells(column, kinds, length)

    def _cells(self, column: Property, kinds: list[int], width: int) -> NDArray[Any]:
        """The values of rows of these kinds in a column, in order: (k, width)."""
        size = width * column.held.itemsize
        sizes, offsets = (
            np.array([self.element.offset(stop, lengths) for lengths in self.lengths], dtype=np.int64)
            for stop in (None, column)
        )
        counts = np.diff(self.runs[:, 0], append=self.element.count)
        chosen = np.isin(self.runs[:, 2], kinds)
        counts, (_, starts, kind) = counts[chosen], self.runs[chosen].T
        starts = starts + offsets[kind]
        if not len(starts):
            return np.zeros((0, width), column.type)
        if len(starts) == 1:
            distances = (int(sizes[kind[0]]), column.held.itemsize)
            cells = np.ndarray((int(counts[0]), width), column.held, self.content, int(starts[0]), distances)
            return _declared(cells, column)
        within = np.arange(int(counts.sum()), dtype=np.int64) - np.repeat(np.cumsum(counts) - counts, counts)
        places = np.repeat(starts, counts) + within * np.repeat(sizes[kind], counts)
        every = np.ndarray(
            (len(self.content) - size + 1,), f"V{size}", self.content, 0, (1,)
        )  # a cell at each byte
        return _declared(every[places].view(column.held).reshape(-1, width), column)


def _declared(values: NDArray[Any], column: Property) -> NDArray[Any]:
    """Numbers of a text as the type that the header declares."""
    if column.held.kind == column.type.kind and column.held.itemsize == column.type.itemsize:
        return values
    if column.type.kind == "f":
        with np.errstate(over="ignore"):  # what becomes infinite is refused as such
            return values.astype(column.type)
    limits = np.iinfo(column.type)
    bad = (values != np.rint(values)) | (values < limits.min) | (values > limits.max)
    if bad.any():
        raise PlyError(
            f"is no PLY file that can be read: {values[bad][0]:g} of the property {column.name[:40]!r} is none of its "  # noqa: E501
            f"type's whole numbers, {limits.min} to {limits.max}"
        )
    return values.astype(column.type)


def lay_out(element: Element, content: memoryview, start: int, check: Check | None = None) -> Rows:
    """Find the rows of an element that has columns; the first lies at offset `start`.

    check: called with the first row of each combination of lengths, to raise what is wrong with them.
    PlyError if the content ends before the last row, or a length is invalid.
    """
    walk = _Walk(element, content)
    runs = array("q")  # row, offset and kind of each
    known: dict[Read, int] = {}
    kinds: list[tuple[Lengths, int]] = []  # lengths, and the size of such a row
    row, at, streak, last = 0, start, STREAK, -1
    while row < element.count:
        read = walk.lengths(row, at)
        kind = known.get(read, -1)
        if kind < 0:
            lengths = walk.checked(row, read)
            if check is not None:
                check(element, row, lengths)
            kind = known[read] = len(kinds)
            kinds.append((lengths, element.offset(None, lengths)))
        lengths, size = kinds[kind]
        streak = streak + 1 if kind == last or last < 0 else 0
        run = (
            walk.run(lengths, size, at, element.count - row)
            if streak >= STREAK
            else int(at + size <= len(content))
        )
        if not run:
            raise _ended(element, row)
        runs.extend((row, at, kind))
        row, at, last = row + run, at + size * run, kind
        if len(runs) // 3 * len(element.lists) > STEP_LIMIT:
            raise PlyError(
                f"changes the size of its {element.name[:40]!r} rows too often, {len(runs) // 3} times: triangulate it"  # noqa: E501
            )
    table = np.array(runs, dtype=np.int64).reshape(-1, 3)
    return Rows(element, content, table, [lengths for lengths, _ in kinds], at)


class _Walk:
    """Reader of the lengths of lists."""

    def __init__(self, element: Element, content: memoryview) -> None:
        self._element = element
        self._content = content
        self._lists: list[tuple[int, struct.Struct, np.dtype[Any], int]] = []
        gap = 0  # between the last list and the length of the next
        for column in element.properties:
            if column.length is None:
                gap += column.held.itemsize
            else:
                order = column.length.byteorder if column.length.byteorder in "<>" else "="
                reader = struct.Struct(order + column.length.char)
                self._lists.append((gap, reader, column.length, column.held.itemsize))
                gap = 0

    def lengths(self, row: int, at: int) -> Read:
        """The lengths of the lists of the row at offset `at`, as stored; `checked` tells whether they are
        valid.
        """
        found: list[int | float] = []
        try:
            for gap, reader, _, item in self._lists:
                (length,) = reader.unpack_from(self._content, at + gap)
                found.append(length)
                at += gap + reader.size + int(length * item)
        except (
            struct.error,
            ValueError,
            OverflowError,
        ):  # beyond the end, where a length that is none leads too
            self.checked(row, tuple(found))
            raise _ended(self._element, row) from None
        return tuple(found)

    def checked(self, row: int, lengths: Read) -> Lengths:
        """The numbers as whole ones. PlyError unless they can be lengths of lists."""
        for length in lengths:
            if not 0 <= length <= LENGTH_LIMIT or length % 1:
                raise PlyError(
                    "is no PLY file that can be read: "
                    f"a list in row {row} of {self._element.name[:40]!r} has the length {length:g}"
                )
        return tuple(int(length) for length in lengths)

    def run(self, lengths: Lengths, size: int, at: int, rows: int) -> int:
        """The number of rows among the next `rows`, from offset `at` on, that have these lengths and end
        within the content.
        """
        within = min(rows, (len(self._content) - at) // size)
        done = 0
        while done < within:
            count = min(within - done, WINDOW + done)
            place = at + done * size
            same = np.ones(count, dtype=np.bool_)
            for (gap, reader, type_, item), length in zip(self._lists, lengths, strict=True):
                same &= np.ndarray((count,), type_, self._content, place + gap, (size,)) == length
                place += gap + reader.size + length * item
            if not same.all():
                return done + int(np.argmin(same))
            done += count
        return within


def _ended(element: Element, row: int) -> PlyError:
    return PlyError(
        f"does not hold as much as its header says: it ends in row {row} of {element.count} of {element.name[:40]!r}"  # noqa: E501
    )
