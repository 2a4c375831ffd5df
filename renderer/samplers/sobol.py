"""The Sobol sequence, Owen-scrambled for each pixel and dimension.

Direction numbers are SciPy's [joe2008]. The scramble is a hash after [laine2011] as [burley2020, sec. 3] uses it, with the
constants of [vegdahl2021]: a bit of the reversed integer is flipped by a function of the bits below it alone, which is a
nested uniform scramble.
Prefixes of 2^m samples are (0, m, 2)-nets in the first two and in each later pair of dimensions that the table makes so.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc  # pyright: ignore[reportMissingTypeStubs]

from renderer.arrays import Floats
from renderer.samplers.protocol import GOLDEN, SAMPLERS, Integers, key, mix
from scenes.errors import PenumbraError

BITS = 32
DIMENSIONS = 16
INDEX_BITS = 20  # samples a pixel at most 2^20
UInt32 = NDArray[np.uint32]


@cache
def directions() -> UInt32:
    """Direction numbers (DIMENSIONS, INDEX_BITS): row d, column j is the point of index 2^j, as a 32-bit fraction.

    SciPy walks the sequence in Gray-code order: its point 2^j is v_j ^ v_(j-1), so a running XOR gives v_j back.
    """
    engine = qmc.Sobol(DIMENSIONS, scramble=False, bits=BITS)
    rows: list[NDArray[np.uint64]] = []
    position = 0
    for j in range(INDEX_BITS):
        engine.fast_forward(2**j - position)
        rows.append((engine.random(1)[0] * 2.0**BITS).astype(np.uint64))
        position = 2**j + 1
    gray = np.array(rows).astype(np.uint32).T
    return np.bitwise_xor.accumulate(gray, axis=1)


def points(sample: Integers, dim: int) -> UInt32:
    """Unscrambled points (n,) of one dimension, in natural order, as 32-bit fractions."""
    out = np.zeros(sample.shape, dtype=np.uint32)
    vectors = directions()[dim]
    for j in range(int(sample.max(initial=0)).bit_length()):
        bit = ((sample >> j) & 1).astype(np.uint32)
        out ^= bit * vectors[j]
    return out


def reverse_bits(x: UInt32) -> UInt32:
    """The 32 bits of each number in reverse."""
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F)):
        m, s = np.uint32(mask), np.uint32(shift)
        x = ((x >> s) & m) | ((x & m) << s)
    return x.byteswap()


def owen(reversed_points: UInt32, seed: UInt32) -> UInt32:
    """Scrambled fractions (n,) from bit-reversed points and a seed for each row."""
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

    def __post_init__(self) -> None:
        if self.spp > 2**INDEX_BITS:
            raise PenumbraError(f"the sobol sampler ends at {2**INDEX_BITS} samples a pixel")

    def uniform(self, pixel: Integers, sample: Integers, dim: int, count: int) -> Floats:
        """See `Sampler`; dimensions beyond the table raise ValueError."""
        if dim + count > DIMENSIONS:
            raise ValueError(f"the Sobol table has {DIMENSIONS} dimensions; {dim + count} were asked for")
        out = np.zeros((count, pixel.size))
        keys = key(self.seed, pixel)
        for i in range(count):
            # A different scramble for each pixel and dimension: dimensions stay decorrelated, pixels independent.
            bits = mix(keys + np.uint64(((dim + i + 1) * GOLDEN) & 0xFFFFFFFFFFFFFFFF))
            scrambled = owen(reverse_bits(points(sample, dim + i)), (bits >> np.uint64(32)).astype(np.uint32))
            np.multiply(scrambled, 2.0**-BITS, out=out[i])
        return out


SAMPLERS.add("sobol", Sobol)
