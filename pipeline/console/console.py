"""The output of a command: results on stdout, as tables or as JSON; progress and notes on stderr."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager
from typing import Any, cast

from rich.console import Console as RichConsole
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as ProgressBar
from rich.table import Table

from pipeline.console.command import PIPE_CLOSED
from pipeline.progress import Amount, Update

PIPE_WIDTH = 160  # columns where nobody's terminal says how many: long enough for a reason in words


class Console:
    """The two streams of one command.

    Rich leaves colours out where NO_COLOR is set or the stream is no terminal.
    """

    def __init__(self, *, as_json: bool = False, quiet: bool = False) -> None:
        self.as_json = as_json
        self.quiet = quiet
        self._out = _console(sys.stdout)
        self._err = _console(sys.stderr)

    @contextmanager
    def step(self, title: str, total: Amount) -> Generator[Update]:
        """A progress bar on stderr, see `Progress.step`."""
        columns = BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn()
        bar = ProgressBar(TextColumn("{task.description}"), *columns, console=self._err, disable=self.quiet)
        task = bar.add_task(escape(title), total=total)

        def update(done: Amount) -> None:
            if not bar.live.is_started:  # not before there is progress: an early error stands alone
                bar.start()
            bar.update(task, completed=done)

        try:
            yield update
        except BaseException:
            bar.update(task, visible=False)  # what there is to say is the error
            raise
        finally:
            bar.stop()

    def note(self, text: str) -> None:
        """Print one line on stderr."""
        if not self.quiet:
            self._err.print(escape(text), highlight=False, soft_wrap=True)

    def problem(self, text: str) -> None:
        """Print one line on stderr, even with --quiet."""
        self._err.print(escape(text), highlight=False, soft_wrap=True)

    def line(self, text: str) -> None:
        """Print one line on stdout, unless --json is given."""
        if not self.as_json:
            self._out.print(escape(text), highlight=False, soft_wrap=True)

    def table(self, headings: Sequence[str], rows: Iterable[Sequence[str]], title: str = "") -> None:
        """Print a table on stdout, unless --json is given."""
        if self.as_json:
            return
        table = Table(*headings, title=escape(title) or None, title_justify="left")
        for row in rows:
            table.add_row(*(escape(cell) for cell in row))
        self._out.print(table)

    def json(self, data: Any) -> None:
        """Print the answer as JSON on stdout if --json is given; NaN and infinities become null."""
        if self.as_json:
            sys.stdout.write(json.dumps(_plain(data), indent=1, allow_nan=False) + "\n")


class _Stream(RichConsole):
    """A stream of Rich's that ends a command by PIPE_CLOSED, not by the exit code of a check that failed."""

    def on_broken_pipe(self) -> None:
        try:
            super().on_broken_pipe()
        except SystemExit:
            raise SystemExit(PIPE_CLOSED) from None


def _console(stream: Any) -> RichConsole:
    told = stream.isatty() or "COLUMNS" in os.environ
    return _Stream(file=stream, width=None if told else PIPE_WIDTH)


def _plain(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {str(name): _plain(item) for name, item in cast("dict[Any, Any]", value).items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in cast("Sequence[Any]", value)]
    return value
