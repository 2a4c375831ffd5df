"""Errors that are the user's to mend: one clear line, exit code 2, never a traceback."""

from __future__ import annotations

from dataclasses import dataclass


class PenumbraError(Exception):
    """Base of every error caused by input; the command line prints it and exits with 2."""


@dataclass(frozen=True)
class Location:
    """A place in a text file; `line` and `column` count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


class SceneError(PenumbraError):
    """A scene that cannot be read or rendered: what, where, and what is allowed."""

    def __init__(self, message: str, location: Location | None = None) -> None:
        self.message = _one_line(message)
        self.location = location
        super().__init__(f"{location}: {self.message}" if location else self.message)


def _one_line(text: str) -> str:
    """What a file says, fit for a terminal: control characters spelled out, and the middle of long nonsense left out."""
    printable = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return printable if len(printable) <= 600 else f"{printable[:295]} ... {printable[-300:]}"
