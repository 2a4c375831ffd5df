"""Errors that are the user's to mend: clear lines, exit code 2, never a traceback."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

PLACES = 50  # how many places one message lists; a terminal holds about as many


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
    """A scene that cannot be read or rendered: what, where, and what is allowed; one line, and one for each
    further place.
    """

    def __init__(self, message: str, location: Location | None = None, further: Sequence[str] = ()) -> None:
        self.message = _one_line(message)
        self.location = location
        self.further = tuple(further)
        first = f"{location}: {self.message}" if location else self.message
        super().__init__("\n".join([first, *further]))

    def __reduce__(self) -> tuple[type[SceneError], tuple[str, Location | None, tuple[str, ...]]]:
        """For workers in other processes, whose errors are pickled: the lines stay lines."""
        return type(self), (self.message, self.location, self.further)


class Unsupported(SceneError):
    """What the format allows and nothing here simulates.

    A parser that meets it reads on, to name all of them at once.
    """


class Report:
    """The places of a scene that ask for what is not simulated.

    strict: whether a place that a note would do for is refused as well.
    """

    def __init__(self, strict: bool = False) -> None:
        self._found: dict[str, tuple[str, Location]] = {}
        self._count = 0
        self._strict = strict
        self._notes: dict[str, tuple[Location, int]] = {}

    def note(self, message: str, where: Location) -> None:
        """Note a place where the image is not the one that pbrt makes, without refusing the scene."""
        if self._strict:
            self.add(message, where)
            return
        message = _one_line(message)
        first, count = self._notes.get(message, (where, 0))
        self._notes[message] = first, count + 1

    def notes(self) -> tuple[str, ...]:
        """One line for each kind of note, with its first place and how many more there are."""
        return tuple(
            f"{message} ({where}{f' and {count - 1} more' if count > 1 else ''})"
            for message, (where, count) in self._notes.items()
        )

    def add(self, message: str, where: Location) -> None:
        """Note one place; the same place with the same message counts once while it is among those listed."""
        line = f"{where}: {_one_line(message)}"
        if line in self._found:
            return
        self._count += 1
        if len(self._found) < PLACES:
            self._found[line] = (message, where)

    def check(self) -> None:
        """One SceneError that lists the places, a line each and the first as its own, if there are any."""
        if not self._found:
            return
        lines = self._lines()
        message, where = self._found[lines[0]]
        raise SceneError(message, where, lines[1:])

    def behind(self, error: SceneError) -> SceneError:
        """`error` with the places listed behind it; itself where there are none, or where it is of this
        report.
        """
        lines = self._lines()
        if not lines or str(error).startswith(lines[0]):
            return error
        return SceneError(error.message, error.location, [*error.further, *lines])

    def _lines(self) -> list[str]:
        """The places in the order of each file, the files in the order in which something was found in
        them.
        """
        more = self._count - len(self._found)
        rest = [f"and {more} more places that ask for what is not supported"] if more else []
        files = list(dict.fromkeys(where.file for _, where in self._found.values()))

        def place(line: str) -> tuple[int, int, int]:
            where = self._found[line][1]
            return files.index(where.file), where.line, where.column

        return [*sorted(self._found, key=place), *rest]


def _one_line(text: str) -> str:
    """What a file says, fit for a terminal: control characters spelled out, and the middle of long nonsense
    left out.
    """
    text = (
        text if len(text) <= 1200 else text[:600] + text[-600:]
    )  # before it is gone through; more is not shown
    printable = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return printable if len(printable) <= 600 else f"{printable[:295]} ... {printable[-300:]}"
