"""References that were interrupted: nothing that was finished is lost, and nothing that is damaged is
taken.
"""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.references import cache, unfinished
from pipeline.references.cache import UNFINISHED
from pipeline.references.protocol import ReferenceRequest
from tests.kit.fake_batches import FakeBackend, ask, fake, small

__all__ = ["fake"]

ROOT = Path(__file__).parents[3]
CUT = "the third batch of four"


def interrupt_at(backend: FakeBackend, batch: int) -> None:
    def during() -> None:
        if len(backend.drawn) == batch:
            raise KeyboardInterrupt

    backend.during = during


def never() -> None:
    """Go on."""


def interrupted(backend: FakeBackend, root: Path, batch: int = 2) -> Path:
    """A call that is stopped before batch number `batch`; the file that it leaves."""
    interrupt_at(backend, batch)
    with pytest.raises(KeyboardInterrupt):
        ask(root)
    backend.during = never
    (left,) = root.glob(f"*{UNFINISHED}")
    return left


def test_an_interrupted_reference_goes_on(fake: FakeBackend, tmp_path: Path):
    left = interrupted(fake, tmp_path / "cut")
    again = ask(tmp_path / "cut")
    assert (again.fresh, again.kept, again.image.spp) == (True, 4, 8) and len(fake.drawn) == 4
    assert not left.exists()
    whole = ask(tmp_path / "whole")
    np.testing.assert_array_equal(again.image.mean, whole.image.mean)
    np.testing.assert_array_equal(again.image.variance, whole.image.variance)


def test_an_interrupted_addition_keeps_both_parts(fake: FakeBackend, tmp_path: Path):
    ask(tmp_path)
    interrupt_at(fake, 6)
    with pytest.raises(KeyboardInterrupt):
        ask(tmp_path, request=ReferenceRequest(80, 4, 3))
    fake.during = never
    assert ask(tmp_path).image.spp == 8, "what was finished stays as it is until more is finished"
    more = ask(tmp_path, request=ReferenceRequest(80, 4, 3))
    assert (more.kept, more.image.spp, len(fake.drawn)) == (48, 88, 8)


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


DAMAGE: dict[str, Callable[[Path], object]] = {
    "flipped bit": flip,
    "truncated": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("hello"),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_damaged_batches_are_reported_and_drawn_again(
    fake: FakeBackend, tmp_path: Path, caplog: pytest.LogCaptureFixture, kind: str
):
    DAMAGE[kind](interrupted(fake, tmp_path))
    with caplog.at_level(logging.WARNING, "penumbra"):
        again = ask(tmp_path)
    assert again.kept == 0 and len(fake.drawn) == 6 and "unfinished" in caplog.text


def test_batches_of_another_reference_are_reported_and_drawn_again(
    fake: FakeBackend, tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    """A file that was renamed or copied over: whole, of the right size, and of another scene."""
    left = interrupted(fake, tmp_path)
    interrupt_at(fake, 4)
    with pytest.raises(KeyboardInterrupt):
        ask(tmp_path, small(albedo=0.25))
    fake.during = never
    (other,) = set(tmp_path.glob(f"*{UNFINISHED}")) - {left}
    left.replace(other)
    with caplog.at_level(logging.WARNING, "penumbra"):
        again = ask(tmp_path, small(albedo=0.25))
    assert again.kept == 0 and "another reference" in caplog.text


def test_killed_between_any_two_steps_of_storing(
    fake: FakeBackend, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The old entry already gone and the new one not in place: the batches are still there, and none is drawn
    again.
    """
    ask(tmp_path)

    def killed(*_: object) -> None:
        for entry in tmp_path.glob("[0-9a-f]*[0-9a-f]"):
            if entry.is_dir():
                entry.rename(tmp_path / ".aside")
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(cache, "write_entry", killed)
        with pytest.raises(KeyboardInterrupt):
            ask(tmp_path, request=ReferenceRequest(80, 4, 3))
    drawn = len(fake.drawn)
    again = ask(tmp_path, request=ReferenceRequest(80, 4, 3))
    assert (again.kept, again.image.spp, len(fake.drawn)) == (88, 88, drawn)


def test_batches_are_saved_now_and_then(fake: FakeBackend, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Not only when somebody is there to tidy up: as after a SIGKILL."""
    monkeypatch.setattr(unfinished, "SAVE_EVERY", 0.0)
    monkeypatch.setattr(unfinished, "SAVE_SHARE", 0.0)
    seen: list[int] = []
    fake.during = lambda: seen.append(len(list(tmp_path.glob(f"*{UNFINISHED}"))))
    ask(tmp_path)
    assert seen == [0, 1, 1, 1] and not list(tmp_path.glob(f"*{UNFINISHED}"))


SCRIPT = """
import sys, time
from pathlib import Path
from pipeline.references.protocol import BACKENDS, ReferenceRequest
from pipeline.references.cache import reference_for
from tests.kit.fake_batches import FakeBackend, small
backend = FakeBackend(during=lambda: time.sleep(0.02))
BACKENDS.names()
BACKENDS.add("fake", backend)
found = reference_for(small(), "fake", ReferenceRequest(1024, 128), Path(sys.argv[1]))
print(found.kept, found.image.spp, len(backend.drawn))
"""


@pytest.mark.usefixtures("processes")
def test_killed_by_sigkill_it_goes_on_from_what_was_saved(tmp_path: Path):
    """A real process, killed when it has saved for the first time; nothing of it is drawn twice."""
    command = [sys.executable, "-c", SCRIPT, str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, cwd=ROOT, env=environment) as process:
        limit = time.monotonic() + 60
        while not list(tmp_path.glob(f"[0-9a-f]*{UNFINISHED}")):
            assert time.monotonic() < limit and process.poll() is None
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    kept, spp, drawn = (int(word) for word in done.stdout.split())
    assert spp == 1024 and kept > 0 and drawn == 128 - kept // 8
    print(f"{kept} of {spp} samples a pixel survived")
