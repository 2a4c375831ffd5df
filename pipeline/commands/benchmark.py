"""`penumbra benchmark`: how fast scene text is read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.commands.options import AsJson, Quiet

if TYPE_CHECKING:
    from pathlib import Path

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

      penumbra benchmark

      penumbra benchmark --megabytes 100 --rounds 1 --json
    """
    import tempfile
    import time
    from pathlib import Path

    from pipeline.commands.console import Speaker
    from scenes import load

    speaker = Speaker(as_json=as_json, quiet=quiet)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "numbers.pbrt"
        _write(path, max(3, round(megabytes * 1e6 / (POINT + FACES))))
        size = path.stat().st_size / 1e6
        best = float("inf")
        with speaker.step("read", rounds) as update:
            for number in range(rounds):
                start = time.process_time()
                load(str(path))
                best = min(best, time.process_time() - start)
                update(number + 1)
    speaker.line(f"{size:.1f} MB of numbers read in {best:.2f} s: {size / best:.1f} MB/s")
    speaker.json({"megabytes": size, "seconds": best, "megabytes_per_second": size / best})


def _write(path: Path, vertices: int) -> None:
    """A mesh of that many vertices and twice as many triangles, as text of six decimals."""
    import numpy as np

    rng = np.random.default_rng(1)
    with path.open("w") as out:
        out.write(f'{HEAD}Shape "trianglemesh" "point3 P" [\n')
        np.savetxt(out, rng.normal(size=(vertices, 3)), fmt="%.6f")
        out.write(']\n"integer indices" [\n')
        np.savetxt(out, rng.integers(0, vertices, (2 * vertices, 3)), fmt="%d")
        out.write("]\n")
