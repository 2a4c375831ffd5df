"""The protocol of a sampler, and the integer hash that keys them."""

from __future__ import annotations

from typing import ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats
from scenes.registry import Registry

Integers = NDArray[np.int64]
UInt64 = NDArray[np.uint64]


@runtime_checkable
class Sampler(Protocol):
    """Numbers in [0, 1) for a sample of a pixel, whatever chunk or thread asks for them; made from a seed and
    the spp.

    `independent`: whether samples of a pixel are, so that their spread tells the variance of their mean.
    `prefix`: whether the first n samples of N are what n samples would have been.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    independent: ClassVar[bool]
    prefix: ClassVar[bool]

    def __init__(self, seed: int, spp: int) -> None:
        """seed: 0 or more. spp: how many samples a pixel gets in all; PenumbraError where the sampler ends
        below that.
        """
        ...

    def uniform(self, pixel: Integers, sample: Integers, dim: int, count: int) -> Floats:
        """(count, n): dimensions dim .. dim + count - 1 of each row. pixel, sample: (n,), sample from 0."""
        ...


SAMPLERS: Registry[type[Sampler]] = Registry("sampler", "renderer.samplers")

GOLDEN = 0x9E3779B97F4A7C15


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


def key(seed: int, pixel: Integers) -> UInt64:
    """A 64-bit key (n,) for each pixel of a seed."""
    start = mix(np.array([seed & 0xFFFFFFFFFFFFFFFF], dtype=np.uint64) + np.uint64(GOLDEN))
    return mix(mix(pixel.astype(np.uint64) + np.uint64(1)) + start)
