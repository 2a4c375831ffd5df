"""Independent uniform numbers from a counter-based generator: a keyed SplitMix64 [steele2014]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from renderer.interfaces.sampler import SAMPLERS, key
from renderer.math.hashing import mix, stream
from renderer.math.vectors import Floats
from scenes.arrays import Index

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

    def uniform(self, pixel: Index, sample: Index, dim: int, count: int) -> Floats:
        state = mix(key(self.seed, pixel) + sample.astype(np.uint64) * SAMPLE_STRIDE)
        return stream(state, dim, count)


SAMPLERS.add("independent", Independent)
