"""Makes knot.ply: a trefoil knot's tube of 10,240 triangles, in closed form.

Run `python scenes/library/meshes/make.py` from the checkout; the file it writes is the one that is checked
in.

The axis runs on a torus, p(t) = ((2 + cos 3t) cos 2t, (2 + cos 3t) sin 2t, sin 3t), and the tube's cross
sections are spanned by the torus's normal and the axis's binormal to it. The knot stands upright, its lowest
point on y = 0. Coordinates are rounded to multiples of 2^-16, so that the file does not depend on the last
bits of sine and cosine.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.exchange.ply import export_ply

ALONG, AROUND = 256, 20
TUBE = 0.55
HEIGHT = 1.5


def axis(t: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Points of the axis, its tangents and the torus's normals there: three times (n, 3)."""
    c3, s3, c2, s2 = np.cos(3 * t), np.sin(3 * t), np.cos(2 * t), np.sin(2 * t)
    ring = 2 + c3
    point = np.stack([ring * c2, ring * s2, s3], axis=1)
    tangent = np.stack([-3 * s3 * c2 - 2 * ring * s2, -3 * s3 * s2 + 2 * ring * c2, 3 * c3], axis=1)
    normal = np.stack([c3 * c2, c3 * s2, s3], axis=1)
    return point, tangent / np.linalg.norm(tangent, axis=1, keepdims=True), normal


def vertices() -> NDArray[np.float64]:
    """(ALONG * AROUND, 3), one cross section after another."""
    point, tangent, normal = axis(np.arange(ALONG, dtype=np.float64) * (2 * np.pi / ALONG))
    binormal = np.cross(tangent, normal)
    angle = np.arange(AROUND) * (2 * np.pi / AROUND)
    offset = np.cos(angle)[:, None, None] * normal + np.sin(angle)[:, None, None] * binormal
    return np.swapaxes(point + TUBE * offset, 0, 1).reshape(-1, 3)


def faces() -> NDArray[np.int64]:
    """(2 ALONG AROUND, 3), seen anticlockwise from outside."""
    i, j = np.meshgrid(np.arange(ALONG), np.arange(AROUND), indexing="ij")
    i2, j2 = (i + 1) % ALONG, (j + 1) % AROUND
    a, b, c, d = (k.ravel() for k in (i * AROUND + j, i * AROUND + j2, i2 * AROUND + j2, i2 * AROUND + j))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def placed(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Upright (one lobe on top), HEIGHT high, standing on y = 0, centred on x = z = 0, on a grid of 2^-16."""
    turn = np.pi / 2  # a lobe of the knot points along +x; bring it up
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    p = (p[:, None, :] * rotation).sum(axis=2)
    low, high = p.min(axis=0), p.max(axis=0)
    p = (p - [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]) * (HEIGHT / (high[1] - low[1]))
    return np.round(p * 2**16) / 2**16


def knot() -> bytes:
    """The file's bytes: binary PLY, without normals."""
    mesh = Trimesh(placed(vertices()), faces(), process=False)
    return export_ply(mesh, vertex_normal=False)


if __name__ == "__main__":
    target = Path(__file__).with_name("knot.ply")
    target.write_bytes(knot())
    print(f"{target}: {target.stat().st_size} bytes")
