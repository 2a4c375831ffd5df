"""A lock between processes: a file whose lock the system frees when its holder ends."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout


@contextmanager
def locked(path: Path, busy: Callable[[], None] = lambda: None) -> Generator[None]:
    """Hold the lock file `path`, which is kept after the lock is released.

    busy: called once if another process holds the lock. It may raise; else the lock is waited for. OSError if
    the file cannot be made, or its file system has no locks.
    """
    lock = FileLock(path, fallback_to_soft=False)
    try:
        lock.acquire(blocking=False)
    except Timeout:
        busy()
        lock.acquire()
    try:
        yield
    finally:
        lock.release()
