"""The protocol of a sampler, and the integer hash behind its keys."""

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
    """Numbers in [0, 1) for the samples of pixels, as a function of seed, pixel, sample and dimension.

    `independent`: whether the samples of a pixel are independent, so that their spread tells the variance of
    their mean. `prefix`: whether the first n of N samples are the n samples of a shorter render.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    independent: ClassVar[bool]
    prefix: ClassVar[bool]

    def __init__(self, seed: int, spp: int) -> None:
        """seed: 0 or more. spp: samples a pixel in all; PenumbraError where the sampler does not reach it."""
        ...

    def uniform(self, pixel: Integers, sample: Integers, dim: int, count: int) -> Floats:
        """(count, n): dimensions dim .. dim + count - 1, one sample a row. pixel, sample: (n,), sample from
        0.
        """
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
