"""`penumbra explain`: the effects that the renderer simulates for a scene or leaves out, and why."""

from __future__ import annotations

import statistics
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Define, Quiet, SceneName, Strict, Substitute
from pipeline.console.scene import open_scene

if TYPE_CHECKING:
    from pipeline.console.console import Console
    from renderer import RenderScene

ROUNDS = 5  # interleaved; the median of five is untouched by two disturbances
ALL = "all of it"


@command(90, ("explain soft-shadow --measure", "what is simulated, why, its cost"))
def explain(
    scene: SceneName,
    define: Define = None,
    strict: Strict = False,
    substitute: Substitute = False,
    measure: Annotated[
        bool, typer.Option("--measure", help="Render with and without each pruning and compare.")
    ] = False,
    estimator: Annotated[str, typer.Option(help="What to measure with.")] = "mis",
    spp: Annotated[int, typer.Option(help="Samples a pixel to measure with.")] = 4,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Show each effect, whether this scene calls for it, and why.

    With --measure each pruning is timed, and checked to leave the image the same bit for bit; if it does not,
    the command exits with 1.

    Examples:

      penumbra explain soft-shadow

      penumbra explain touching-light --measure --spp 64
    """
    from pipeline.console.console import Console
    from renderer import build
    from renderer.plan.plan import PRUNINGS, make_plan

    console = Console(as_json=as_json, quiet=quiet)
    built = build(open_scene(scene, define, console, strict, substitute))
    decisions = make_plan(built).decisions
    idle = list(dict.fromkeys(d.pruning for d in decisions if not d.needed and d.pruning in PRUNINGS))
    found = _measure(built, idle, estimator, spp, console) if measure else {}
    rows = [(d.effect, "simulated" if d.needed else "left out", d.reason) for d in decisions]
    if measure:
        rows = [(*row, *_times(found, d.pruning, d.needed)) for row, d in zip(rows, decisions, strict=True)]
        rows.append((ALL, "", "every pruning against none", *_times(found, ALL, needed=False)))
    columns = ("CPU ms, left out", "CPU ms, simulated", "same image") if measure else ()
    console.table(("effect", "decision", "reason", *columns), rows)
    effects: list[dict[str, Any]] = [
        {"effect": d.effect, "needed": d.needed, "reason": d.reason, "pruning": d.pruning} for d in decisions
    ]
    console.json({"scene": scene, "effects": effects, "measured": found})
    if any(not item["same_image"] for item in found.values()):
        raise typer.Exit(1)


def _measure(
    built: RenderScene, prunings: list[str], estimator: str, spp: int, console: Console
) -> dict[str, dict[str, Any]]:
    """Median CPU seconds with every pruning, and without one of them or all; rounds are interleaved."""
    import numpy as np

    from renderer import render
    from renderer.plan.plan import PRUNINGS

    variants = {
        "": frozenset[str](),
        **{name: frozenset({name}) for name in prunings},
        ALL: frozenset(PRUNINGS),
    }
    seconds: dict[str, list[float]] = {name: [] for name in variants}
    images: dict[str, Any] = {}
    with console.step("measure", (ROUNDS + 1) * len(variants)) as update:
        for turn in range(ROUNDS + 1):  # the first round warms up
            for number, (name, keep) in enumerate(variants.items(), start=1):
                result = render(built, estimator=estimator, spp=spp, keep=keep)
                images[name] = result.image
                seconds[name] += [result.seconds.cpu] if turn else []
                update(turn * len(variants) + number)
    with_all = statistics.median(seconds.pop(""))
    return {
        name: {
            "cpu_seconds_left_out": with_all,
            "cpu_seconds_simulated": statistics.median(times),
            "same_image": bool(np.array_equal(images[""], images[name], equal_nan=True)),
        }
        for name, times in seconds.items()
    }


def _times(found: dict[str, dict[str, Any]], name: str, needed: bool) -> tuple[str, str, str]:
    if needed or name not in found:
        return "", "", ""
    item = found[name]
    same = "yes, bit for bit" if item["same_image"] else "NO"
    return f"{1e3 * item['cpu_seconds_left_out']:.1f}", f"{1e3 * item['cpu_seconds_simulated']:.1f}", same
