"""Errors that the user can mend: clear lines, exit code 2, never a traceback."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

KINDS = 50  # how many kinds of refusal one message lists; a terminal holds about as many


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
    """A scene that cannot be read or rendered: what is wrong, where, and what is allowed. It has one line for
    each place.
    """

    def __init__(self, message: str, location: Location | None = None, further: Sequence[str] = ()) -> None:
        self.message = _one_line(message)
        self.location = location
        self.further = tuple(further)
        first = f"{location}: {self.message}" if location else self.message
        super().__init__("\n".join([first, *further]))

    def __reduce__(self) -> tuple[type[SceneError], tuple[str, Location | None, tuple[str, ...]]]:
        """Keep the lines apart where a worker's error is pickled."""
        return type(self), (self.message, self.location, self.further)


class Unsupported(SceneError):
    """Something that the format allows and that is not simulated. The parser reads on, to name all such
    things at once.
    """


class Report:
    """The things in a scene that are not simulated, with their places.

    strict: also refuse a place that a note would do for. substitute: render the nearest thing that is
    simulated.
    """

    def __init__(self, strict: bool = False, substitute: bool = False) -> None:
        self._strict = strict
        self._substitute = substitute
        self._substitutions: dict[str, dict[Location, None]] = {}
        self._refusals: dict[str, dict[Location, None]] = {}
        self._notes: dict[str, dict[Location, None]] = {}

    def note(self, message: str, where: Location) -> None:
        """Note a place where the image differs from pbrt's, without refusing the scene."""
        if self._strict:
            self.add(message, where)
        else:
            self.remark(message, where)

    def remark(self, message: str, where: Location) -> None:
        """Note a place that looks like a mistake and leaves the image as pbrt's."""
        self._notes.setdefault(_one_line(message), {})[where] = None

    def notes(self) -> tuple[str, ...]:
        """One line for each kind of note: its first place, and the number of others."""
        return _placed(self._notes)

    @property
    def substitutes(self) -> bool:
        """Whether the nearest thing that is simulated may be rendered."""
        return self._substitute

    def substitute(self, what: str, nearest: str, where: Location) -> None:
        """Render the nearest thing that is simulated, or refuse the place if that is not allowed."""
        if self._substitute:
            self._substitutions.setdefault(_one_line(f"{what}: rendered {nearest}"), {})[where] = None
        else:
            self.add(f"{what} is not supported; --substitute renders it {nearest}", where)

    def substitutions(self) -> tuple[str, ...]:
        """One line for each kind of substitution: its first place, and the number of others."""
        return _placed(self._substitutions)

    def add(self, message: str, where: Location) -> None:
        """Refuse a place; the same place counts once for a message."""
        self._refusals.setdefault(_one_line(message), {})[where] = None

    def check(self) -> None:
        """Raise one SceneError with a line for each kind of refusal."""
        if self._refusals:
            (message, places), *rest = self._listed()
            first = f"{message}{_others(places)}"
            raise SceneError(first, next(iter(places)), self._lines(rest))

    def behind(self, error: SceneError) -> SceneError:
        """The `error`, with the refusals listed after it if it is not one of them."""
        lines = self._lines(self._listed())
        if not lines or str(error).startswith(lines[0]):
            return error
        return SceneError(error.message, error.location, [*error.further, *lines])

    def _listed(self) -> list[tuple[str, dict[Location, None]]]:
        """The refusals by their first places, file by file in the order of the first find."""
        files = list(dict.fromkeys(where.file for places in self._refusals.values() for where in places))

        def first(item: tuple[str, dict[Location, None]]) -> tuple[int, int, int]:
            where = next(iter(item[1]))
            return files.index(where.file), where.line, where.column

        return sorted(self._refusals.items(), key=first)

    @staticmethod
    def _lines(listed: Sequence[tuple[str, dict[Location, None]]]) -> list[str]:
        lines = [f"{next(iter(places))}: {message}{_others(places)}" for message, places in listed[:KINDS]]
        more = len(listed) - KINDS
        return [*lines, f"and {more} more kinds of what is not supported"] if more > 0 else lines


def _placed(kinds: Mapping[str, dict[Location, None]]) -> tuple[str, ...]:
    return tuple(f"{message} ({next(iter(places))}{_others(places)})" for message, places in kinds.items())


def _others(places: dict[Location, None]) -> str:
    """The number of places beside the first, in words."""
    return f" and {len(places) - 1} more" if len(places) > 1 else ""


def _one_line(text: str) -> str:
    """Words of a file, fit for a terminal: control characters are spelled out, and long ones cut in the
    middle.
    """
    text = (
        text if len(text) <= 1200 else text[:600] + text[-600:]
    )  # before it is gone through; more is not shown
    printable = text
    if not text.isprintable():
        printable = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return printable if len(printable) <= 600 else f"{printable[:295]} ... {printable[-300:]}"
