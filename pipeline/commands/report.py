"""`penumbra report`: from a run folder to a page that opens from disk."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Quiet


@command(30, ("report runs/first", "from what the run left"))
def report(
    run: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of a run, finished or not.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="DIR", help="Where to write; DIR/report if not given."),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write the report of a run, finished or not. It renders nothing, and names the images that are missing.

    Examples:

      penumbra report runs/demo
    """
    from pipeline.console.console import Console
    from pipeline.store.run_folder import load_run
    from reports import write_report

    console = Console(as_json=as_json, quiet=quiet)
    with console.step("report", 1) as update:
        page = write_report(run, out or run / "report")
        update(1)
    found = load_run(run)
    missing = sum(study.missing for study in found.studies)
    for line in found.damaged:
        console.problem(f"damaged, and left out of the report: {line}")
    if missing:
        console.note(f"{missing} images of this run are missing; the report names them")
    console.line(str(page))
    console.json({"report": str(page), "missing": missing, "damaged": list(found.damaged)})
