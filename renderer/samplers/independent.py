"""Independent uniform numbers from a counter-based generator: a keyed SplitMix64 [steele2014]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from renderer.interfaces.sampler import GOLDEN, SAMPLERS, Integers, key, mix
from renderer.math.vectors import Floats

SAMPLE_STRIDE = np.uint64(0xD1B54A32D192ED03)  # odd, so that distinct samples have distinct counters


@dataclass(frozen=True)
class Independent:
    """Independent numbers: the error falls as 1/sqrt(spp)."""

    seed: int
    spp: int
    name: ClassVar[str] = "independent"
    title: ClassVar[str] = "independent random numbers"
    independent: ClassVar[bool] = True
    prefix: ClassVar[bool] = True

    def uniform(self, pixel: Integers, sample: Integers, dim: int, count: int) -> Floats:
        state = mix(key(self.seed, pixel) + sample.astype(np.uint64) * SAMPLE_STRIDE)
        out = np.zeros((count, pixel.size))
        for i in range(count):
            bits = mix(state + np.uint64(((dim + i + 1) * GOLDEN) & 0xFFFFFFFFFFFFFFFF))
            np.multiply(bits >> np.uint64(11), 2.0**-53, out=out[i])
        return out


SAMPLERS.add("independent", Independent)
