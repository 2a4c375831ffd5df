"""Hashes of 64-bit integers and of vectors, and the numbers in [0, 1) that they give."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats

UInt64 = NDArray[np.uint64]

GOLDEN = 0x9E3779B97F4A7C15
WORD = 0xFFFFFFFFFFFFFFFF


def mix(x: UInt64) -> UInt64:
    """A bijection of 64-bit integers in which each bit of x moves each bit of the result [steele2014, variant
    13].
    """
    x = x ^ (x >> np.uint64(30))
    x *= np.uint64(0xBF58476D1CE4E5B9)
    x ^= x >> np.uint64(27)
    x *= np.uint64(0x94D049BB133111EB)
    x ^= x >> np.uint64(31)
    return x


def hash_vectors(*vectors: Floats, salt: int = 0) -> UInt64:
    """A hash (n,) of the bits of vectors (3, n), row by row; -0 counts as 0."""
    state = np.full(vectors[0].shape[1], GOLDEN ^ salt, dtype=np.uint64)
    for part in (part for vector in vectors for part in vector):
        state = mix(state ^ np.ascontiguousarray(part + 0.0).view(np.uint64))
    return state


def to_unit(bits: UInt64) -> Floats:
    """Numbers in [0, 1), multiples of 2^-53, by the upper bits of hashes."""
    return (bits >> np.uint64(11)).astype(np.float64) * 2.0**-53


def stream(key: UInt64, first: int, count: int) -> Floats:
    """Numbers (count, n) in [0, 1) of SplitMix64 [steele2014] under keys (n,), at the counters first + 1 ..
    first + count.
    """
    out = np.zeros((count, key.size))
    for i in range(count):
        bits = mix(key + np.uint64(((first + i + 1) * GOLDEN) & WORD))
        np.multiply(bits >> np.uint64(11), 2.0**-53, out=out[i])
    return out
