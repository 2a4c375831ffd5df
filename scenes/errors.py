"""Errors that are the user's to mend: clear lines, exit code 2, never a traceback."""

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
        """Keep the lines apart where a worker's error is pickled."""
        return type(self), (self.message, self.location, self.further)


class Unsupported(SceneError):
    """The format allows it, and nothing here simulates it.

    A parser that meets it reads on, to name all of them at once.
    """


class Report:
    """The kinds of things in a scene that are not simulated, with their places.

    strict: whether a place that a note would do for is refused as well. substitute: whether what has a
    nearest is rendered as that.
    """

    def __init__(self, strict: bool = False, substitute: bool = False) -> None:
        self._strict = strict
        self._substitute = substitute
        self._substitutions: dict[str, dict[Location, None]] = {}
        self._refusals: dict[str, dict[Location, None]] = {}
        self._notes: dict[str, dict[Location, None]] = {}

    def note(self, message: str, where: Location) -> None:
        """Note a place where the image is not the one that pbrt makes, without refusing the scene."""
        if self._strict:
            self.add(message, where)
        else:
            self.remark(message, where)

    def remark(self, message: str, where: Location) -> None:
        """Note a place that looks like a mistake, of which pbrt makes the same image."""
        self._notes.setdefault(_one_line(message), {})[where] = None

    def notes(self) -> tuple[str, ...]:
        """One line for each kind of note, with its first place and how many more there are."""
        return _placed(self._notes)

    @property
    def substitutes(self) -> bool:
        """Whether what has a nearest is rendered as that."""
        return self._substitute

    def substitute(self, what: str, nearest: str, where: Location) -> None:
        """Refuse a place unless it may be rendered as the nearest that is simulated."""
        if self._substitute:
            self._substitutions.setdefault(_one_line(f"{what}: rendered {nearest}"), {})[where] = None
        else:
            self.add(f"{what} is not supported; --substitute renders it {nearest}", where)

    def substitutions(self) -> tuple[str, ...]:
        """One line for each kind of substitution, as for notes."""
        return _placed(self._substitutions)

    def add(self, message: str, where: Location) -> None:
        """Note a place that asks for what is not simulated; the same place counts once for a message."""
        self._refusals.setdefault(_one_line(message), {})[where] = None

    def check(self) -> None:
        """One SceneError that lists each kind of refusal, a line each and the first as its own."""
        if self._refusals:
            (message, places), *rest = self._listed()
            first = f"{message}{_others(places)}"
            raise SceneError(first, next(iter(places)), self._lines(rest))

    def behind(self, error: SceneError) -> SceneError:
        """`error` with the refusals listed behind it; itself where they are its own, or none."""
        lines = self._lines(self._listed())
        if not lines or str(error).startswith(lines[0]):
            return error
        return SceneError(error.message, error.location, [*error.further, *lines])

    def _listed(self) -> list[tuple[str, dict[Location, None]]]:
        """The refusals by their first places, the files in the order in which something was found in them."""
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
    """How many places there are beside the first."""
    return f" and {len(places) - 1} more" if len(places) > 1 else ""


def _one_line(text: str) -> str:
    """The words of a file, fit for a terminal: control characters spelled out, and the middle of long
    nonsense left out.
    """
    text = (
        text if len(text) <= 1200 else text[:600] + text[-600:]
    )  # before it is gone through; more is not shown
    printable = text
    if not text.isprintable():
        printable = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return printable if len(printable) <= 600 else f"{printable[:295]} ... {printable[-300:]}"
