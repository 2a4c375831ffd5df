"""`penumbra ladder`: what each estimator makes of a light that comes down on a surface, against a closed
form.
"""

from __future__ import annotations

from typing import Annotated

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Quiet


@command(120, ("ladder", "a light comes down on a floor"))
def ladder(
    light: Annotated[
        str | None, typer.Option(help="One light only: rectangle, disk, sphere or triangle.")
    ] = None,
    samples: Annotated[int, typer.Option(help="Samples of each rung.")] = 2**15,
    seed: Annotated[int, typer.Option(help="Seed of the samples.")] = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Print the contact ladder: mean, error and verdict of each estimator, from the light's size down to 1e-8
    of it.

    Examples:

      penumbra ladder

      penumbra ladder --light rectangle --json
    """
    from pipeline.console.console import Console
    from pipeline.studies.ladder import LIGHTS, climb

    console = Console(as_json=as_json, quiet=quiet)
    rows = list(climb([light] if light else tuple(LIGHTS), samples, seed))
    console.json([row.model_dump(mode="json") for row in rows])
    cells = [
        (
            r.light,
            r.geometry,
            r.estimator,
            f"{r.h:.0e}",
            f"{r.truth:.5f}",
            _estimate(r.verdict, r.mean, r.se),
            r.verdict,
            r.reason,
        )
        for r in rows
    ]
    console.table(("light", "geometry", "estimator", "h", "truth", "mean +- se", "verdict", "why"), cells)


def _estimate(verdict: str, mean: float | None, se: float | None) -> str:
    """A number only where it may be believed."""
    return f"{mean:.5f} +- {se:.5f}" if verdict == "ok" else "-"
