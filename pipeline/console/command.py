"""The declaration of commands, and the exit codes of their errors.

A module of `pipeline.commands` decorates its function by `command`; the command line finds it there.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import typer

PACKAGE = "pipeline.commands"
CRASHED = 3
PIPE_CLOSED = 128 + 13  # as a shell reports SIGPIPE
COLUMN = 33  # where the remarks of examples begin

Function = Callable[..., None]
Example = tuple[str, str]  # the command line after `penumbra`, and a remark


@dataclass(frozen=True)
class Command:
    """A declared command. place: its rank in the help."""

    place: int
    name: str
    function: Function
    examples: tuple[Example, ...]


_commands: list[Command] = []


def command(place: int, *examples: Example, name: str = "") -> Callable[[Function], Function]:
    """Declare the decorated function as a command, under its own name if none is given."""

    def declare(function: Function) -> Function:
        _commands.append(Command(place, name or function.__name__, function, examples))
        return function

    return declare


def commands() -> list[Command]:
    """All commands that the modules of PACKAGE declare, in the order of the help."""
    package = importlib.import_module(PACKAGE)
    for module in pkgutil.iter_modules(package.__path__):
        importlib.import_module(f"{PACKAGE}.{module.name}")
    return sorted(_commands, key=lambda one: one.place)


def example_lines(found: Sequence[Command]) -> str:
    """The examples of some commands, a line each."""
    pairs = [pair for one in found for pair in one.examples]
    return "\n".join(f"  penumbra {line:{COLUMN}}  {remark}".rstrip() for line, remark in pairs)


def call(app: Any, arguments: Sequence[str] | None = None) -> None:
    """Run a Typer application. A PenumbraError becomes one line on stderr and exit code 2.

    Any other exception is a fault of Penumbra: its traceback and exit code 3, which no script takes for a
    failed check. `penumbra ... | head` ends as programs do whose output pipe is closed.
    """
    out = sys.stdout
    if reconfigure := getattr(sys.stdout, "reconfigure", None):
        reconfigure(errors="replace")  # a character that the terminal's encoding lacks ends no command
    try:
        app(arguments)
    except SystemExit:
        if sys.stdout is not out:  # Typer has put a silent stream there: the pipe is closed
            sys.exit(PIPE_CLOSED)
        raise
    except Exception as error:
        from scenes.errors import PenumbraError

        if not isinstance(error, PenumbraError):
            traceback.print_exc()
            print("penumbra: this is a fault of Penumbra's own; please report it", file=sys.stderr)
            sys.exit(CRASHED)
        for line in str(error).splitlines():
            print(f"penumbra: {line}", file=sys.stderr)
        sys.exit(2)


def script(function: Function, arguments: Sequence[str] | None = None) -> None:
    """Run one function as a program of its own, for examples and benchmarks."""
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(function)
    call(app, arguments)
