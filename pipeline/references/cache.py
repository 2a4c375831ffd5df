"""References kept by what they depend on: scene content, backend and its version, request.

One entry is one folder named by its key, holding reference.exr (mean, variance, count, provenance; for eyes and reports)
and reference.npz (the same in float64, its checksum in the EXR). A folder is made under another name and renamed into place, so
that it is whole or not there, and of two processes that want the same one the second takes the first's.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import os
import secrets
import shutil
import time
import zipfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.record import ReferenceInfo
from pipeline.references.protocol import BACKENDS, Progress, ReferenceBackend, ReferenceImage, ReferenceRequest
from scenes.description import SceneDescription
from scenes.errors import PenumbraError
from scenes.images import read_estimate_exr, write_estimate_exr

log = logging.getLogger("penumbra")

FORMAT = 1  # goes into the key: entries of another layout are other entries
DAY = 86_400.0  # seconds
EXR, STATE, CHECKSUM = "reference.exr", "reference.npz", "sha256 of reference.npz"


@dataclass(frozen=True, eq=False)
class StoredReference:
    """A reference on disk. path: its EXR; key: its content address; backend: its name; fresh: rendered by this very call."""

    path: Path
    key: str
    backend: str
    image: ReferenceImage
    fresh: bool


class _Damaged(Exception):
    """An entry that is there and cannot be used."""


def reference_for(
    scene: SceneDescription,
    backend_name: str,
    request: ReferenceRequest,
    root: Path,
    progress: Progress | None = None,
) -> StoredReference:
    """The reference of `scene` by that backend, from `root` if it is there and whole, rendered and stored if not.

    A damaged entry is reported through the logger "penumbra" and rendered again. PenumbraError where the backend is
    unknown, refuses the scene or fails, and, before any rendering, where `root` cannot be written.
    """
    backend = BACKENDS[backend_name]
    key = reference_key(scene, backend_name, backend.version(), request)
    stored = _load(root / key, key, backend_name)
    return stored or _render(scene, backend, request, root / key, progress)


def reference_key(scene: SceneDescription, backend: str, version: str, request: ReferenceRequest) -> str:
    """SHA-256, shortened to 32 digits, of everything that a reference depends on."""
    parts = {
        "format": FORMAT,
        "scene": scene.content_hash(),
        "backend": backend,
        "version": version,
        "request": asdict(request),
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:32]


def to_info(stored: StoredReference, run_folder: Path) -> ReferenceInfo:
    """What a record says of the reference; rms_standard_error is over pixels and channels, the image's path relative to `run_folder`."""
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


def _render(
    scene: SceneDescription,
    backend: ReferenceBackend,
    request: ReferenceRequest,
    entry: Path,
    progress: Progress | None,
) -> StoredReference:
    refusal = backend.refuses(scene)
    if refusal:
        raise PenumbraError(f"scene {scene.name}: no {backend.name} reference: {refusal}")
    folder = _new_folder(entry)
    try:
        image = backend.render(scene, request, progress)
        _write(folder, _described(image, entry.name, backend, request))
        _publish(folder, entry)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    stored = _load(entry, entry.name, backend.name)
    if stored is None:
        raise PenumbraError(f"{entry}: the reference just written cannot be read back")
    return replace(stored, fresh=True)


def _described(image: ReferenceImage, key: str, backend: ReferenceBackend, request: ReferenceRequest) -> ReferenceImage:
    """The image with what the cache knows added to its provenance; numbers in full, so that they are read back as they were."""
    known = {
        "key": key,
        "backend": backend.name,
        "version": backend.version(),
        "spp": str(image.spp),
        "batches": str(image.batches),
        "seconds": repr(image.seconds),
        "seed": str(request.seed),
    }
    return replace(image, provenance=image.provenance | known)


def _new_folder(entry: Path) -> Path:
    folder = entry.with_name(f".{entry.name}.{os.getpid()}.{secrets.token_hex(4)}")
    try:
        folder.mkdir(parents=True)
        for left in entry.parent.glob(f".{entry.name}.*"):  # by a process that was killed
            if time.time() - left.stat().st_mtime > DAY:
                shutil.rmtree(left, ignore_errors=True)
    except OSError as error:
        raise PenumbraError(f"{entry.parent}: references cannot be written here: {error.strerror}") from error
    return folder


def _write(folder: Path, image: ReferenceImage) -> None:
    mean, variance, count = image.mean, image.variance, np.full(image.mean.shape[:2], float(image.spp))
    provenance = np.array(json.dumps(image.provenance))
    try:
        np.savez(folder / STATE, mean=mean, variance=variance, count=count, provenance=provenance)
        checksum = hashlib.sha256((folder / STATE).read_bytes()).hexdigest()
    except OSError as error:
        raise PenumbraError(f"{folder / STATE}: cannot be written: {error.strerror or error}") from error
    write_estimate_exr(folder / EXR, mean, variance, count, image.provenance | {CHECKSUM: checksum})


def _publish(folder: Path, entry: Path) -> None:
    """Rename `folder` to `entry`; where another process was first, keep the other's."""
    try:
        folder.rename(entry)
    except OSError as error:
        if not entry.is_dir():
            raise PenumbraError(f"{entry}: cannot be written: {error.strerror}") from error


def _load(entry: Path, key: str, backend: str) -> StoredReference | None:
    """The entry, or None where there is none; a damaged one is reported and put out of the way."""
    if not entry.is_dir():
        return None
    try:
        return StoredReference(entry / EXR, key, backend, _read(entry, key), fresh=False)
    except _Damaged as error:
        log.warning("reference %s is damaged (%s); it will be made again", entry, error)
        shutil.rmtree(entry, ignore_errors=True)
        return None


def _read(entry: Path, key: str) -> ReferenceImage:
    """The entry's image; _Damaged unless both files are whole, agree with each other and carry `key`."""
    try:
        exr, content = read_estimate_exr(entry / EXR), (entry / STATE).read_bytes()
        if hashlib.sha256(content).hexdigest() != exr.metadata.pop(CHECKSUM, None):
            raise _Damaged(f"{STATE} does not match its checksum")
        image = _parse(content)
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, PenumbraError) as error:
        raise _Damaged(str(error) or type(error).__name__) from error
    if image.provenance.get("key") != key or exr.metadata != image.provenance:
        raise _Damaged("its provenance is another's")
    if not (_same(exr.mean, image.mean) and _same(exr.variance, image.variance)):
        raise _Damaged(f"{EXR} and {STATE} differ")
    return image


def _parse(content: bytes) -> ReferenceImage:
    with np.load(io.BytesIO(content), allow_pickle=False) as state:
        provenance = json.loads(str(state["provenance"]))
        return ReferenceImage(
            mean=state["mean"],
            variance=state["variance"],
            spp=int(provenance["spp"]),
            batches=int(provenance["batches"]),
            seconds=float(provenance["seconds"]),
            provenance=provenance,
        )


def _same(stored: NDArray[np.float64], exact: NDArray[np.float64]) -> bool:
    return np.array_equal(stored, exact.astype(np.float32).astype(np.float64))
