"""The header of a PLY file: the elements that it declares, and how much content that takes at least.

    ply
    format binary_little_endian 1.0       or ascii, binary_big_endian
    comment ...                           also obj_info ...
    element vertex 8                      a name and how many rows
    property float x                      a column
    property list uchar int corners       a column of lists: the type of their lengths, and of their items
    end_header                            the rows follow, element by element

As rply, pbrt's reader, has it: what it does not know is an error, and of two properties of one name the first
one counts.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8",  # noqa: E501
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",  # noqa: E501
}  # fmt: skip
FORMATS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
HEADER_LIMIT = 2**16  # bytes
ROW_LIMIT = 2**28  # of one element; 4 GiB of float32 points and as many triangles as fit them have fewer
WORD = 8  # bytes of a number of an ASCII file, which is held as float64

_MAGIC = re.compile(rb"ply[ \t]*(\r\n|\n|\r)")


class PlyError(Exception):
    """The reason why a file is broken, as the end of a sentence that begins with its name."""


@dataclass(frozen=True)
class Property:
    """A column. type: as declared. held: as stored. length: the stored type of the lengths of lists, None for
    a column without lists.
    """

    name: str
    type: np.dtype[Any]
    held: np.dtype[Any]
    length: np.dtype[Any] | None


@dataclass(frozen=True)
class Element:
    """A table of `count` rows."""

    name: str
    count: int
    properties: tuple[Property, ...]

    @property
    def lists(self) -> tuple[Property, ...]:
        """The columns whose rows are lists."""
        return tuple(column for column in self.properties if column.length is not None)

    def find(self, *names: str) -> Property | None:
        """The first column with the first of these names that exists."""
        return next((column for name in names for column in self.properties if column.name == name), None)

    def offset(self, stop: Property | None, lengths: tuple[int, ...]) -> int:
        """Bytes from a row's start to the value or first list item of `stop`; None gives the row's end.
        lengths: of the row's lists.
        """
        at, left = 0, iter(lengths)
        for column in self.properties:
            at += column.length.itemsize if column.length is not None else 0
            if column is stop:
                return at
            at += column.held.itemsize * (next(left) if column.length is not None else 1)
        return at


@dataclass(frozen=True)
class Header:
    """ascii: whether the content is text. size: bytes of the header, after which the content begins."""

    ascii: bool
    elements: tuple[Element, ...]
    size: int

    def find(self, name: str) -> Element | None:
        """The element of this name."""
        return next((element for element in self.elements if element.name == name), None)

    def least(self) -> int:
        """The least number of bytes of the content: all lists are empty; in ASCII, words of one digit with
        one space between.
        """
        size = sum(
            element.count * element.offset(None, (0,) * len(element.lists)) for element in self.elements
        )
        return max(2 * (size // WORD) - 1, 0) if self.ascii else size

    def most(self, corners: int) -> int | None:
        """The largest number of bytes of the content if no list is longer than `corners`; None if text or
        further lists leave it open.
        """
        if self.ascii or any(element.lists for element in self.elements if element.name != "face"):
            return None
        if any(len(element.lists) > 1 for element in self.elements):
            return None
        return sum(
            element.count * element.offset(None, (corners,) * len(element.lists)) for element in self.elements
        )


def parse_header(data: bytes) -> Header:
    """The header at the start of `data`, the first HEADER_LIMIT bytes of the file or all of it. PlyError if
    there is none.
    """
    magic = _MAGIC.match(data)
    if magic is None:
        raise PlyError("is no PLY file: its first line is not 'ply'")
    # One kind of line end, that of the first line: content may begin with the byte of another.
    end = re.compile(rb"[\r\n][ \t]*end_header[ \t\r]*?" + magic[1]).search(
        data, magic.end(1) - 1, HEADER_LIMIT
    )
    if end is None:
        raise PlyError(
            f"is no PLY file that can be read: no 'end_header' in its first {HEADER_LIMIT >> 10} KiB"
        )
    lines = [
        line.split() for line in re.split(r"\r\n|\n|\r", data[magic.end() : end.start()].decode("latin-1"))
    ]
    lines = [line for line in lines if line and line[0] not in ("comment", "obj_info")]
    formats = [line for line in lines if line[0] == "format"]
    if len(formats) != 1 or formats[0][1:] not in [[name, "1.0"] for name in FORMATS]:
        raise PlyError(
            f"is no PLY file that can be read: its format must be one of {', '.join(FORMATS)}, and 1.0"
        )
    elements = _elements([line for line in lines if line[0] != "format"], formats[0][1])
    return Header(formats[0][1] == "ascii", elements, end.end())


def _elements(lines: list[list[str]], encoding: str) -> tuple[Element, ...]:
    elements: list[Element] = []
    for line in lines:
        match line:
            case ["element", name, count] if re.fullmatch("[0-9]{1,18}", count, re.ASCII):
                elements.append(Element(name, int(count), ()))
            case ["property", "list", length, type_, name] if elements and length in TYPES and type_ in TYPES:
                if TYPES[length].startswith("f"):
                    raise _unknown(line)
                elements[-1] = _with(elements[-1], name, type_, length, encoding)
            case ["property", type_, name] if elements and type_ in TYPES:
                elements[-1] = _with(elements[-1], name, type_, None, encoding)
            case _:
                raise _unknown(line)
    names = [element.name for element in elements]
    for element in elements:
        if names.count(element.name) > 1:
            raise PlyError(
                f"is no PLY file that can be read: it declares the element {element.name[:40]!r} twice"
            )
        if element.count > ROW_LIMIT:
            raise PlyError(
                f"declares {element.count} rows of {element.name[:40]!r}: no more than {ROW_LIMIT} are read"
            )
    return tuple(elements)


def _with(element: Element, name: str, type_: str, length: str | None, encoding: str) -> Element:
    def held(declared: str) -> np.dtype[Any]:
        return np.dtype(FORMATS[encoding] + ("f8" if encoding == "ascii" else TYPES[declared]))

    column = Property(name, np.dtype(TYPES[type_]), held(type_), None if length is None else held(length))
    return Element(element.name, element.count, (*element.properties, column))


def _unknown(line: list[str]) -> PlyError:
    return PlyError(f"is no PLY file that can be read: its header has the line {' '.join(line)[:80]!r}")
