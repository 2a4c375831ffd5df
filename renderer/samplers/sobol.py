"""The first two Sobol dimensions, Owen-scrambled and shuffled anew for each pixel and each pair of
dimensions.

The (0, 2)-sequence of the first two dimensions is the best there is in two; higher Sobol pairs are not nets
at the sample counts of rendering. So every pair of dimensions uses it, with an order of its own: a nested
uniform shuffle of the index, which maps each aligned block of 2^m samples to another such block, decorrelates
the pairs and keeps every prefix of 2^m samples a net [burley2020]. Scramble and shuffle are one hash after
[laine2011], with the constants of [vegdahl2021]: a bit of the reversed integer is flipped by a function of
the bits below it alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from renderer.interfaces.sampler import SAMPLERS, key
from renderer.math.hashing import GOLDEN, UInt64, mix
from renderer.math.vectors import Floats
from scenes.arrays import Index

BITS = 32
UInt32 = NDArray[np.uint32]


@cache
def second_dimension() -> UInt32:
    """Points of the second dimension by byte of the index: (4, 256) 32-bit fractions, bits reversed. The XOR
    over an index's bytes gives any point.

    Direction numbers are rows of Pascal's triangle modulo 2, as [joe2008] has them: v_0 = 1/2, and each next
    one is the last XOR the last shifted by one.
    """
    vectors = [1 << 31]
    for _ in range(BITS - 1):
        vectors.append(vectors[-1] ^ (vectors[-1] >> 1))
    bits = (np.arange(256)[:, None] >> np.arange(8)) & 1
    parts = np.array(vectors, dtype=np.uint32).reshape(4, 1, 8) * bits.astype(np.uint32)
    return reverse_bits(np.bitwise_xor.reduce(parts, axis=2))


def reversed_points(index: UInt32) -> tuple[UInt32, UInt32]:
    """Both coordinates (n,) of unscrambled points, as 32-bit fractions with their bits reversed: the index
    itself for van der Corput's, `second_dimension` for the other.
    """
    table = second_dimension()
    second = table[0].take(index & np.uint32(255))
    for byte in (1, 2, 3):
        second ^= table[byte].take((index >> np.uint32(8 * byte)) & np.uint32(255))
    return index, second


def reverse_bits(x: UInt32) -> UInt32:
    """The numbers with their 32 bits in reverse order."""
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F)):
        m, s = np.uint32(mask), np.uint32(shift)
        x = ((x >> s) & m) | ((x & m) << s)
    return x.byteswap()


def owen(reversed_points: UInt32, seed: UInt32) -> UInt32:
    """Owen-scrambled numbers (n,) from bit-reversed ones, fractions or indices, and one seed a row."""
    x = reversed_points ^ (reversed_points * np.uint32(0x3D20ADEA))
    x += seed
    x *= (seed >> np.uint32(16)) | np.uint32(1)
    x ^= x * np.uint32(0x05526C56)
    x ^= x * np.uint32(0x53A22864)
    return reverse_bits(x)


@dataclass(frozen=True)
class Sobol:
    """Low-discrepancy samples: for smooth integrands the error falls far faster than 1/sqrt(spp)."""

    seed: int
    spp: int
    name: ClassVar[str] = "sobol"
    title: ClassVar[str] = "Owen-scrambled Sobol points"
    independent: ClassVar[bool] = False
    prefix: ClassVar[bool] = True

    def uniform(self, pixel: Index, sample: Index, dim: int, count: int) -> Floats:
        out = np.zeros((count, pixel.size))
        keys, reversed_sample = key(self.seed, pixel), reverse_bits(sample.astype(np.uint32))
        for pair in range(dim // 2, (dim + count - 1) // 2 + 1 if count else 0):
            state = mix(keys + np.uint64(((pair + 1) * GOLDEN) & 0xFFFFFFFFFFFFFFFF))
            order, *scrambles = (half for word in (state, mix(state)) for half in _halves(word))
            both = reversed_points(owen(reversed_sample, order))
            for axis in (0, 1):
                row = 2 * pair + axis - dim
                if 0 <= row < count:
                    np.multiply(owen(both[axis], scrambles[axis]), 2.0**-BITS, out=out[row])
        return out


def _halves(word: UInt64) -> tuple[UInt32, UInt32]:
    """The two 32-bit numbers of each 64-bit one."""
    return (word >> np.uint64(BITS)).astype(np.uint32), word.astype(np.uint32)


SAMPLERS.add("sobol", Sobol)
