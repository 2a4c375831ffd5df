"""The speed of reading scene text: python benchmarks/scene_text.py"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from pipeline.console.command import script
from pipeline.console.console import Console
from pipeline.console.options import AsJson, Quiet
from scenes import load

HEAD = 'Camera "perspective"\nWorldBegin\nLightSource "distant"\n'
# Bytes of a vertex and of its two triangles, about.
POINT, FACES = 29, 42


def benchmark(
    megabytes: Annotated[
        float, typer.Option(help="Size of the scene, a mesh of random triangles.", min=0.1)
    ] = 20.0,
    rounds: Annotated[int, typer.Option(help="Times to read it; the best counts.", min=1)] = 3,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write a scene of numbers to a temporary file and read it: megabytes a second of processor time.

    Examples:

      python benchmarks/scene_text.py

      python benchmarks/scene_text.py --megabytes 100 --rounds 1 --json
    """
    console = Console(as_json=as_json, quiet=quiet)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "numbers.pbrt"
        _write(path, max(3, round(megabytes * 1e6 / (POINT + FACES))))
        size = path.stat().st_size / 1e6
        best = float("inf")
        with console.step("read", rounds) as update:
            for number in range(rounds):
                start = time.process_time()
                load(str(path))
                best = min(best, time.process_time() - start)
                update(number + 1)
    console.line(f"{size:.1f} MB of numbers read in {best:.2f} s: {size / best:.1f} MB/s")
    console.json({"megabytes": size, "seconds": best, "megabytes_per_second": size / best})


def _write(path: Path, vertices: int) -> None:
    """Write a mesh of so many vertices and twice as many triangles, as text of six decimals."""
    rng = np.random.default_rng(1)
    with path.open("w") as out:
        out.write(f'{HEAD}Shape "trianglemesh" "point3 P" [\n')
        np.savetxt(out, rng.normal(size=(vertices, 3)), fmt="%.6f")
        out.write(']\n"integer indices" [\n')
        np.savetxt(out, rng.integers(0, vertices, (2 * vertices, 3)), fmt="%d")
        out.write("]\n")


if __name__ == "__main__":
    script(benchmark)
