"""Freed arrays keep their memory for the next ones.

A wavefront makes and frees some hundred arrays of a few sizes. glibc returns arrays above its mmap threshold
to the system at once, and their pages are cleared and mapped anew: with two threads a fifth of the time. Both
thresholds adapt, but a thread that starts late finds them low again.
"""

from __future__ import annotations

import ctypes
from functools import cache

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # malloc.h
LARGEST = 2**25  # bytes: glibc's own limit of the mmap threshold, far above a wavefront's arrays
KEPT = 2**28  # bytes of free memory at the top of the heap; what exceeds it is handed back


@cache
def keep_freed_memory() -> None:
    """Set the thresholds of this process once; allocators other than glibc's are left as they are."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_MMAP_THRESHOLD, LARGEST)
        mallopt(M_TRIM_THRESHOLD, KEPT)
