"""The lexer of pbrt-v4 text: words, quoted strings and brackets, each with its place in its file."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from scenes.errors import Location, PenumbraError, SceneError
from scenes.files import read_bytes

# "end" is no text: it stands where an imported file is over.
Kind = Literal["word", "string", "[", "]", "end"]

# As in pbrt, a `#` inside a word does not begin a comment.
_LEXEME = re.compile(
    r"[ \t\r\n]*(?:(?P<comment>#[^\r\n]*)"
    r'|(?P<string>"(?:[^"\\\n]++|\\.)*+"?)'
    r"|(?P<bracket>[\[\]])"
    r'|(?P<word>[^ \t\r\n"\[\]]+))'
)
PIECE = 2**18  # characters whose lines are counted at a time
_COMMENT = re.compile(r"(?m)(?:^|[ \t])#[^\r\n]*")
_BYTE = re.compile("[\udc80-\udcff]")
_ESCAPE = re.compile(r"\\(.)")
_ESCAPED = {"b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t", "\\": "\\", "'": "'", '"': '"'}


@dataclass(frozen=True, eq=False)
class Source:
    """A text and its origin. folder: the folder to which file names in it are relative; None for a text from
    no file.
    """

    file: str
    text: str
    folder: Path | None = None

    @cached_property
    def _line_starts(self) -> memoryview:
        kept = np.int32 if len(self.text) < 2**31 else np.int64
        starts = [np.zeros(1, kept)]
        for first in range(0, len(self.text), PIECE):
            # In UTF-32 every character is one number, so that offsets are the text's own.
            piece = self.text[first : first + PIECE]
            ascii_ = piece.isascii()
            data = piece.encode("ascii" if ascii_ else "utf-32-le", "strict" if ascii_ else "surrogatepass")
            ends = np.flatnonzero(np.frombuffer(data, dtype="<u1" if ascii_ else "<u4") == ord("\n"))
            starts.append((ends + (first + 1)).astype(kept))
        # A memoryview's single items are cheaper than an array's.
        return np.concatenate(starts).data

    def location(self, offset: int) -> Location:
        """The line and column, from 1, of the character at `offset`."""
        line = bisect_right(self._line_starts, offset)
        return Location(self.file, line, offset - self._line_starts[line - 1] + 1)


@dataclass(frozen=True, eq=False, slots=True)
class Token:
    """A lexeme. The text of a string comes without its quotes and escapes."""

    kind: Kind
    text: str
    source: Source
    offset: int

    @property
    def where(self) -> Location:
        """The place of the token's first character."""
        return self.source.location(self.offset)

    def __str__(self) -> str:
        return f'"{self.text}"' if self.kind == "string" else self.text


class Tokenizer:
    """The tokens of `source` from offset `start` on. offset: where the next one is searched."""

    def __init__(self, source: Source, start: int = 0) -> None:
        self.source = source
        self.offset = start

    def next(self) -> Token | None:
        """The next token, None at the end. SceneError for an unterminated string or an unknown escape.

        A `#$ ` line after `start`, the end of a template's header, is refused, since it would declare
        nothing.
        """
        while (match := _LEXEME.match(self.source.text, self.offset)) is not None:
            self.offset = match.end()
            kind = str(match.lastgroup)
            text, offset = match.group(kind), match.start(kind)
            if kind == "word":
                return Token("word", text, self.source, offset)
            if kind == "string":
                return Token("string", _unquote(text, self.source, offset), self.source, offset)
            if kind == "bracket":
                return Token("[" if text == "[" else "]", text, self.source, offset)
            if text.startswith("#$") and text[2:3] in ("", " ", "\t"):
                raise SceneError(
                    (
                        "a template parameter is declared in the header of the scene file, before the first "
                        "directive"
                    ),
                    self.source.location(offset),
                )
        return None


def odd_space(text: str) -> str:
    """A hint on a character that looks like white space and is none to pbrt; "" without one."""
    odd = next((c for c in text if (c.isspace() and c not in " \t\r\n") or c in "\u200b\ufeff"), None)
    return "" if odd is None else f": U+{ord(odd):04X} in it is no white space to pbrt; put a space"


def tokenize(source: Source, start: int = 0) -> Iterator[Token]:
    """All tokens of `source` from offset `start` on."""
    tokenizer = Tokenizer(source, start)
    while (token := tokenizer.next()) is not None:
        yield token


def _unquote(text: str, source: Source, offset: int) -> str:
    closed = len(text) >= 2 and re.fullmatch(r'"(?:[^"\\]++|\\.)*+"', text)
    if not closed:
        raise SceneError(
            "unterminated string: a string ends on the line where it begins", source.location(offset)
        )
    if "\\" not in text:
        return text[1:-1]

    def escaped(match: re.Match[str]) -> str:
        if match.group(1) not in _ESCAPED:
            allowed = " ".join(f"\\{letter}" for letter in _ESCAPED)
            raise SceneError(
                f"unknown escape {match.group()!r} in a string; there are: {allowed}; in a path write /",
                source.location(offset + 1 + match.start()),
            )
        return _ESCAPED[match.group(1)]

    return _ESCAPE.sub(escaped, text[1:-1])


def read_source(path: Path, where: Location | None = None) -> Source:
    """Read a UTF-8 text file, also compressed (.gz). SceneError at `where`, the Include that names it, if it
    cannot be read.
    """
    try:
        data = read_bytes(path)
    except PenumbraError as error:
        raise SceneError(str(error), where) from None
    return Source(str(path), decode(data, str(path)), path.parent)


def decode(data: bytes, file: str) -> str:
    """UTF-8 text without its byte-order mark. SceneError at the first byte that is not UTF-8, except in
    comments, where it becomes `?`.
    """
    try:
        return data.decode("utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        text = data.decode("utf-8", errors="surrogateescape")  # 0xff is \udcff
        text = _COMMENT.sub(lambda match: _BYTE.sub("?", match.group()), text)
        found = _BYTE.search(text)
        if found is None:
            return text
        place = Source(file, text).location(found.start())
        raise SceneError(
            f"byte 0x{ord(found.group()) - 0xDC00:02x} is not UTF-8 text: is this a scene file?", place
        ) from error
