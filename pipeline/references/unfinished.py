"""The batches of a reference that is not finished yet, in one file that is always whole."""

from __future__ import annotations

import logging
import time
import zipfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pipeline.references.accumulator import Accumulator
from pipeline.store.npz import from_npz, to_npz
from scenes.description.scene import Film
from scenes.files import write_file
from scenes.hashing import hash_bytes

log = logging.getLogger("penumbra")

SAVE_EVERY = 1.0  # seconds
SAVE_SHARE = 10.0  # and at least so many times as long as saving takes
SEAL = 32  # bytes of SHA-256 before the .npz


@dataclass
class Unfinished:
    """The file of an unfinished reference, which batches are saved to about once a second.

    key: of the reference. The file holds it too, so that a renamed file is not taken for another reference's.
    last: the accumulator that is not saved yet. next_save: when to save, by time.monotonic().
    """

    path: Path
    key: str
    last: Accumulator | None = None
    next_save: float = field(default_factory=lambda: time.monotonic() + SAVE_EVERY)

    def read(self, film: Film) -> Accumulator | None:
        """The batches that an interrupted call left; None if there are none, or the file is damaged."""
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
        """Remember the batches drawn so far, and save them if it is time."""
        self.last = accumulator
        start = time.monotonic()
        if start >= self.next_save:
            self.save()
            self.next_save = time.monotonic() + max(SAVE_EVERY, SAVE_SHARE * (time.monotonic() - start))

    def save(self) -> None:
        """Write the batches that are not saved yet, atomically."""
        accumulator, self.last = self.last, None
        if accumulator is None:
            return
        content = to_npz({"key": np.array(self.key)} | vars(accumulator))
        write_file(self.path, bytes.fromhex(hash_bytes(content)) + content)

    def remove(self) -> None:
        """Delete the file, once the reference itself is stored."""
        self.path.unlink(missing_ok=True)


def _parse(data: bytes, key: str, shape: tuple[int, int, int]) -> Accumulator:
    """The accumulator in a saved file; ValueError or KeyError if it is damaged or another reference's."""
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
