"""CPU time of library scenes here over that of a commit, in one run: python benchmarks/features.py COMMIT"""

from __future__ import annotations

import io
import json
import os
import statistics
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from pipeline.console.command import script
from pipeline.console.console import Console
from pipeline.console.options import AsJson, Quiet

ROOT = Path(__file__).parents[1]
SCENES = ("soft-shadow", "sphere-light", "veach-mis", "cornell-direct")
# What one process of a tree does. The first render warms up.
MEASURE = """
import json, sys
from renderer import render
from scenes import load
found = {}
for name in sys.argv[2:]:
    scene = load(name)
    render(scene, estimator="mis", spp=4)
    found[name] = min(render(scene, estimator="mis", spp=int(sys.argv[1])).seconds.cpu for _ in range(3))
print(json.dumps(found))
"""


def benchmark(
    commit: Annotated[str, typer.Argument(help="A commit, as git names it: what this tree is held against.")],
    spp: Annotated[int, typer.Option(help="Samples a pixel.", min=1)] = 16,
    rounds: Annotated[int, typer.Option(help="Processes of each tree, in turn.", min=1)] = 5,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Render scenes without alpha, shading normals or glass by this tree and by a commit before these.

    Both trees take turns, each in a process of its own, so that other work on the machine slows both. The
    ratio is of the least processor times; its spread is that of the rounds.

    Examples:

      python benchmarks/features.py 524233c^

      python benchmarks/features.py HEAD~20 --rounds 3 --json
    """
    console = Console(as_json=as_json, quiet=quiet)
    with tempfile.TemporaryDirectory() as name:
        packed = subprocess.run(["git", "archive", commit], cwd=ROOT, check=True, capture_output=True).stdout
        with tarfile.open(fileobj=io.BytesIO(packed)) as tree:
            tree.extractall(name, filter="data")
        turns = [(_measured(ROOT, spp), _measured(Path(name), spp)) for _ in range(rounds)]
    found: dict[str, dict[str, float]] = {}
    for scene in SCENES:
        here, there = (min(turn[side][scene] for turn in turns) for side in (0, 1))
        ratios = [ours[scene] / theirs[scene] for ours, theirs in turns]
        spread = statistics.stdev(ratios) if len(ratios) > 1 else float("nan")
        found[scene] = {"here": here, "there": there, "ratio": here / there, "spread": spread}
        console.line(
            f"{scene}: {here:.3f} s here, {there:.3f} s at {commit}: {here / there:.3f} +- {spread:.3f}"
        )
    console.json(found)


def _measured(tree: Path, spp: int) -> dict[str, float]:
    """The least CPU seconds of each scene in a process of a tree."""
    env = {**os.environ, "PYTHONPATH": str(tree)}
    command = [sys.executable, "-c", MEASURE, str(spp), *SCENES]
    done = subprocess.run(command, cwd=tree, env=env, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


if __name__ == "__main__":
    script(benchmark)
