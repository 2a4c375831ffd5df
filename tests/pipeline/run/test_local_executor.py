"""Real processes: what a worker gets, what its death costs, and that none outlives its run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.run.executors.local import THREAD_VARIABLES, LocalExecutor
from pipeline.run.executors.protocol import Executor
from scenes.errors import PenumbraError
from tests.kit.executor_items import slow, square, troubled

ROOT = Path(__file__).parents[3]
PATIENCE = 120.0  # seconds; an upper bound, for machines with much else to do


def alive(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def wait_until(condition: Callable[[], bool]) -> bool:
    end = time.monotonic() + PATIENCE
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


@pytest.mark.usefixtures("processes")
def test_workers_compute_with_one_thread_in_processes_of_their_own() -> None:
    before = dict(os.environ)
    with LocalExecutor(2) as executor:
        assert isinstance(executor, Executor)
        outcomes = list(executor.map(square, range(12)))
    results = [outcome.result for outcome in outcomes if outcome.result is not None]
    assert {outcome.item: result[0] for outcome, result in zip(outcomes, results, strict=True)} == {
        x: x * x for x in range(12)
    }
    pids = {pid for _, pid, _ in results}
    assert 1 <= len(pids) <= 2
    assert os.getpid() not in pids
    assert all(variables == ["1"] * len(THREAD_VARIABLES) for _, _, variables in results)
    assert dict(os.environ) == before
    assert not any(alive(pid) for pid in pids)


@pytest.mark.usefixtures("processes")
def test_an_item_that_fails_fails_alone_and_says_why() -> None:
    with LocalExecutor(2) as executor:
        outcomes = {outcome.item: outcome for outcome in executor.map(troubled, range(6))}
    assert {x: o.result for x, o in outcomes.items()} == {0: 0, 1: None, 2: None, 3: None, 4: 4, 5: 5}
    assert outcomes[1].failure == "scene 1 has no lights"
    assert str(outcomes[2].failure).startswith("ValueError: two (executor_items.py:")
    assert outcomes[3].failure == "the worker process died (BrokenProcessPool)"


@pytest.mark.usefixtures("processes")
def test_leaving_by_an_error_ends_workers_at_once() -> None:
    pids: set[int] = set()

    def interrupted() -> None:
        with LocalExecutor(2) as executor:
            pids.update(o.result[1] for o in executor.map(square, range(8)) if o.result)
            for _ in executor.map(slow, [0, 1, 2]):  # the first ends after 0.1 s, the others after minutes
                raise KeyboardInterrupt

    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - start < PATIENCE
    assert pids
    assert not any(alive(pid) for pid in pids)


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGTERM])
@pytest.mark.usefixtures("processes")
def test_workers_die_with_the_run(sent: signal.Signals) -> None:
    """SIGKILL leaves the run no chance to end its workers: they must notice by themselves."""
    command = [sys.executable, "-m", "tests.kit.executor_items"]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as run:
        assert run.stdout is not None
        pids = [int(word) for word in run.stdout.readline().split()]
        assert pids
        assert all(alive(pid) for pid in pids)
        run.send_signal(sent)
        run.wait(PATIENCE)
        assert wait_until(lambda: not any(alive(pid) for pid in pids))


def test_no_workers_are_refused() -> None:
    with pytest.raises(PenumbraError, match="workers = 0: give at least 1"):
        LocalExecutor(0)
