"""References on disk, keyed by all that they depend on: scene, backend and version, quantity, seed.

    <key>/reference.exr, reference.npz   mean, variance and count, to look at and in float64
    <key>/provenance.json, SHA256SUMS    their origin and seal
    <key>.unfinished                     batches of an interrupted reference, checksum first

The number of samples is no part of the key: a request for more adds batches to the stored ones. A folder is
written aside and sealed with checksums (see `pipeline.store.sealed_folder`); <key>.unfinished is removed only
after that. A process killed at any moment loses the samples since its last save, about a second's work. Of
two processes that want the same reference one waits for the other.
"""

from __future__ import annotations

import json
import logging
import os
import shutil
import zipfile
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from pipeline.references.accumulator import Accumulator
from pipeline.references.batches import met, to_accumulator
from pipeline.references.protocol import (
    BACKENDS,
    Continuation,
    Progress,
    ReferenceBackend,
    ReferenceImage,
    ReferenceRequest,
    refusal,
    substituted,
)
from pipeline.references.unfinished import Unfinished
from pipeline.schema.record import ReferenceInfo
from pipeline.store.keys import reference_key
from pipeline.store.lock import locked
from pipeline.store.machine import machine
from pipeline.store.npz import from_npz, to_npz
from pipeline.store.sealed_folder import SEAL, Writer, damage, sealed, write_entry
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError
from scenes.images.exr import write_estimate_exr

log = logging.getLogger("penumbra")

EXR, STATE, PROVENANCE = FILES = ("reference.exr", "reference.npz", "provenance.json")
UNFINISHED = ".unfinished"


@dataclass(frozen=True, eq=False)
class StoredReference:
    """A reference on disk.

    path: its EXR. key: its content address. fresh: whether this call drew samples. kept: samples a pixel that
    were stored before.
    """

    path: Path
    key: str
    backend: str
    image: ReferenceImage
    fresh: bool
    kept: int = 0


class _Damaged(Exception):
    """A stored reference that cannot be used."""


def reference_for(
    scene: SceneDescription,
    backend_name: str,
    request: ReferenceRequest,
    root: Path,
    progress: Progress | None = None,
) -> StoredReference:
    """Find the reference of a scene in the cache `root`, or make it and store it there.

    A stored reference with too few samples is added to; a damaged one is reported through the logger
    "penumbra" and made again. After an interruption the next call goes on from the batches that were
    finished. PenumbraError if the backend is unknown, refuses the scene or fails, or if `root` cannot be
    written, which is found out before rendering.
    """
    backend = BACKENDS[backend_name]
    if reason := substituted(scene):  # the stored one of the same content is of another file
        raise PenumbraError(f"scene {scene.name}: no {backend.name} reference: {reason}")
    key = key_for(scene.content_hash(), backend_name, backend.version(), request)
    try:
        stored = _read(root / key, key, backend_name)  # without a lock: `root` may be there to be read only
    except _Damaged:
        stored = None
    if stored and met(stored.image, request):
        return stored
    reason = refusal(backend, scene, request.quantity)
    if reason:
        raise PenumbraError(f"scene {scene.name}: no {backend.name} reference: {reason}")
    with _locked(root, key):
        stored = _load(root / key, key, backend_name)
        if stored and met(stored.image, request):
            return stored
        return _make(scene, backend, request, root / key, stored, progress)


def key_for(scene_hash: str, backend: str, version: str, request: ReferenceRequest) -> str:
    """The content address of a reference; the number of samples is no part of it."""
    return reference_key(scene_hash, backend, version, request.quantity, request.seed)


def to_info(stored: StoredReference, run_folder: Path) -> ReferenceInfo:
    """The reference as records describe it, its image's path relative to `run_folder`."""
    image = stored.image
    return ReferenceInfo(
        backend=stored.backend,
        key=stored.key,
        spp=image.spp,
        batches=image.batches,
        rms_standard_error=float(np.sqrt(image.variance.mean())),
        seconds=image.seconds,
        image=Path(os.path.relpath(stored.path, run_folder)).as_posix(),
    )


@contextmanager
def _locked(root: Path, key: str) -> Generator[None]:
    """Keep other processes from making this reference, until this process ends at the latest."""

    def busy() -> None:
        log.warning("reference %s is being made by another process; waiting for it", key)

    lock = root / f".{key}.lock"
    with ExitStack() as stack:
        try:
            root.mkdir(parents=True, exist_ok=True)
            lock.touch()
        except OSError as error:
            raise PenumbraError(f"{root}: references cannot be written here: {error.strerror}") from error
        try:
            stack.enter_context(locked(lock, busy))
        except OSError as error:  # a file system without locks: renaming still keeps entries whole
            log.warning("%s: references cannot be locked here: %s", root, error.strerror)
        yield


