"""`penumbra`: the composition root. Nothing imports it; its commands alone import `reports`."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from pipeline.commands.agreement import agreement
from pipeline.commands.baseline import baseline
from pipeline.commands.benchmark import benchmark
from pipeline.commands.compare import compare
from pipeline.commands.doctor import doctor
from pipeline.commands.explain import explain
from pipeline.commands.export import export
from pipeline.commands.ladder import ladder
from pipeline.commands.lists import list_names
from pipeline.commands.preview import preview
from pipeline.commands.reference import reference
from pipeline.commands.render import render
from pipeline.commands.report import report
from pipeline.commands.run import demo, run
from pipeline.commands.verify import verify
from pipeline.commands.width import width

EXAMPLES = """Examples:

  penumbra demo                               the main job, with its report
  penumbra run soft-shadow-samples --out runs/first        a built-in sweep
  penumbra run my-sweep.toml --out runs/mine --workers 2   one of your own
  penumbra report runs/first                  from what the run left
  penumbra render soft-shadow -o out.exr --estimator solid-angle --spp 64
  penumbra reference soft-shadow -o reference.exr --spp 1024
  penumbra baseline soft-shadow -o cheap.exr  rasterised, no shadows
  penumbra compare out.exr reference.exr      errors with their intervals
  penumbra verify soft-shadow --estimator area             is it unbiased?
  penumbra explain soft-shadow --measure      what is simulated, why, its cost
  penumbra export touching-light -D gap=0.001 -o gap.pbrt
  penumbra preview soft-shadow -o preview.png --pixel 150,180
  penumbra ladder                             a light comes down on a floor
  penumbra agreement soft-shadow              do all estimators agree?
  penumbra width runs/penumbra                penumbrae against the closed form
  penumbra benchmark                          how fast scene text is read
  penumbra list scenes                        estimators, samplers, metrics ...
  penumbra doctor                             what works on this machine

Exit codes: 0 done, 1 a check failed, 2 wrong use or input, 130 stopped by Ctrl-C.
"""

app = typer.Typer(
    name="penumbra",
    help=(
        "Penumbra measures what accuracy costs in rendering: direct lighting, error against time, with "
        "intervals."
    ),
    epilog=EXAMPLES,
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("demo")(demo)
app.command("run")(run)
app.command("report")(report)
app.command("width")(width)
app.command("render")(render)
app.command("reference")(reference)
app.command("baseline")(baseline)
app.command("compare")(compare)
app.command("verify")(verify)
app.command("explain")(explain)
app.command("export")(export)
app.command("preview")(preview)
app.command("ladder")(ladder)
app.command("agreement")(agreement)
app.command("benchmark")(benchmark)
app.command("list")(list_names)
app.command("doctor")(doctor)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"penumbra {version('penumbra')}")
        raise typer.Exit


@app.callback()
def everywhere(
    allow_outside: Annotated[
        bool, typer.Option("--allow-outside", help="Let scene files name files outside their own folder.")
    ] = False,
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


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; an error of the user's making is one clear line on stderr and exit code 2."""
    try:
        app(arguments)
    except Exception as error:
        from scenes.errors import PenumbraError

        if not isinstance(error, PenumbraError):
            raise
        for line in str(error).splitlines():
            print(f"penumbra: {line}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
