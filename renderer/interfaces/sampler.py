"""The protocol of a sampler, and the keys of its pixels."""

from __future__ import annotations

from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from renderer.math.hashing import GOLDEN, WORD, UInt64, mix
from renderer.math.vectors import Floats
from scenes.arrays import Index
from scenes.registry import Registry


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

    def uniform(self, pixel: Index, sample: Index, dim: int, count: int) -> Floats:
        """(count, n): dimensions dim .. dim + count - 1, one sample a row. pixel, sample: (n,), sample from
        0.
        """
        ...


SAMPLERS: Registry[type[Sampler]] = Registry("sampler", "renderer.samplers")


def key(seed: int, pixel: Index) -> UInt64:
    """A 64-bit key (n,) for each pixel of a seed."""
    start = mix(np.array([seed & WORD], dtype=np.uint64) + np.uint64(GOLDEN))
    return mix(mix(pixel.astype(np.uint64) + np.uint64(1)) + start)