def _make(
    scene: SceneDescription,
    backend: ReferenceBackend,
    request: ReferenceRequest,
    entry: Path,
    stored: StoredReference | None,
    progress: Progress | None,
) -> StoredReference:
    """Render the samples that are missing, and store the whole reference."""
    unfinished = Unfinished(entry.with_name(entry.name + UNFINISHED), entry.name)
    start = _start(stored, unfinished.read(scene.film))
    try:
        image = backend.render(scene, request, progress, Continuation(start, unfinished.keep))
    finally:
        unfinished.save()
    image = _described(image, entry.name, backend, scene, request)
    _write(entry, image)
    unfinished.remove()
    return StoredReference(
        entry / EXR, entry.name, backend.name, image, fresh=True, kept=start.spp if start else 0
    )


def _start(stored: StoredReference | None, unfinished: Accumulator | None) -> Accumulator | None:
    """The stored reference or the unfinished one, whichever has more samples."""
    done = to_accumulator(stored.image) if stored and stored.image.batches > 1 else None
    found = [accumulator for accumulator in (done, unfinished) if accumulator]
    return max(found, key=lambda accumulator: accumulator.spp, default=None)


def _described(
    image: ReferenceImage,
    key: str,
    backend: ReferenceBackend,
    scene: SceneDescription,
    request: ReferenceRequest,
) -> ReferenceImage:
    """Add the cache's own facts to the image's provenance, numbers in full so that they are read back
    exactly.
    """
    known = {
        "key": key,
        "scene": scene.content_hash(),
        "backend": backend.name,
        "version": backend.version(),
        "quantity": request.quantity,
        "spp": str(image.spp),
        "batches": str(image.batches),
        "seconds": repr(image.seconds),
        "seed": str(request.seed),
        "machine": machine(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    return replace(image, provenance=image.provenance | known)


def _write(entry: Path, image: ReferenceImage) -> None:
    count = np.full(image.mean.shape[:2], float(image.spp))
    text = json.dumps(image.provenance)
    state = {"mean": image.mean, "variance": image.variance, "count": count, "provenance": np.array(text)}
    files: dict[str, Writer | bytes] = {
        EXR: lambda path: write_estimate_exr(path, image.mean, image.variance, count, image.provenance),
        STATE: to_npz(state),
        PROVENANCE: json.dumps(image.provenance, indent=1).encode(),
    }
    scratch = entry.parent / f".{entry.name}.draft"
    try:
        shutil.rmtree(scratch, ignore_errors=True)  # of a process that was killed: the lock is ours
        write_entry(entry, scratch, files)
        shutil.rmtree(scratch, ignore_errors=True)
    except OSError as error:
        raise PenumbraError(f"{entry}: cannot be written: {error.strerror or error}") from error


def _load(entry: Path, key: str, backend: str) -> StoredReference | None:
    """The stored reference, or None; a damaged one is reported and removed."""
    try:
        return _read(entry, key, backend)
    except _Damaged as error:
        log.warning("reference %s is damaged (%s); it will be made again", entry, error)
        shutil.rmtree(entry, ignore_errors=True)
        return None


def _read(entry: Path, key: str, backend: str) -> StoredReference | None:
    """The stored reference, or None; _Damaged if a file was altered or belongs to another key."""
    if not entry.is_dir():
        return None
    problem = damage(entry)
    if problem:
        raise _Damaged(problem)
    try:
        if sorted(sealed(entry)) != sorted(FILES):
            raise _Damaged(f"{SEAL} is not whole")
        arrays = from_npz((entry / STATE).read_bytes())
        provenance = json.loads(str(arrays["provenance"]))
        image = ReferenceImage(
            mean=arrays["mean"],
            variance=arrays["variance"],
            spp=int(provenance["spp"]),
            batches=int(provenance["batches"]),
            seconds=float(provenance["seconds"]),
            provenance=provenance,
        )
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise _Damaged(str(error) or type(error).__name__) from error
    if provenance.get("key") != key:
        raise _Damaged("its provenance is another's")
    return StoredReference(entry / EXR, key, backend, image, fresh=False, kept=image.spp)
