"""Folders that are whole or not there: written aside, sealed with checksums, then renamed into place.

A killed process leaves nothing under the final name. What a power cut or a stray edit truncates, the
checksums show, so that single files need no fsync.
"""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path

from scenes.hashing import hash_file

SEAL = "SHA256SUMS"
Writer = Callable[[Path], None]


def write_entry(final: Path, scratch: Path, writers: Mapping[str, Writer]) -> None:
    """Make the folder `final` of the files that `writers` write, atomically; an entry already there is
    replaced.

    scratch: a folder on the same file system, for what is half-written. The seal is in `sha256sum -c` format.
    """
    draft = scratch / uuid.uuid4().hex
    draft.mkdir(parents=True)
    for name, write in writers.items():
        write(draft / name)
    (draft / SEAL).write_text("".join(f"{hash_file(draft / name)}  {name}\n" for name in writers))
    _replace(draft, final, scratch)


def _replace(draft: Path, final: Path, scratch: Path) -> None:
    """Put `draft` in the place of `final`; directories cannot be swapped portably, so an old one steps aside
    first.
    """
    final.parent.mkdir(parents=True, exist_ok=True)
    if final.exists():
        aside = scratch / uuid.uuid4().hex
        final.rename(aside)
        shutil.rmtree(aside)
    draft.rename(final)


def damage(entry: Path) -> str | None:
    """The damage to an entry, in words: a file that is missing or was altered since it was sealed.

    None: it is whole.
    """
    try:
        pairs = [line.partition("  ") for line in (entry / SEAL).read_text(encoding="utf-8").splitlines()]
    except (OSError, UnicodeDecodeError):
        return f"{SEAL} cannot be read"
    if not pairs:
        return f"{SEAL} is empty"
    for expected, _, name in pairs:
        if not (entry / name).is_file():
            return f"{name} is missing"
        if hash_file(entry / name) != expected:
            return f"{name} is not what was written"
    return None


def sealed(entry: Path) -> list[str]:
    """The names of the files that an entry was sealed with."""
    return [line.partition("  ")[2] for line in (entry / SEAL).read_text(encoding="utf-8").splitlines()]
