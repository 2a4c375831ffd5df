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


def write_entry(final: Path, scratch: Path, files: Mapping[str, Writer | bytes]) -> None:
    """Make the folder `final` with some files, atomically; a folder that is already there is replaced.

    files: the content of each file by its name, or a function that writes it to the path it is given.
    scratch: a folder on the same file system, for drafts. The seal is in `sha256sum -c` format.
    """
    draft = scratch / uuid.uuid4().hex
    draft.mkdir(parents=True)
    for name, content in files.items():
        if isinstance(content, bytes):
            (draft / name).write_bytes(content)
        else:
            content(draft / name)
    (draft / SEAL).write_text("".join(f"{hash_file(draft / name)}  {name}\n" for name in files))
    _replace(draft, final, scratch)


def _replace(draft: Path, final: Path, scratch: Path) -> None:
    """Rename `draft` to `final`; an old folder is moved aside first, since swapping is not portable."""
    final.parent.mkdir(parents=True, exist_ok=True)
    if final.exists():
        aside = scratch / uuid.uuid4().hex
        final.rename(aside)
        shutil.rmtree(aside)
    draft.rename(final)


def damage(entry: Path) -> str | None:
    """Describe the first file of a sealed folder that is missing or was altered; None if all are intact."""
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
    """The names of the files that a folder was sealed with."""
    return [line.partition("  ")[2] for line in (entry / SEAL).read_text(encoding="utf-8").splitlines()]
