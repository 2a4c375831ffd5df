"""The cost of reading meshes and shapes, as ratios: python benchmarks/reading.py"""

from __future__ import annotations

import tempfile
import time
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import trimesh
import typer
from numpy.typing import NDArray

from pipeline.console.command import script
from pipeline.console.console import Console
from pipeline.console.options import AsJson, Quiet
from renderer.build import build
from renderer.plan.plan import make_plan
from scenes import load
from scenes.ply.mesh import read_ply

HEAD = 'Camera "perspective"\nWorldBegin\n'
OBJECT = (
    'ObjectBegin "o"\nShape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2]\n'
    "ObjectEnd\n"
)
TRIANGLE = 'Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2]'
PATCH = 'Shape "bilinearmesh" "point3 P" [0 0 0 1 0 0 0 1 0 1 1 0]'
# What stands under a translation of its own, by kind.
PLACED = {
    "sphere": 'Shape "sphere" "float radius" 0.01',
    "disk": 'Shape "disk" "float radius" 0.01',
    "trianglemesh": TRIANGLE,
    "bilinearmesh": PATCH,
    "plymesh": 'Shape "plymesh" "string filename" "mesh.ply"',
    "instance": 'ObjectInstance "o"',
    "point light": 'LightSource "point"',
}


def benchmark(
    triangles: Annotated[int, typer.Option(help="Triangles of the PLY file.", min=100)] = 1_000_000,
    count: Annotated[int, typer.Option(help="Shapes of each kind.", min=1)] = 20_000,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Read a PLY file beside trimesh, and many shapes of each kind: processor time, and memory by arrays.

    Examples:

      python benchmarks/reading.py

      python benchmarks/reading.py --triangles 10000000 --count 100000 --json
    """
    console = Console(as_json=as_json, quiet=quiet)
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_ply(folder / "large.ply", triangles)
        _write_ply(folder / "mesh.ply", 2)
        ours, theirs, memory = _ply(folder / "large.ply")
        found["ply"] = {"seconds_to_trimesh": ours / theirs, "memory_to_arrays": memory}
        console.line(
            f"PLY of {triangles:,} triangles: {ours:.2f} s, {ours / theirs:.2f} of trimesh's time; "
            f"{memory:.1f} of its arrays' memory"
        )
        found["inline"] = _inline(folder / "inline.pbrt", triangles)
        console.line(
            "that mesh as pbrt text: {us_each:.2f} us a triangle, {memory_to_arrays:.1f} of its arrays' "
            "memory".format(**found["inline"])
        )
        for kind, text in PLACED.items():
            path = folder / "many.pbrt"
            path.write_text(_many(text, count))
            read, scene = _timed(partial(load, str(path)))
            built, ready = _timed(partial(build, scene))
            planned, _ = _timed(partial(make_plan, ready))
            each = [1e6 * seconds / count for seconds in (read, built, planned)]
            found[kind] = dict(zip(("read", "build", "plan"), each, strict=True))
            console.line(
                f"{kind}: {each[0]:.0f} us to read, {each[1]:.0f} us to build, {each[2]:.0f} us to plan each"
            )
    console.json(found)


def _ply(path: Path) -> tuple[float, float, float]:
    """Seconds of Penumbra and of trimesh, and Penumbra's peak memory over the size of its arrays."""
    read_ply(path)  # the file is in memory then
    ours, _ = _timed(lambda: read_ply(path))
    theirs, _ = _timed(lambda: trimesh.load(path, process=False))  # pyright: ignore[reportUnknownMemberType]
    tracemalloc.start()
    mesh = read_ply(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return ours, theirs, peak / (mesh.vertices.nbytes + mesh.triangles.nbytes)


def _inline(path: Path, triangles: int) -> dict[str, float]:
    """Microseconds a triangle of a mesh in the scene's text, and the peak memory over its arrays' size."""
    _write_inline(path, triangles)
    seconds, scene = _timed(lambda: load(str(path)))
    mesh = scene.shapes[0].geometry
    tracemalloc.start()
    load(str(path))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return {
        "us_each": 1e6 * seconds / len(mesh.faces),
        "memory_to_arrays": peak / (mesh.vertices.nbytes + mesh.faces.nbytes),
    }


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def _many(text: str, count: int) -> str:
    places = np.random.default_rng(1).normal(size=(count, 3)).round(4)
    blocks = (f"AttributeBegin\nTranslate {x} {y} {z}\n{text}\nAttributeEnd\n" for x, y, z in places)
    return f"{HEAD}{OBJECT}{''.join(blocks)}"


def _grid(triangles: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and faces of a grid of about so many triangles."""
    side = int(np.sqrt(triangles / 2)) + 1
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    vertices = np.stack([x.ravel(), y.ravel(), np.sin(x.ravel() / 50)], axis=1)
    corner = np.arange(side * side).reshape(side, side)
    a, b, c, d = (v.ravel() for v in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]))
    return vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])


def _write_inline(path: Path, triangles: int) -> None:
    vertices, faces = _grid(triangles)
    with path.open("w") as file:
        file.write(f'{HEAD}Shape "trianglemesh" "point3 P" [\n')
        np.savetxt(file, vertices, fmt="%.6f")
        file.write(']\n"integer indices" [\n')
        np.savetxt(file, faces, fmt="%d")
        file.write("]\n")


def _write_ply(path: Path, triangles: int) -> None:
    """Write a binary PLY of a grid of about so many triangles."""
    vertices, faces = _grid(triangles)
    rows = np.zeros(len(faces), dtype=[("n", "u1"), ("corners", "<i4", 3)])
    rows["n"], rows["corners"] = 3, faces
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(rows)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())


if __name__ == "__main__":
    script(benchmark)
