"""`penumbra ladder`: what each estimator makes of a light that comes down on a surface, against a closed
form.
"""

from __future__ import annotations

from itertools import takewhile
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Quiet

if TYPE_CHECKING:
    from pipeline.studies.ladder import Rung

ROUNDING = 1e-9  # of the truth: below, the spread of samples that are all alike
LEGEND = """\
Distance in sizes of the light down to which samples can be trusted: light parallel to the floor / upright.
The largest error is in standard errors; - is none, or refused. --details shows every rung."""


@command(120, ("ladder", "a light comes down on a floor"))
def ladder(
    light: Annotated[
        str | None, typer.Option(help="One light only: rectangle, disk, sphere or triangle.")
    ] = None,
    estimator: Annotated[
        list[str] | None, typer.Option(help="One estimator only; may be repeated. All, if not given.")
    ] = None,
    details: Annotated[
        bool, typer.Option("--details", help="Every rung, not only the last that holds.")
    ] = False,
    samples: Annotated[int, typer.Option(help="Samples of each rung.")] = 2**15,
    seed: Annotated[int, typer.Option(help="Seed of the samples.")] = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Print the contact ladder: how near a light may come, from its own size down to 1e-8 of it, before the
    samples of an estimator cannot be trusted.

    Examples:

      penumbra ladder

      penumbra ladder --light rectangle --estimator area --details
    """
    from pipeline.console.console import Console
    from pipeline.studies.ladder import LIGHTS, RUNGS, climb

    console = Console(as_json=as_json, quiet=quiet)
    rows: list[Rung] = []
    lights = [light] if light else list(LIGHTS)
    with console.step("ladder", len(lights) * len(RUNGS)) as update:
        for row in climb(lights, samples, seed, estimators=estimator):
            rows.append(row)
            update(len({(r.light, r.h) for r in rows}))
    console.json([row.model_dump(mode="json") for row in rows])
    if details:
        cells = [
            (
                r.light,
                r.geometry,
                r.estimator,
                f"{r.h:.0e}",
                f"{r.truth:.5f}",
                _estimate(r),
                r.verdict,
                r.reason,
            )
            for r in rows
        ]
        headings = ("light", "geometry", "estimator", "h", "truth", "mean +- se", "verdict", "why")
    else:
        cells = [
            (name, *_held(rows, name, lights), _off(rows, name))
            for name in dict.fromkeys(r.estimator for r in rows)
        ]
        headings = ("estimator", *lights, "largest error")
    console.table(headings, cells)
    if not details:
        console.line(LEGEND)


def _held(rows: list[Rung], estimator: str, lights: list[str]) -> list[str]:
    """For each light the last distance before the first that cannot be trusted, by geometry."""
    geometries = dict.fromkeys(r.geometry for r in rows)
    own = [[[r for r in rows if _place(r) == (estimator, light, g)] for g in geometries] for light in lights]
    return [" / ".join(map(_last, ladders)) for ladders in own]


def _place(rung: Rung) -> tuple[str, str, str]:
    return rung.estimator, rung.light, rung.geometry


def _last(rungs: list[Rung]) -> str:
    held = [rung.h for rung in takewhile(lambda rung: rung.verdict == "ok", rungs)]
    return f"{held[-1]:.0e}" if held else "-" if rungs[0].verdict == "refused" else "never"


def _off(rows: list[Rung], estimator: str) -> str:
    """The largest error among rungs that can be trusted and have a spread."""
    errors = [
        abs(r.mean - r.truth) / r.se
        for r in rows
        if r.estimator == estimator
        and r.verdict == "ok"
        and r.mean is not None
        and r.se
        and r.se > ROUNDING * r.truth
    ]
    return f"{max(errors):.1f} of {len(errors)}" if errors else "-"


def _estimate(rung: Rung) -> str:
    """A number only where it may be believed."""
    return f"{rung.mean:.5f} +- {rung.se:.5f}" if rung.verdict == "ok" else "-"
