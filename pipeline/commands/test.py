"""`penumbra test`: whether images that any renderer made show a reference's picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson, Quiet


@command(75, ("test seed1.exr seed2.exr seed3.exr reference.exr", "any renderer's images"))
def test(
    images: Annotated[
        list[Path],
        typer.Argument(
            metavar="IMAGE.exr... REFERENCE.exr", help="Images of one method, then the reference."
        ),
    ],
    alpha: Annotated[float, typer.Option(help="Chance of a false alarm, all tests together.")] = 1e-3,
    bias: Annotated[
        float,
        typer.Option(help="Share of the image mean that must have been caught for a verdict of agrees."),
    ] = 0.01,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with 1 unless the verdict is agrees.")
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Test whether images show the picture of a reference: its mean, and regions of a 4 x 4 grid.

    The images are replicates of other seeds, by any renderer; or one image that carries the variance of its
    mean. The verdict is agrees, differs (exit code 1) or inconclusive (too noisy, see --bias). A reference
    without variance counts as exact.

    Examples:

      penumbra test seed1.exr seed2.exr seed3.exr seed4.exr reference.exr

      penumbra test mine.exr reference.exr --bias 0.005 --strict --json
    """
    from pipeline.console.console import Console
    from pipeline.console.verdicts import plain_tests, tell_tests
    from pipeline.scoring.files import read_estimate, read_reference
    from pipeline.studies.images import judge_images
    from scenes.errors import PenumbraError

    console = Console(as_json=as_json, quiet=quiet)
    if len(images) < 2:
        raise PenumbraError(f"{images[0]}: give at least one image and, last, the reference")
    *paths, truth = images
    reference, what = read_reference(truth)
    console.note(f"{truth}: {what}")
    found = judge_images([read_estimate(path) for path in paths], reference, alpha, bias)
    tell_tests(console, found.tests)
    told = f"{len(paths)} replicates" if len(paths) > 1 else str(paths[0])
    console.line(f"{told}: {found.verdict}: {found.reason}")
    console.json(
        {
            "images": [str(path) for path in paths],
            "reference": {"image": str(truth), "known": what},
            "verdict": found.verdict,
            "reason": found.reason,
            "tests": plain_tests(found.tests),
        }
    )
    if found.verdict == "differs" or (strict and found.verdict != "agrees"):
        raise typer.Exit(1)
