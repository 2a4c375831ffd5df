"""`penumbra compare`: one image scored against another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.commands.options import AsJson, Quiet, definitions

if TYPE_CHECKING:
    from pipeline.metrics.protocol import Reference
    from pipeline.record import Score


def compare(
    image: Annotated[Path, typer.Argument(metavar="A.exr", help="The image under test.")],
    truth: Annotated[
        Path, typer.Argument(metavar="B.exr", help="The reference; its variance is used where it has one.")
    ],
    metric: Annotated[
        list[str] | None, typer.Option("--metric", "-m", help="May be repeated; all metrics if not given.")
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option("--limit", metavar="METRIC=VALUE", help="Exit with 1 if the score is worse; may be repeated."),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Score image A against reference B, each score with its 95 % interval where it has one.

    Examples:

      penumbra compare out.exr reference.exr

      penumbra compare out.exr reference.exr --metric relmse --limit relmse=0.01
    """
    from pipeline.commands.console import Speaker
    from pipeline.metrics.protocol import METRICS, Estimate
    from pipeline.scoring import score
    from scenes.images import read_rgb

    speaker = Speaker(as_json=as_json, quiet=quiet)
    limits = definitions(limit)
    names = list(dict.fromkeys([*(metric or METRICS.names()), *limits]))
    entries = {name: METRICS[name] for name in names}
    estimate, (reference, what) = Estimate(read_rgb(image)), _reference(truth)
    scores = {name: found.score for name, found in score(estimate, reference, names).items()}
    speaker.note(f"{truth}: {what}")
    warnings = _warnings(image, truth)
    for warning in warnings:
        speaker.note(f"warning: {warning}")
    rows = [(entries[name].title, entries[name].unit, *_cells(found)) for name, found in scores.items()]
    speaker.table(("metric", "unit", "value", "95 % interval", "note"), rows)
    worse = [name for name, value in limits.items() if _worse(scores[name], value, entries[name].better)]
    speaker.json(
        {
            "scores": {name: found.model_dump() for name, found in scores.items()},
            "beyond_limit": worse,
            "warnings": warnings,
        }
    )
    for name in worse:
        speaker.note(f"{name}: {_cells(scores[name])[0]} is worse than the limit {limits[name]:g}")
    if worse:
        raise typer.Exit(1)


def _warnings(image: Path, truth: Path) -> list[str]:
    """What the files themselves say against comparing them: another scene, or samples that cannot be trusted."""
    from scenes.images import read_exr

    known = [read_exr(path).metadata if path.suffix == ".exr" else {} for path in (image, truth)]
    scenes = [metadata.get("scene") for metadata in known]
    out: list[str] = []
    if all(scenes) and scenes[0] != scenes[1]:
        out.append(f"{image} and {truth} are not of the same scene with the same parameters")
    if known[0].get("verdict") == "untrustworthy":
        out.append(f"the samples of {image} are untrustworthy: its errors may be far larger than these")
    return out


def _reference(path: Path) -> tuple[Reference, str]:
    """The reference and, in words, what is known of its error."""
    import numpy as np

    from pipeline.metrics.protocol import Reference
    from scenes.images import read_estimate_exr, read_exr, read_rgb

    if "variance.R" not in read_exr(path).channels:
        mean = read_rgb(path)
        return Reference(mean, np.zeros_like(mean), 0), "carries no variance, so that it is taken as exact"
    stored = read_estimate_exr(path)
    samples = int(stored.count.min())
    if stored.metadata.get("independent") == "False" or not np.isfinite(stored.variance).all():
        return Reference(stored.mean, np.zeros_like(stored.mean), 0), "does not know its variance; taken as exact"
    batches = int(stored.metadata.get("batches", samples))
    known = f"{samples} spp, variance from {batches} batches" if batches else "deterministic, with a bound on its error"
    return Reference(stored.mean, stored.variance, batches), known


def _cells(score: Score) -> tuple[str, str, str]:
    value = "undefined" if score.value is None else f"{'<= ' if score.bound else ''}{score.value:.4g}"
    interval = "" if score.low is None or score.high is None else f"{score.low:.4g} .. {score.high:.4g}"
    return value, interval, score.note


def _worse(score: Score, limit: float, better: str) -> bool:
    if score.value is None:
        return True
    return score.value > limit if better == "lower" else score.value < limit
