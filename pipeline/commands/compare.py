"""`penumbra compare`: one image scored against another."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Quiet, definitions

if TYPE_CHECKING:
    from pipeline.schema.record import Score
    from pipeline.scoring.metric import Better


@command(70, ("compare out.exr reference.exr", "errors with their intervals"))
def compare(
    image: Annotated[Path, typer.Argument(metavar="A.exr", help="The image under test.")],
    truth: Annotated[
        Path, typer.Argument(metavar="B.exr", help="The reference; its variance is used where it has one.")
    ],
    reference_variance: Annotated[
        Path | None,
        typer.Option(
            metavar="V.exr",
            help=(
                "Variance of the mean of B, as R G B or variance.R ...; taken instead of what B itself "
                "may carry."
            ),
        ),
    ] = None,
    metric: Annotated[
        list[str] | None, typer.Option("--metric", "-m", help="May be repeated; all metrics if not given.")
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            "--limit",
            metavar="METRIC=VALUE",
            help="Exit with 1 if the score is worse (of bias: its size), or undefined; may be repeated.",
        ),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Score image A against reference B, any two EXR of one size, each score with its 95 % interval where it
    has one.

    Without the reference's variance B is taken as exact, and its noise counts as A's error.

    Examples:

      penumbra compare out.exr reference.exr

      penumbra compare out.exr reference.exr --metric relmse --limit relmse=0.01

      penumbra compare theirs.exr pbrt.exr --reference-variance pbrt-variance.exr --json
    """
    from pipeline.console.console import Console
    from pipeline.scoring.files import read_estimate, read_reference
    from pipeline.scoring.metric import METRICS
    from pipeline.scoring.scores import score
    from scenes.errors import PenumbraError

    console = Console(as_json=as_json, quiet=quiet)
    limits = definitions(limit, "--limit", "relmse=0.01")
    if unknown := [name for name in limits if name not in METRICS.names()]:
        there = ", ".join(METRICS.names())
        raise PenumbraError(f"--limit {unknown[0]}: there is no such metric; there are: {there}")
    names = list(dict.fromkeys([*(metric or METRICS.names()), *limits]))
    entries = {name: METRICS[name] for name in names}
    estimate, (reference, what) = read_estimate(image), read_reference(truth, reference_variance)
    scores = {name: found.score for name, found in score(estimate, reference, names).items()}
    console.note(f"{truth}: {what}")
    warnings = _warnings(image, truth)
    for warning in warnings:
        console.note(f"warning: {warning}")
    rows = [
        (name, entries[name].title, entries[name].unit, *_cells(found, entries[name].better))
        for name, found in scores.items()
    ]
    console.table(("metric", "what it is", "unit", "value", "95 % interval", "note"), rows)
    worse = [name for name, value in limits.items() if _worse(scores[name], value, entries[name].better)]
    console.json(
        {
            "image": str(image),
            "reference": {"image": str(truth), "known": what},
            "scores": {name: found.model_dump() for name, found in scores.items()},
            "units": {name: entry.unit for name, entry in entries.items()},
            "better": {name: entry.better for name, entry in entries.items()},
            "beyond_limit": worse,
            "warnings": warnings,
        }
    )
    for name in worse:
        console.note(
            f"{name}: {_cells(scores[name], entries[name].better)[0]} is worse than the limit "
            f"{limits[name]:g}"
        )
    if worse:
        raise typer.Exit(1)


def _warnings(image: Path, truth: Path) -> list[str]:
    """Reasons in the files themselves not to compare them: another scene, or samples that cannot be
    trusted.
    """
    from scenes.images.exr import read_exr

    known = [read_exr(path).metadata if path.suffix == ".exr" else {} for path in (image, truth)]
    scenes = [metadata.get("scene") for metadata in known]
    out: list[str] = []
    if all(scenes) and scenes[0] != scenes[1]:
        out.append(f"{image} and {truth} are not of the same scene with the same parameters")
    if known[0].get("verdict") == "untrustworthy":
        out.append(f"the samples of {image} are untrustworthy: its errors may be far larger than these")
    return out


def _cells(score: Score, better: Better) -> tuple[str, str, str]:
    if score.value is None or math.isinf(score.value):  # a PSNR of equal images
        return "undefined" if score.value is None else f"{score.value}", "", score.note
    sign = "" if not score.bound else ">= " if better == "higher" else "<= "
    interval = "" if score.low is None or score.high is None else f"{score.low:.4g} .. {score.high:.4g}"
    return f"{sign}{score.value:.4g}", interval, score.note


def _worse(score: Score, limit: float, better: Better) -> bool:
    if score.value is None:
        return True
    size = abs(score.value) if better == "zero" else score.value
    return size < limit if better == "higher" else size > limit
