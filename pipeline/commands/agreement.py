"""`penumbra agreement`: all estimators of a scene against each other and against a reference."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Cache, Define, Quiet, SceneName, Strict, Substitute, Threads
from pipeline.console.scene import open_scene

if TYPE_CHECKING:
    from pipeline.console.console import Console
    from pipeline.references.protocol import ReferenceImage
    from pipeline.studies.agreement import Agreement
    from scenes import SceneDescription

NONE = "none"
BLIND = 0.05  # a bias that anyone sees by eye
LEFT_OUT = {
    "untrustworthy": "since their own samples cannot tell their error",
    "refused": "since they do not apply to the scene",
}


@command(130, ("agreement soft-shadow", "do all estimators agree?"))
def agreement(
    scene: SceneName,
    estimator: Annotated[
        list[str] | None,
        typer.Option(help="One to compare; may be repeated. All that are unbiased, if not given."),
    ] = None,
    spp: Annotated[int, typer.Option(help="Samples a pixel of each estimator, 16 at least.")] = 64,
    seed: Annotated[int, typer.Option(help="0 or more.")] = 0,
    alpha: Annotated[float, typer.Option(help="Chance of a false alarm anywhere in the matrix.")] = 0.01,
    backend: Annotated[
        str | None,
        typer.Option(
            "--reference",
            help=f"See `penumbra list backends`; or {NONE}. Mitsuba where it can, if not given.",
        ),
    ] = None,
    reference_spp: Annotated[int, typer.Option(help="Samples a pixel of the reference.")] = 1024,
    cache: Cache = None,
    define: Define = None,
    strict: Strict = False,
    substitute: Substitute = False,
    threads: Threads = 1,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Render a scene with every unbiased estimator and compare all pairs; exit code 1 if any two differ.

    Examples:

      penumbra agreement soft-shadow

      penumbra agreement touching-light -D gap=0.1 --spp 256 --reference closed-form --json
    """
    from pipeline.console.console import Console
    from pipeline.studies.agreement import agreement as agree
    from pipeline.studies.agreement import comparable
    from scenes.errors import PenumbraError

    console = Console(as_json=as_json, quiet=quiet)
    if not 0 < alpha < 1:
        raise PenumbraError(f"--alpha is {alpha:g}: give a chance between 0 and 1")
    if threads < 1:
        raise PenumbraError(f"threads is {threads}: give at least 1")
    description = open_scene(scene, define, console, strict, substitute)
    truth = None if backend == NONE else _reference(description, backend, reference_spp, cache, console)
    with console.step(f"render {scene}", len(comparable(estimator))) as update:
        found = agree(
            description,
            estimators=estimator,
            spp=spp,
            seed=seed,
            alpha=alpha,
            threads=threads,
            reference=truth,
            update=update,
        )
    _tell(console, found)
    if not found.agree:
        raise typer.Exit(1)


def _reference(
    scene: SceneDescription, asked: str | None, spp: int, cache: Path | None, console: Console
) -> tuple[str, ReferenceImage] | None:
    """The reference; None with a note where Mitsuba was not asked for and cannot make one: the estimators
    have each other.
    """
    from pipeline.backends import BACKENDS
    from pipeline.references import default_cache
    from pipeline.references.cache import reference_for
    from pipeline.references.protocol import ReferenceRequest, refusal
    from scenes.errors import PenumbraError

    backend = asked or "mitsuba"
    if why := refusal(BACKENDS[backend], scene, "radiance"):
        if asked:
            raise PenumbraError(f"scene {scene.name}: no {backend} reference: {why}")
        console.note(f"no {backend} reference: {why}")
        return None
    if spp < 64:
        raise PenumbraError(f"--reference-spp is {spp}: at least 64, one for each batch")
    with console.step(f"reference by {backend}", 1) as update:
        request = ReferenceRequest(spp=spp, batches=64)
        return backend, reference_for(scene, backend, request, cache or default_cache(), update).image


def _tell(console: Console, found: Agreement) -> None:
    console.json(found.model_dump(mode="json"))
    members = [
        (m.name, m.verdict, "-" if m.verdict == "refused" else f"{m.mean:.6g} +- {m.se:.2g}", m.reason)
        for m in found.members
    ]
    console.table(
        ("estimator", "samples", "image mean +- se", "why"), members, f"{found.scene}, {found.spp} spp"
    )
    pairs = [
        (
            p.a,
            p.b,
            f"{p.difference:+.3%}",
            f"{p.low:+.3%} to {p.high:+.3%}",
            f"{p.p:.2g}",
            f"{p.smallest_detectable:.2%}",
            "agree" if p.agree else f"DIFFER: {p.where}",
        )
        for p in found.pairs
    ]
    headings = ("a", "b", "(a - b) / b", "95 % interval", "p", "smallest bias seen", "verdict")
    console.table(headings, pairs, "image means; the verdict also takes 4 x 4 regions")
    for line in (*_left_out(found), _summary(found)):
        console.line(line)


def _left_out(found: Agreement) -> list[str]:
    """The estimators that no pair holds, in one line for each verdict."""
    lost = {verdict: [m.name for m in found.members if m.verdict == verdict] for verdict in LEFT_OUT}
    return [
        f"left out, {why}: {', '.join(lost[verdict])}" for verdict, why in LEFT_OUT.items() if lost[verdict]
    ]


def _summary(found: Agreement) -> str:
    """The verdict, with the bias that every pair would have shown: agreement without power says nothing."""
    different, pairs = sum(not p.agree for p in found.pairs), len(found.pairs)
    if different:
        return f"{different} of {pairs} pairs DIFFER" if pairs > 1 else "the pair DIFFERS"
    sight = [p.smallest_detectable for p in found.pairs]
    blind = sum(not smallest <= BLIND for smallest in sight)
    agree = f"all {pairs} pairs agree" if pairs > 1 else "the pair agrees"
    power = f"{agree}; they would have shown a bias of {min(sight):.2%} at best, {max(sight):.2%} at worst"
    return power + (f": {blind} could not see {BLIND:.0%}, more --spp helps" if blind else "")
