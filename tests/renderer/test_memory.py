"""Memory of freed arrays stays with the process."""

from __future__ import annotations

import ctypes
import resource
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from renderer.memory import keep_freed_memory

ROUNDS, ARRAYS, SIZE = 20, 40, 2**17  # arrays of 1 MB, 256 pages each


def _faults_of_rounds() -> int:
    """Page faults of a thread that makes some arrays and frees them, again and again."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(ROUNDS):
        del [np.ones(SIZE) for _ in range(ARRAYS)][:]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="the allocator is not glibc's")
def test_a_thread_gets_the_pages_that_it_freed() -> None:
    """Pages are mapped once, not each round: handed back, those of each round would fault anew."""
    keep_freed_memory()
    with ThreadPoolExecutor(1) as pool:
        pool.submit(_faults_of_rounds).result()
        assert pool.submit(_faults_of_rounds).result() < ROUNDS * ARRAYS * 256 / 10
