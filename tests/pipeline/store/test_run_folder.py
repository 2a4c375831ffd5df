"""The run folder: whole entries or none, damage is seen, foreign folders are left alone."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

from pipeline.run.job import run_job
from pipeline.schema.manifest import CellEntry, Manifest, StudyEntry
from pipeline.schema.record import Job, Record, ReferenceInfo, Score, ScoreCard
from pipeline.schema.sweep import load_sweep
from pipeline.store.provenance import provenance
from pipeline.store.run_folder import DamagedEntryError, Store, create_store, load_run
from pipeline.store.sealed_folder import damage, write_entry
from scenes.errors import PenumbraError
from tests.kit.prepared import prepare

JOB = Job(
    scene="touching-light",
    parameters={"xresolution": 16, "yresolution": 12},
    estimator="area",
    sampler="sobol",
    spp=1,
    seed=0,
)
FILES = ("record.json", "image.exr", "state.npz", "SHA256SUMS")


@pytest.fixture(scope="module")
def record() -> Record:
    return run_job(JOB, prepare(JOB.scene, JOB.parameters)).record


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return create_store(tmp_path / "run")


def write(store: Store, record: Record) -> Path:
    state = {"mean": np.arange(6.0).reshape(1, 2, 3) / 3, "count": np.ones((1, 2), dtype=np.int64)}
    store.write_cell(record, lambda path: path.write_bytes(b"an image"), state)
    return store.root / "cells" / record.key


def test_a_cell_is_read_as_it_was_written(store: Store, record: Record) -> None:
    write(store, record)
    found = store.read_cell(record.key)
    assert found is not None
    assert found.model_dump_json() == record.model_dump_json()
    assert np.isnan(found.statistics.noise), "one sample has no standard error, and JSON no NaN"
    state = store.read_state(record.key)
    assert np.array_equal(state["mean"], np.arange(6.0).reshape(1, 2, 3) / 3)
    assert state["mean"].dtype == np.float64


def test_what_is_not_there_is_none(store: Store) -> None:
    assert store.read_cell("0" * 32) is None
    assert store.read_score("0" * 32) is None


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("how", ["truncated", "missing", "altered"])
def test_damage_is_seen(store: Store, record: Record, name: str, how: str) -> None:
    path = write(store, record) / name
    content = path.read_bytes()
    if how == "missing":
        path.unlink()
    else:
        path.write_bytes(content[: len(content) // 2] if how == "truncated" else content[:-2] + b"?\n")
    with pytest.raises(DamagedEntryError):
        store.read_cell(record.key)


def test_a_damaged_cell_is_replaced_by_a_whole_one(store: Store, record: Record) -> None:
    entry = write(store, record)
    (entry / "image.exr").write_bytes(b"half")
    write(store, record)
    assert damage(entry) is None
    assert not any(store.scratch.iterdir()), "the old entry is gone, not set aside"


@pytest.mark.usefixtures("processes")
def test_the_seal_is_one_that_sha256sum_checks(store: Store, record: Record) -> None:
    entry = write(store, record)
    done = subprocess.run(
        ["sha256sum", "--check", "--strict", "SHA256SUMS"], cwd=entry, capture_output=True, check=False
    )
    assert done.returncode == 0
    assert done.stdout.count(b": OK") == 3


def test_an_entry_whose_writing_fails_is_not_there(tmp_path: Path) -> None:
    def fail(path: Path) -> None:
        path.write_text("half")
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space"):
        write_entry(
            tmp_path / "cells" / "key", tmp_path / "scratch", {"a": lambda p: p.write_text("a"), "b": fail}
        )
    assert not (tmp_path / "cells" / "key").exists()


def test_drafts_of_a_killed_run_are_swept_up(store: Store) -> None:
    (store.scratch / "draft").mkdir(parents=True)
    with store.locked():
        assert not store.scratch.exists()


def test_one_run_at_a_time(store: Store) -> None:
    with store.locked(), pytest.raises(PenumbraError, match="another run is at work"), store.locked():
        pass
    with store.locked():
        pass


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(PenumbraError, match=r"file/run: cannot write to this folder: Not a directory"):
        create_store(tmp_path / "file" / "run")


def test_a_folder_with_something_else_is_left_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(PenumbraError, match=r"holds thesis\.tex and no run"):
        create_store(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_run_killed_at_its_very_start_does_not_block_the_next(tmp_path: Path) -> None:
    (tmp_path / ".scratch").mkdir()
    (tmp_path / ".manifest.json.draft").touch()
    assert create_store(tmp_path).root == tmp_path


def _manifest(record: Record, scores: str) -> Manifest:
    sweep = load_sweep("touching-light-gap")
    cells = [CellEntry(key=key, job=JOB, score=scores) for key in (record.key, "1" * 32)]
    studies = [StudyEntry(name=sweep.study[0].name, cells=cells)]
    return Manifest(name="touching-light-gap", sweep=sweep, studies=studies, provenance=provenance())


def test_a_run_is_loaded_with_what_it_has_and_what_it_lacks(store: Store, record: Record) -> None:
    write(store, record)
    info = ReferenceInfo(
        backend="fake",
        key="k",
        spp=0,
        batches=0,
        rms_standard_error=0.0,
        seconds=0.0,
        image="references/k/r.exr",
    )
    write_entry(store.root / "references" / "k", store.scratch, {"r.exr": b"a reference"})
    card = ScoreCard(cell=record.key, reference=info, scores={"mse": Score(metric="mse", value=float("inf"))})
    store.write_score("5" * 32, card, None)
    store.write_manifest(_manifest(record, "5" * 32))
    run = load_run(store.root)
    (study,) = run.studies
    assert (len(study.cells), study.missing) == (1, 1)
    assert (study.cells[0].card, run.damaged) == (card, ())
    (store.root / "references" / "k" / "r.exr").unlink()
    run = load_run(store.root)
    assert run.studies[0].cells[0].card is None and run.damaged == (
        f"{store.root / 'references/k'}: r.exr is missing",
    )
    (store.root / "cells" / record.key / "record.json").write_text("{")
    run = load_run(store.root)
    assert run.studies[0].missing == 2
    assert run.damaged[0] == f"{store.root / 'cells' / record.key}: record.json is not what was written"


def test_no_run_and_a_foreign_manifest(tmp_path: Path) -> None:
    with pytest.raises(PenumbraError, match=r"no run here: .*manifest\.json cannot be read"):
        load_run(tmp_path)
    (tmp_path / "manifest.json").write_text('{"manifest_version": 99}')
    with pytest.raises(PenumbraError, match="not a manifest that this version reads"):
        load_run(tmp_path)
