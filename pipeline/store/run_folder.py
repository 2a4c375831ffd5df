"""The folder of a run.

    manifest.json                                       the contents that the run is to have
    cells/<key>/{record.json,image.exr,state.npz}       one finished render; state.npz is its film in float64
    references/...                                      as `pipeline.references.cache` lays them out
    scores/<key>/{card.json,error.exr}                  one render scored against one reference
    regions/<key>/{map.json,regions.exr}                a scene's label image (pipeline/run/region_maps.py)
    report/                                             the page of `penumbra report`

Cells and scores are addressed by content, written whole (see `pipeline.store.sealed_folder`) and verified
when read, so that a run can be killed at any moment and started again. One run at a time works in a folder.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from pipeline.schema.manifest import CellEntry, LeftOut, Manifest
from pipeline.schema.record import Record, ReferenceInfo, ScoreCard
from pipeline.schema.sweep import Study
from pipeline.store.lock import locked
from pipeline.store.npz import from_npz, to_npz
from pipeline.store.sealed_folder import Writer, damage, write_entry
from scenes.errors import PenumbraError
from scenes.files import utf8_name, write_file

Arrays = Mapping[str, NDArray[Any]]
M = TypeVar("M", bound=BaseModel)

OWN_HIDDEN = (".lock", ".scratch", ".manifest.")  # left by a run that was killed at its very start


class DamagedEntryError(Exception):
    """A stored cell or score is damaged, and has to be made again."""


@dataclass(frozen=True)
class Store:
    """Reads and writes one run folder. `root` is the folder; every path in a record is relative to it."""

    root: Path

    @property
    def scratch(self) -> Path:
        """The folder of drafts that are not whole yet."""
        return self.root / ".scratch"

    def write_cell(self, record: Record, image: Writer, state: Arrays) -> None:
        """Store a finished cell under `record.key`. image: a writer of its EXR. state: its float64 film."""
        files = {"record.json": _json(record), "image.exr": image, "state.npz": to_npz(state)}
        write_entry(self.root / "cells" / record.key, self.scratch, files)

    def read_cell(self, key: str) -> Record | None:
        """The record of a cell, or None; DamagedEntryError if a byte of it is not what was written."""
        return self._read(self.root / "cells" / key, "record.json", Record)

    def read_state(self, key: str) -> dict[str, NDArray[Any]]:
        """The float64 film of a cell, as `write_cell` stored it."""
        return from_npz((self.root / "cells" / key / "state.npz").read_bytes())

    def write_score(self, key: str, card: ScoreCard, error_map: Writer | None) -> None:
        """Store the scores of a cell, and its error map if there is one."""
        files: dict[str, Writer | bytes] = {"card.json": _json(card)}
        if error_map is not None:
            files["error.exr"] = error_map
        write_entry(self.root / "scores" / key, self.scratch, files)

    def read_score(self, key: str) -> ScoreCard | None:
        """The scores under `key`, or None; DamagedEntryError if they are damaged."""
        return self._read(self.root / "scores" / key, "card.json", ScoreCard)

    def _read(self, entry: Path, name: str, model: type[M]) -> M | None:
        if not entry.exists():
            return None
        if problem := damage(entry):
            raise DamagedEntryError(f"{entry}: {problem}")
        try:
            return model.model_validate_json((entry / name).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise DamagedEntryError(f"{entry}: {name} cannot be read") from error

    def write_manifest(self, manifest: Manifest) -> None:
        """Replace `manifest.json`, atomically and durably."""
        write_file(self.root / "manifest.json", manifest.model_dump_json(indent=1), durable=True)

    def read_manifest(self) -> Manifest:
        """The manifest; PenumbraError if the folder holds no run, or one of another version."""
        path = self.root / "manifest.json"
        try:
            return Manifest.model_validate_json(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise PenumbraError(
                f"{self.root}: no run here: {path} cannot be read ({error.strerror})"
            ) from error
        except ValidationError as error:
            raise PenumbraError(
                f"{path}: not a manifest that this version reads; run the sweep again"
            ) from error

    @contextmanager
    def locked(self) -> Generator[None]:
        """Keep other runs out of the folder, and remove the drafts that a killed run left."""

        def busy() -> None:
            raise PenumbraError(f"{self.root}: another run is at work in this folder")

        with locked(self.root / ".lock", busy):
            shutil.rmtree(self.scratch, ignore_errors=True)
            yield
            shutil.rmtree(self.scratch, ignore_errors=True)


def create_store(root: Path) -> Store:
    """Open the run folder `root`, or make it; PenumbraError if it is not writable or holds other files."""
    utf8_name(root)
    try:
        root.mkdir(parents=True, exist_ok=True)
        strangers = [path.name for path in root.iterdir() if not path.name.startswith(OWN_HIDDEN)]
        (root / ".lock").touch()
    except OSError as error:
        raise PenumbraError(f"{root}: cannot write to this folder: {error.strerror}") from error
    if strangers and "manifest.json" not in strangers:
        (root / ".lock").unlink()
        raise PenumbraError(f"{root}: holds {strangers[0]} and no run; name a new or an empty folder")
    return Store(root)


@dataclass(frozen=True)
class FinishedCell:
    """A rendered cell; card: its scores, or None if it is not scored yet."""

    entry: CellEntry
    record: Record
    card: ScoreCard | None


@dataclass(frozen=True)
class FinishedStudy:
    """The finished part of one study. missing: cells not rendered yet, or damaged."""

    study: Study
    cells: tuple[FinishedCell, ...]
    missing: int
    left_out: tuple[LeftOut, ...]


@dataclass(frozen=True)
class Run:
    """A run folder as it was read: its manifest, and the finished part of each study.

    damaged: a line for each cell, score and reference that is not what was written, and left out therefore.
    """

    root: Path
    manifest: Manifest
    studies: tuple[FinishedStudy, ...]
    damaged: tuple[str, ...] = ()


def load_run(root: Path) -> Run:
    """Read a run folder, finished or not; PenumbraError if there is no run in it.

    The bytes of every entry are checked. A damaged one costs its own cell; a damaged or missing reference
    costs the scores against it. Renders nothing and writes nothing.
    """
    store = Store(root)
    manifest = store.read_manifest()
    damaged: dict[str, None] = {}
    studies: list[FinishedStudy] = []
    for study, entry in zip(manifest.sweep.study, manifest.studies, strict=True):
        found = (_finished(store, item, damaged) for item in entry.cells)
        cells = tuple(cell for cell in found if cell is not None)
        studies.append(FinishedStudy(study, cells, len(entry.cells) - len(cells), tuple(entry.left_out)))
    return Run(root, manifest, tuple(studies), tuple(damaged))


def _finished(store: Store, entry: CellEntry, damaged: dict[str, None]) -> FinishedCell | None:
    record = _undamaged(store.read_cell, entry.key, damaged)
    card = _undamaged(store.read_score, entry.score, damaged)
    if card is not None and (problem := _lost(store.root, card.reference)):
        damaged[problem] = None
        card = None
    return FinishedCell(entry, record, card) if record is not None else None


def _undamaged(read: Callable[[str], M | None], key: str, damaged: dict[str, None]) -> M | None:
    try:
        return read(key)
    except DamagedEntryError as error:
        damaged[str(error)] = None
        return None


def _lost(root: Path, reference: ReferenceInfo) -> str | None:
    """The damage of a reference, in words; None if it is whole."""
    folder = (root / reference.image).parent
    problem = damage(folder) if folder.is_dir() else "it is missing"
    return f"{folder}: {problem}" if problem else None


def _json(model: BaseModel) -> bytes:
    return model.model_dump_json(indent=1).encode()
