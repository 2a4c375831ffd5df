"""Worker processes on this machine: each computes with one thread and dies with the run that started it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from pipeline.run.executors.protocol import Outcome
from scenes.errors import PenumbraError

T = TypeVar("T")
R = TypeVar("R")
Answer = tuple[R | None, str | None]

# Every pool of threads that a library under us might start; the variables are read when it is first loaded.
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")


@dataclass(frozen=True)
class _Worker:
    """A pool of one process, so that a process that dies takes only its own item with it."""

    pool: ProcessPoolExecutor
    pid: Future[int]

    def kill(self) -> None:
        if self.pid.done() and self.pid.exception() is None:
            with suppress(ProcessLookupError):  # it is gone already
                os.kill(self.pid.result(), signal.SIGKILL)
        self.pool.shutdown(wait=True, cancel_futures=True)


class LocalExecutor:
    """Computes in `workers` processes, which are spawned when first needed.

    A context manager: leaving it ends them, at once after an error.
    """

    def __init__(self, workers: int) -> None:
        if workers < 1:
            raise PenumbraError(f"workers = {workers}: give at least 1")
        self.workers = workers
        self._idle: list[_Worker] = []
        self._busy: list[_Worker] = []

    def __enter__(self) -> LocalExecutor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        while self._busy:
            self._busy.pop().kill()
        while self._idle:
            self._idle.pop().pool.shutdown(wait=True)

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[Outcome[T, R]]:
        waiting = list(reversed(items))
        flying: dict[Future[Answer[R]], tuple[_Worker, T]] = {}
        while waiting or flying:
            while waiting and len(flying) < self.workers:
                worker, item = self._take(), waiting.pop()
                flying[worker.pool.submit(_call, function, item)] = (worker, item)
            for future in wait(flying, return_when=FIRST_COMPLETED).done:
                worker, item = flying.pop(future)
                yield self._land(future, worker, item)

    def _take(self) -> _Worker:
        worker = self._idle.pop() if self._idle else _start()
        self._busy.append(worker)
        return worker

    def _land(self, future: Future[Answer[R]], worker: _Worker, item: T) -> Outcome[T, R]:
        self._busy.remove(worker)
        error = future.exception()
        if error is not None:  # not the item's own error: `_call` answers with those
            worker.kill()
            return Outcome(item, None, f"the worker process died ({type(error).__name__})")
        self._idle.append(worker)
        result, failure = future.result()
        return Outcome(item, result, failure)


def _start() -> _Worker:
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(1, mp_context=context, initializer=_begin)
    with _one_thread():
        return _Worker(pool, pool.submit(os.getpid))


@contextmanager
def _one_thread() -> Generator[None]:
    """Set the environment of new processes to one thread."""
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _begin() -> None:
    """Begin a worker: leave Ctrl-C to the run, and end with it, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_die_with_parent, daemon=True).start()


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


def _call(function: Callable[[T], R], item: T) -> Answer[R]:
    try:
        return function(item), None
    except PenumbraError as error:
        return None, str(error)
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        return None, f"{type(error).__name__}: {error} ({Path(frame.filename).name}:{frame.lineno})"
