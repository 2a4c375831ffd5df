"""`penumbra report`: from a run folder to a page that opens from disk."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipeline.commands.options import AsJson, Quiet


def report(
    run: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of a run, finished or not.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="DIR", help="Where to write; DIR/report if not given."),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write the report of a run. It renders nothing; it says what is missing.

    Examples:

      penumbra report runs/demo
    """
    from pipeline.commands.console import Speaker
    from pipeline.store.run_folder import load_run
    from reports import write_report

    speaker = Speaker(as_json=as_json, quiet=quiet)
    with speaker.step("report", 1) as update:
        page = write_report(run, out or run / "report")
        update(1)
    missing = sum(study.missing for study in load_run(run).studies)
    if missing:
        speaker.note(f"{missing} images of this run are missing; the report names them")
    speaker.line(str(page))
    speaker.json({"report": str(page), "missing": missing})
