"""Functions that workers compute in tests; a worker imports this module, so that it imports little."""

from __future__ import annotations

import os
import signal
import time

from pipeline.run.executors.local import THREAD_VARIABLES, LocalExecutor
from scenes.errors import PenumbraError


def square(x: int) -> tuple[int, int, list[str | None]]:
    """The square, the process that computed it, and the thread variables there."""
    return x * x, os.getpid(), [os.environ.get(name) for name in THREAD_VARIABLES]


def troubled(x: int) -> int:
    """Fails in its own way for 1, 2 and 3."""
    if x == 1:
        raise PenumbraError("scene 1 has no lights")
    if x == 2:
        raise ValueError("two")
    if x == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


def slow(x: int) -> int:
    time.sleep(0.1 if x == 0 else 120)
    return x


def main() -> None:
    """A run that never ends by itself: prints its workers' processes once they are at work."""
    with LocalExecutor(2) as executor:
        pids = {outcome.result[1] for outcome in executor.map(square, range(20)) if outcome.result}
        print(*pids, flush=True)
        for _ in executor.map(slow, [1, 2]):
            pass


if __name__ == "__main__":
    main()
