"""Perlin's gradient noise and its sums over octaves, as pbrt-v4 has them [perlin2002].

pbrt leaves out octaves finer than a pixel. Here all of them count, and the samples of a pixel average them.
"""

from __future__ import annotations

import numpy as np

from renderer.math.vectors import Floats
from scenes.arrays import Index

LACUNARITY = 1.99
CALM = 0.2  # what pbrt takes for the mean of |noise|
_TABLE = bytes.fromhex(
    "97a0895b5a0f830dc95f6035c2e907e18c24671e458e086325f0150a17be0694f778ea4b001ac53e5efcdbcb75230b20"
    "39b12158ed953857ae147d88aba844af4aa547868b301ba64d929ee7536fe57a3cd385e6dc695c29372ef528f4668f36"
    "41193fa101d85049d14c84bbd05912a9c8c4878274bc9f56a4646dc6adba034034d9e2fa7c7b05ca2693767eff5255d4"
    "cfce3be32f103a11b6bd1c2adfb7aad577f898022c9aa346dd99659ba72bac09811627fd13626c6e4f71e0e8b2b97068"
    "daf661e4fb22f2c1eed2900cbfb3a2f1513391ebf90eef6b31c0d61fb5c76a9db854ccb07379322d7f0496fe8aeccd5d"
    "de72431d1848f38d80c34e42d73d9cb4"
)
_PERMUTATION = np.tile(np.frombuffer(_TABLE, dtype=np.uint8).astype(np.int64), 2)


def noise(p: Floats) -> Floats:
    """Noise (n,) at points p (3, n): 0 at whole numbers, within [-1.5, 1.5]."""
    p = np.fmod(p, 2.0**30)
    cell = np.floor(p).astype(np.int64)
    d = p - cell
    cell &= 255
    weight = d * d * d * (d * (6.0 * d - 15.0) + 10.0)
    out = np.zeros(p.shape[1])
    for k in (0, 1):
        for j in (0, 1):
            for i in (0, 1):
                part = _gradient(cell[0] + i, cell[1] + j, cell[2] + k, d[0] - i, d[1] - j, d[2] - k)
                for axis, far in enumerate((i, j, k)):
                    part = part * (weight[axis] if far else 1.0 - weight[axis])
                out += part
    return out


def _gradient(x: Index, y: Index, z: Index, dx: Floats, dy: Floats, dz: Floats) -> Floats:
    """The offset (n,) along one of twelve directions, towards the middles of a cube's edges, chosen by a hash
    of the lattice point.
    """
    h = _PERMUTATION.take(_PERMUTATION.take(_PERMUTATION.take(x) + y) + z) & 15
    corner = (h == 12) | (h == 13)
    u, v = np.where((h < 8) | corner, dx, dy), np.where((h < 4) | corner, dy, dz)
    return np.where(h & 1, -u, u) + np.where(h & 2, -v, v)


def fbm(p: Floats, roughness: float, octaves: int) -> Floats:
    """Fractional Brownian motion (n,): octaves of noise, each 1.99 times finer and `roughness`
    times as high.
    """
    out, fine, height = np.zeros(p.shape[1]), 1.0, 1.0
    for _ in range(octaves):
        out += height * noise(fine * p)
        fine, height = fine * LACUNARITY, height * roughness
    return out


def turbulence(p: Floats, roughness: float, octaves: int) -> Floats:
    """Turbulence (n,): as `fbm`, of absolute values. pbrt adds the mean of one octave beyond the last."""
    out, fine, height = np.zeros(p.shape[1]), 1.0, 1.0
    for _ in range(octaves):
        out += height * np.abs(noise(fine * p))
        fine, height = fine * LACUNARITY, height * roughness
    return out + height * CALM
