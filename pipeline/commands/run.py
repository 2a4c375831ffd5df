"""`penumbra run` and `penumbra demo`: sweeps of cells, resumable at any moment."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Quiet

if TYPE_CHECKING:
    from pipeline.console.console import Console
    from pipeline.run.driver import Summary

STOPPED = 130
DEMO = "demo"

Workers = Annotated[
    int | None,
    typer.Option(
        "--workers",
        "-w",
        metavar="N",
        help="Worker processes of one thread each; as many as cores if not given.",
    ),
]


@command(
    20,
    ("run soft-shadow-samples --out runs/first", "a built-in sweep"),
    ("run my-sweep.toml --out runs/mine --workers 2", "one of your own"),
)
def run(
    sweep: Annotated[
        str,
        typer.Argument(metavar="SWEEP", help="A built-in sweep (`penumbra list sweeps`) or a .toml file."),
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder of the run; an unfinished run goes on.")
    ],
    workers: Workers = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Run a sweep: references, then cells, then scores. Results already in the folder are kept.

    Examples:

      penumbra run soft-shadow-samples --out runs/first

      penumbra run my-sweep.toml --out runs/mine --workers 2 && penumbra report runs/mine
    """
    start = time.perf_counter()
    from pipeline.console.console import Console

    console = Console(as_json=as_json, quiet=quiet)
    summary = _run(sweep, out, workers, console)
    _tell(console, summary, out, time.perf_counter() - start)
    console.line(f"penumbra report {out}  makes the report of it")
    console.json(_figures(summary, out, time.perf_counter() - start))
    _exit(summary)


@command(10, ("demo", "the main job, with its report"))
def demo(
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder of the run.")] = Path(
        "runs/demo"
    ),
    workers: Workers = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Run the sweep `demo`, score it and write its report. A second call finds everything done.

    Examples:

      penumbra demo

      penumbra demo --out /tmp/demo --workers 2
    """
    start = time.perf_counter()
    from pipeline.console.console import Console
    from reports import write_report

    console = Console(as_json=as_json, quiet=quiet)
    summary = _run(DEMO, out, workers, console)
    with console.step("report", 1) as update:
        page = write_report(out, out / "report")
        update(1)
    seconds = time.perf_counter() - start
    _tell(console, summary, out, seconds)
    console.line(str(page))
    console.json(_figures(summary, out, seconds) | {"report": str(page)})
    _exit(summary)


def _run(sweep: str, out: Path, workers: int | None, console: Console) -> Summary:
    from pipeline.run.driver import run_sweep
    from pipeline.run.executors.local import LocalExecutor
    from pipeline.schema.sweep import load_sweep

    declared = load_sweep(sweep)
    try:
        with LocalExecutor(_cores() if workers is None else workers) as executor:
            return run_sweep(sweep, declared, out, executor, console)
    except KeyboardInterrupt:
        console.note(f"stopped: what was finished is kept in {out}; the same command goes on from there")
        raise typer.Exit(STOPPED) from None


def _cores() -> int:
    """The number of cores that this process may use, or of all if the system does not tell."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _tell(console: Console, summary: Summary, out: Path, seconds: float) -> None:
    made = ", ".join(f"{count} {name}" for name, count in summary.made.items())
    console.line(f"{out}: {summary.cells} cells; made now: {made}; {seconds:.1f} s")
    for failure in summary.failures:
        console.problem(f"failed: {failure}")


def _figures(summary: Summary, out: Path, seconds: float) -> dict[str, object]:
    return {
        "run": str(out),
        "cells": summary.cells,
        "made": summary.made,
        "left_out": [item.model_dump() for item in summary.left_out],
        "failures": list(summary.failures),
        "seconds": seconds,
    }


def _exit(summary: Summary) -> None:
    if summary.failures:
        raise typer.Exit(1)
