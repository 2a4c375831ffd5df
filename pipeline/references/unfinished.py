"""The batches of a reference that is not finished yet, in one file that is always whole."""

from __future__ import annotations

import io
import logging
import time
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.references.accumulator import Accumulator
from scenes.description.scene import Film
from scenes.files import write_file
from scenes.hashing import hash_bytes

log = logging.getLogger("penumbra")

SAVE_EVERY = 1.0  # seconds
SAVE_SHARE = 10.0  # and at least so many times as long as saving takes
SEAL = 32  # bytes of SHA-256 before the .npz


@dataclass
class Unfinished:
    """The file of an unfinished reference: read once, then saved to now and then, and whenever it is told to.

    path: of the file. key: of the reference, which the file holds as well: under another name its batches are
    another's. last: what is not saved yet. next_save: when to, by time.monotonic().
    """

    path: Path
    key: str
    last: Accumulator | None = None
    next_save: float = field(default_factory=lambda: time.monotonic() + SAVE_EVERY)

    def read(self, film: Film) -> Accumulator | None:
        """The work that an interrupted call left, None if there is nothing or nothing whole."""
        if not self.path.is_file():
            return None
        try:
            return _parse(self.path.read_bytes(), self.key, (film.height, film.width, 3))
        except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
            log.warning(
                "the unfinished reference %s is damaged (%s); it will be made again", self.path, error
            )
            return None

    def keep(self, accumulator: Accumulator) -> None:
        """Take note of a finished batch; save if it is time."""
        self.last = accumulator
        start = time.monotonic()
        if start >= self.next_save:
            self.save()
            self.next_save = time.monotonic() + max(SAVE_EVERY, SAVE_SHARE * (time.monotonic() - start))

    def save(self) -> None:
        """Write what is not written yet, atomically."""
        accumulator, self.last = self.last, None
        if accumulator is None:
            return
        told = {
            "key": self.key,
            "spp": accumulator.spp,
            "batches": accumulator.batches,
            "seconds": accumulator.seconds,
        }
        content = to_npz(
            {"mean": accumulator.mean, "m2": accumulator.m2} | {name: np.array(v) for name, v in told.items()}
        )
        write_file(self.path, bytes.fromhex(hash_bytes(content)) + content)

    def remove(self) -> None:
        """Once the reference is stored."""
        self.path.unlink(missing_ok=True)


def _parse(data: bytes, key: str, shape: tuple[int, int, int]) -> Accumulator:
    """ValueError and the like where `data` is not what was saved, or is another reference's."""
    content = data[SEAL:]
    if bytes.fromhex(hash_bytes(content)) != data[:SEAL]:
        raise ValueError("it does not match its checksum")
    arrays = from_npz(content)
    if str(arrays["key"]) != key:
        raise ValueError(f"it holds batches of another reference, {arrays['key']}")
    if arrays["mean"].shape != shape:
        raise ValueError(f"it is of size {arrays['mean'].shape}, not {shape}")
    numbers = int(arrays["spp"]), int(arrays["batches"]), float(arrays["seconds"])
    return Accumulator(arrays["mean"], arrays["m2"], *numbers)


def to_npz(arrays: Mapping[str, Any]) -> bytes:
    """The bytes of an .npz."""
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getvalue()


def from_npz(content: bytes) -> dict[str, Any]:
    """Its arrays by name."""
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}
