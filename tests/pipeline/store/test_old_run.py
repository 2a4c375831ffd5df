"""A run of an earlier code still opens; the same sweep goes on in its folder, with its cells made anew."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from pipeline.run.driver import run_sweep
from pipeline.store.run_folder import Store, load_run
from pipeline.store.sealed_folder import damage
from tests.kit.fakes import InlineExecutor, Recorder

OLD_RUN = Path(__file__).parent / "old_run"  # of touching-light at 4 x 3 pixels, before keys were hashed anew


def test_an_old_run_is_read_whole() -> None:
    (study,) = load_run(OLD_RUN).studies
    assert (len(study.cells), study.missing) == (2, 0)
    assert {cell.entry.job.estimator for cell in study.cells} == {"area", "solid-angle"}
    for cell in study.cells:
        assert cell.card is not None and cell.card.scores["mse"].value is not None
        assert np.isfinite(Store(OLD_RUN).read_state(cell.record.key)["mean"]).all()
        assert (OLD_RUN / cell.record.image).is_file() and (OLD_RUN / cell.card.reference.image).is_file()


def test_its_entries_are_whole() -> None:
    entries = [entry.parent for entry in OLD_RUN.rglob("SHA256SUMS")]
    assert len(entries) == 6
    assert not any(damage(entry) for entry in entries)


def test_the_same_sweep_goes_on_in_its_folder(tmp_path: Path) -> None:
    """Another code gives other keys: nothing old is taken for new."""
    root = shutil.copytree(OLD_RUN, tmp_path / "run")
    old = load_run(root)
    summary = run_sweep("old.toml", old.manifest.sweep, root, InlineExecutor(), Recorder())
    assert (summary.made, summary.failures) == ({"references": 1, "cells": 2, "scores": 2}, ())
    (study,) = load_run(root).studies
    before = {cell.record.key for cell in old.studies[0].cells}
    assert (len(study.cells), study.missing) == (2, 0)
    assert not before & {cell.record.key for cell in study.cells}
