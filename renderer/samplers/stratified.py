"""Correlated multi-jittered sampling [kensler2013]: N samples stratified on both axes and in a grid at once.

Each pair of dimensions (0, 1), (2, 3), ... of each pixel has permutations of its own. N is fixed beforehand:
the strata are cut for it, and the first n of N samples are no estimate of anything.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isqrt
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from renderer.interfaces.sampler import SAMPLERS, key
from renderer.math.hashing import GOLDEN, UInt64, mix
from renderer.math.vectors import Floats
from scenes.arrays import Index

UInt32 = NDArray[np.uint32]


def permute(i: UInt32, length: int, seed: UInt32) -> UInt32:
    """Entry i (n,) of a permutation of range(length), one for each seed (n,) [kensler2013].

    A hash that is a bijection of the next power of two, walked until it lands inside: at most a few rounds.
    """
    mask = np.uint32((1 << max(length - 1, 1).bit_length()) - 1)
    out, rows = i.copy(), np.arange(i.size)
    while rows.size:
        out[rows] = _scramble(out[rows], mask, seed[rows])
        rows = rows[out[rows] >= length]
    return (out + seed) % np.uint32(length)


def _scramble(i: UInt32, w: np.uint32, p: UInt32) -> UInt32:
    """Each step is invertible modulo w + 1, a power of two: odd factors, and shifts that mix high bits into
    low ones.
    """
    i = i ^ p
    i *= np.uint32(0xE170893D)
    i ^= p >> np.uint32(16)
    i ^= (i & w) >> np.uint32(4)
    i ^= p >> np.uint32(8)
    i *= np.uint32(0x0929EB3F)
    i ^= p >> np.uint32(23)
    i ^= (i & w) >> np.uint32(1)
    i *= np.uint32(1) | (p >> np.uint32(27))
    i *= np.uint32(0x6935FA69)
    i ^= (i & w) >> np.uint32(11)
    i *= np.uint32(0x74DCB303)
    i ^= (i & w) >> np.uint32(2)
    i *= np.uint32(0x9E501CC3)
    i ^= (i & w) >> np.uint32(2)
    i *= np.uint32(0xC860A3DF)
    i &= w
    return i ^ (i >> np.uint32(5))


@dataclass(frozen=True)
class Stratified:
    """One sample in each of N strata of x, of y, and of an m x n grid."""

    seed: int
    spp: int
    name: ClassVar[str] = "stratified"
    title: ClassVar[str] = "correlated multi-jittered strata"
    independent: ClassVar[bool] = False
    prefix: ClassVar[bool] = False

    def uniform(self, pixel: Index, sample: Index, dim: int, count: int) -> Floats:
        out = np.zeros((count, pixel.size))
        keys = key(self.seed, pixel)
        for pair in range(dim // 2, (dim + count - 1) // 2 + 1 if count else 0):
            both = self._pair(mix(keys + np.uint64(((pair + 1) * GOLDEN) & 0xFFFFFFFFFFFFFFFF)), sample)
            for axis in (0, 1):
                row = 2 * pair + axis - dim
                if 0 <= row < count:
                    out[row] = both[axis]
        return out

    def _pair(self, state: UInt64, sample: Index) -> tuple[Floats, Floats]:
        """Two coordinates (n,) of each sample, from a state (n,) for each pixel and pair of dimensions."""
        m = max(1, isqrt(self.spp))
        n = -(-self.spp // m)
        seeds = [(mix(state + np.uint64(j)) >> np.uint64(32)).astype(np.uint32) for j in range(1, 4)]
        s = permute(sample.astype(np.uint32), self.spp, seeds[0])
        x, y = permute(s % np.uint32(m), m, seeds[1]), permute(s // np.uint32(m), n, seeds[2])
        jitter = mix(state ^ mix(sample.astype(np.uint64) + np.uint64(GOLDEN)))
        jx = (jitter >> np.uint64(32)) * 2.0**-32
        jy = (jitter & np.uint64(0xFFFFFFFF)) * 2.0**-32
        return np.minimum((x + (y + jx) / n) / m, 1 - 2.0**-53), np.minimum((s + jy) / self.spp, 1 - 2.0**-53)


SAMPLERS.add("stratified", Stratified)
