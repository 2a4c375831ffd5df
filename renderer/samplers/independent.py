"""Independent uniform numbers from a counter-based generator: a keyed SplitMix64 [steele2014]."""

from __future__ import annotations

import numpy as np

from renderer.arrays import Floats
from renderer.samplers.protocol import GOLDEN, SAMPLERS, Integers, key, mix

SAMPLE_STRIDE = np.uint64(0xD1B54A32D192ED03)  # odd, so that distinct samples have distinct counters


class Independent:
    """Every number independent of every other: the baseline, whose error falls as 1/sqrt(spp)."""

    name = "independent"
    title = "independent random numbers"
    independent = True
    prefix = True

    def uniform(self, seed: int, pixel: Integers, sample: Integers, dim: int, count: int) -> Floats:
        """See `Sampler`."""
        state = mix(key(seed, pixel) + sample.astype(np.uint64) * SAMPLE_STRIDE)
        out = np.zeros((count, pixel.size))
        for i in range(count):
            bits = mix(state + np.uint64(((dim + i + 1) * GOLDEN) & 0xFFFFFFFFFFFFFFFF))
            np.multiply(bits >> np.uint64(11), 2.0**-53, out=out[i])
        return out


SAMPLERS.add("independent", Independent())
