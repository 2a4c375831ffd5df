"""The seed of each call of Mitsuba: no two calls of a series share random numbers."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from scenes.description.scene import Film
from scenes.errors import PenumbraError

# Of one series: all seeds are drawn at once, so that the first do not depend on their number.
MOST_CALLS = 2**16
BLOCK = 32 * 32  # the scalar variant counts seeds in blocks of this many pixels


def seeds_for(seed: int, film: Film, variant: str, first: int, count: int) -> tuple[int, ...]:
    """The 32-bit seeds of calls first .. first + count - 1 of the series, drawn without replacement.

    The LLVM variant hashes seeds: any that differ will do. The scalar variant does not. It gives pixel i of a
    call the stream seed * pixels + i, counting in whole blocks, of which there are more pixels than the image
    has: neighbouring seeds share streams, so that a slot of `stride` seeds holds one. And streams whose
    numbers are evenly spaced are lattices of one generator: measured, evenly spaced seeds made the spread of
    the batches overstate the variance by 14 %.

    PenumbraError if the image has too many pixels, or the series too many calls.
    """
    pixels = film.width * film.height
    blocks = -(-film.width // 32) * -(-film.height // 32)
    scalar = variant.startswith("scalar")
    stride = -(-blocks * BLOCK // pixels) if scalar else 1
    slots = 2**32 // (stride * pixels) if scalar else 2**32
    if min(slots, MOST_CALLS) < first + count:
        raise PenumbraError(
            f"{film.width} x {film.height} pixels are too many for {first + count} calls of Mitsuba's "
            f"{variant} (at most {min(slots, MOST_CALLS)}): ask for a smaller image or fewer samples"
        )
    return tuple(int(slot) * stride for slot in _slots(seed, slots)[first : first + count])


@functools.lru_cache(maxsize=8)
def _slots(seed: int, slots: int) -> NDArray[np.int64]:
    return np.random.default_rng(seed).choice(slots, min(slots, MOST_CALLS), replace=False)
