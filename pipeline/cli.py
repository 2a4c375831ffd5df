"""`penumbra`: the composition root. Nothing imports it; its commands alone import `reports`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pipeline.console.command import call, commands, example_lines

EXIT_CODES = (
    "Exit codes: 0 done, 1 a check failed, 2 wrong use or input, 3 a fault of ours, 130 stopped by Ctrl-C."
)


def _app() -> typer.Typer:
    """All commands in one application."""
    found = commands()
    made = typer.Typer(
        name="penumbra",
        epilog=f"Examples:\n\n{example_lines(found)}\n\n{EXIT_CODES}\n",
        no_args_is_help=True,
        rich_markup_mode="rich",
        pretty_exceptions_enable=False,
        add_completion=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    for one in found:
        made.command(one.name)(one.function)
    made.callback()(everywhere)
    return made


def _version(wanted: bool) -> bool:
    if wanted:
        from importlib.metadata import version

        print(f"penumbra {version('penumbra')}")
        raise typer.Exit
    return wanted


def everywhere(
    allow_outside: Annotated[
        bool, typer.Option("--allow-outside", help="Let scene files name files outside their own folder.")
    ] = False,
    plugin: Annotated[
        list[Path] | None,
        typer.Option(
            "--plugin",
            metavar="FILE.py",
            help="Import estimators, samplers or metrics of your own; may be repeated.",
        ),
    ] = None,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and stop.", is_eager=True, callback=_version)
    ] = False,
) -> None:
    """Penumbra measures what accuracy costs in rendering: direct lighting, error against time, with
    intervals.
    """
    if allow_outside:
        from scenes.catalog import ALLOW_OUTSIDE

        os.environ[ALLOW_OUTSIDE] = "1"
    for file in plugin or ():
        from scenes import plugins

        plugins.use(file)


app = _app()


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; an error of the user's making is one clear line on stderr and exit code 2."""
    call(app, arguments)


if __name__ == "__main__":
    main()
