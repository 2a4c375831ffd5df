"""`penumbra doctor`: the parts of the system that work on this machine, by trying each."""

from __future__ import annotations

from dataclasses import asdict

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Quiet


@command(150, ("doctor", "what works on this machine"))
def doctor(as_json: AsJson = False, quiet: Quiet = False) -> None:
    """Try Mitsuba with its LLVM, Embree, images, EGL, pyrender and a browser; say how to mend each failure.

    Exits with 1 if a part fails that a run needs. Without EGL and pyrender a run leaves its baseline out;
    only tests need a browser.

    Examples:

      penumbra doctor

      penumbra doctor --json
    """
    from pipeline.console.console import Console
    from pipeline.doctor import CHECKS, Part, verdict

    console = Console(as_json=as_json, quiet=quiet)
    with console.step("checks", len(CHECKS)) as update:
        found: list[Part] = []
        for number, check in enumerate(CHECKS, start=1):
            found += check()
            update(number)
    rows = [
        (
            item.name,
            "works" if item.works else "fails",
            item.detail if item.works else f"{item.detail}\n-> {item.remedy}",
        )
        for item in found
    ]
    console.table(("part", "here", "detail"), rows)
    missing = verdict(found)
    console.json({"parts": [asdict(item) for item in found], "missing": missing})
    for what in missing:
        console.note(f"needed for a run and not working: {what}")
    if missing:
        raise typer.Exit(1)
