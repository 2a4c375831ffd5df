"""Makes tree.ply: a fir of 1,686 triangles, in closed form.

Run `python scenes/library/meshes/make_tree.py` from the checkout; the file it writes is the one that is
checked in.

A trunk, and whorls of branches that get shorter and point up more steeply towards the top; each branch is a
bent, tapering blade, roof-shaped, with three pairs of twigs. The fir is 1 high and stands on y = 0. Angles go
round by the golden section. Coordinates are rounded to multiples of 2^-12, so that the file does not depend
on the last bits of sine and cosine.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.exchange.ply import export_ply

Array = NDArray[np.float64]

BRANCHES = 60
TWIGS = (0.35, 0.55, 0.75)  # where along the branch
TRUNK_SIDES = 6
GOLDEN = np.pi * (3 - np.sqrt(5))


def blade(start: Array, end: Array, width: float, droop: float) -> Array:
    """Triangles (4, 3, 3) of a leaf-shaped roof from start to end, its ridge above its two borders."""
    along = end - start
    side = np.cross(along, [0.0, 1.0, 0.0])
    side = side / np.linalg.norm(side) * width
    middle = start + 0.45 * along
    low = np.array([0, droop, 0])
    left, right, ridge = middle + side - low, middle - side - low, middle + low
    return np.array([[start, right, ridge], [start, ridge, left], [right, end, ridge], [ridge, end, left]])


def branch(number: int) -> Array:
    """Triangles of one branch with its twigs, (4 + 4 * 6, 3, 3)."""
    share = (number + 0.5) / BRANCHES  # of the way up
    height = 0.14 + 0.82 * share
    reach = 0.27 * (1 - share) ** 0.8 + 0.02
    angle = number * GOLDEN
    out = np.array([np.cos(angle), 0.0, np.sin(angle)])
    across = np.array([-np.sin(angle), 0.0, np.cos(angle)])
    start = np.array([0.0, height, 0.0])
    end = start + reach * (out + np.array([0.0, -0.45 + 0.75 * share, 0.0]))
    parts = [blade(start, end, 0.13 * reach, 0.05 * reach)]
    for place in TWIGS:
        root = start + place * (end - start)
        for hand in (-1.0, 1.0):
            tip = root + 0.42 * reach * (1.15 - place) * (
                0.8 * out + hand * across + np.array([0.0, -0.2, 0.0])
            )
            parts.append(blade(root, tip, 0.09 * reach, 0.04 * reach))
    return np.concatenate(parts)


def trunk() -> Array:
    """A slender cone, (TRUNK_SIDES, 3, 3)."""
    angle = np.arange(TRUNK_SIDES + 1) * (2 * np.pi / TRUNK_SIDES)
    foot = np.stack([0.022 * np.cos(angle), np.zeros_like(angle), 0.022 * np.sin(angle)], axis=1)
    top = np.broadcast_to(np.array([0.0, 1.0, 0.0]), foot.shape)
    return np.stack([foot[1:], foot[:-1], top[1:]], axis=1).astype(np.float64)


def triangles() -> Array:
    """All of the fir, (n, 3, 3), on a grid of 2^-12."""
    parts = [trunk(), *(branch(number) for number in range(BRANCHES))]
    return np.round(np.concatenate(parts) * 2**12) / 2**12


def tree() -> bytes:
    """The file's bytes: binary PLY, without normals; corners that triangles share are stored once."""
    vertices, index = np.unique(triangles().reshape(-1, 3), axis=0, return_inverse=True)
    mesh = Trimesh(vertices, index.reshape(-1, 3), process=False)
    return export_ply(mesh, vertex_normal=False)


if __name__ == "__main__":
    target = Path(__file__).with_name("tree.ply")
    target.write_bytes(tree())
    print(f"{target}: {target.stat().st_size} bytes, {len(triangles())} triangles")
