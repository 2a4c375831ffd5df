"""pbrt-v4's lexical level: a text becomes words, quoted strings and brackets, each with its place in its file."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

from scenes.errors import Location, SceneError

Kind = Literal["word", "string", "[", "]"]

# As in pbrt, a `#` inside a word does not begin a comment.
_LEXEME = re.compile(
    r'(?P<space>[ \t\r\n]+)|(?P<comment>#[^\r\n]*)|(?P<string>"(?:[^"\\\n]|\\.)*"?)|[\[\]]|[^ \t\r\n"\[\]]+'
)
_ESCAPE = re.compile(r"\\(.)")
_ESCAPED = {"b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t", "\\": "\\", "'": "'", '"': '"'}


@dataclass(frozen=True, eq=False)
class Source:
    """A text and where it came from. folder: what the file names in it are relative to; None where it is no file."""

    file: str
    text: str
    folder: Path | None = None

    @cached_property
    def _line_starts(self) -> list[int]:
        return [0] + [match.end() for match in re.finditer("\n", self.text)]

    def location(self, offset: int) -> Location:
        """The line and column, from 1, of the character at `offset`."""
        line = bisect_right(self._line_starts, offset)
        return Location(self.file, line, offset - self._line_starts[line - 1] + 1)


@dataclass(frozen=True, eq=False, slots=True)
class Token:
    """One lexeme; the text of a string is without its quotes and escapes."""

    kind: Kind
    text: str
    source: Source
    offset: int

    @property
    def where(self) -> Location:
        """Where the token begins."""
        return self.source.location(self.offset)

    def __str__(self) -> str:
        return f'"{self.text}"' if self.kind == "string" else self.text


def tokenize(source: Source, start: int = 0) -> Iterator[Token]:
    """The tokens of `source` from offset `start` on; SceneError on an unterminated string or an unknown escape.

    A `#$` line beyond `start`, where a template's header ends, is refused: it would declare nothing.
    """
    for match in _LEXEME.finditer(source.text, start):
        text, offset = match.group(), match.start()
        if match.lastgroup == "string":
            yield Token("string", _unquote(text, source, offset), source, offset)
        elif match.lastgroup == "comment":
            if text.startswith("#$"):
                raise SceneError(
                    "a template parameter is declared in the header of the scene file, before the first directive",
                    source.location(offset),
                )
        elif match.lastgroup is None:
            yield Token("[" if text == "[" else "]" if text == "]" else "word", text, source, offset)


def _unquote(text: str, source: Source, offset: int) -> str:
    closed = len(text) >= 2 and re.fullmatch(r'"(?:[^"\\]|\\.)*"', text)
    if not closed:
        raise SceneError("unterminated string: a string ends on the line where it begins", source.location(offset))
    if "\\" not in text:
        return text[1:-1]

    def escaped(match: re.Match[str]) -> str:
        if match.group(1) not in _ESCAPED:
            allowed = " ".join(f"\\{letter}" for letter in _ESCAPED)
            raise SceneError(
                f"unknown escape {match.group()!r} in a string; there are: {allowed}",
                source.location(offset + 1 + match.start()),
            )
        return _ESCAPED[match.group(1)]

    return _ESCAPE.sub(escaped, text[1:-1])


def read_source(path: Path, where: Location | None = None) -> Source:
    """Read a UTF-8 text file; SceneError at `where` (the Include that names it) if that cannot be done."""
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise SceneError(f"cannot read {str(path)!r}: {reason}", where) from None
    return Source(str(path), decode(data, str(path)), path.parent)


def decode(data: bytes, file: str) -> str:
    """UTF-8 text without its byte-order mark; SceneError at the first byte that is none."""
    try:
        return data.decode("utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        head = data[: error.start].decode("utf-8")
        place = Source(file, head).location(len(head))
        raise SceneError(f"byte 0x{data[error.start]:02x} is not UTF-8 text: is this a scene file?", place) from None
