"""The rasterised picture as a cell of a study, and on the command line."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pipeline.backends import BACKENDS
from pipeline.baseline import entry
from pipeline.cli import main
from pipeline.run.driver import Summary, run_sweep
from pipeline.run.grid import lay_out
from pipeline.schema.sweep import parse_sweep
from pipeline.store.run_folder import Store, load_run
from renderer.interfaces.estimator import ESTIMATORS
from scenes.errors import PenumbraError
from scenes.images.exr import read_exr
from tests.kit.fakes import TINY, TINY_CELLS, FakeBackend, InlineExecutor, Recorder

ASKED = TINY.replace(
    'metrics = ["mse", "nonfinite"]', 'metrics = ["mse", "nonfinite"]\nbaseline = "pyrender"'
)


@pytest.fixture(autouse=True)
def backend(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeBackend]:
    BACKENDS.names()  # the real ones are registered before the fake joins them
    fake = FakeBackend()
    with monkeypatch.context() as context:
        context.setitem(BACKENDS._entries, "fake", fake)
        yield fake


def run(root: Path) -> Summary:
    return run_sweep("tiny", parse_sweep(ASKED, "tiny.toml", root), root, InlineExecutor(), Recorder())


@pytest.mark.usefixtures("opengl")
def test_a_study_has_one_rasterised_picture_to_each_scene(tmp_path: Path) -> None:
    """Stored and scored like the others, once and not once a seed; a second run finds it there."""
    summary = run(tmp_path)
    assert not summary.failures
    assert summary.made == {"references": 1, "cells": TINY_CELLS + 1, "scores": TINY_CELLS + 1}
    (study,) = load_run(tmp_path).studies
    (cell,) = [cell for cell in study.cells if cell.entry.job.estimator == entry.NAME]
    assert cell.card is not None
    assert cell.card.scores["mse"].value is not None
    assert (cell.record.width, cell.record.height, cell.record.rays.primary) == (16, 12, 0)
    assert cell.record.statistics.reason == entry.BIAS
    assert 0 < cell.record.seconds.render < 5
    assert cell.record.provenance.versions["pyrender"]
    image = Store(tmp_path).read_state(cell.record.key)["mean"]
    assert image.shape == (12, 16, 3)
    assert image.max() > 0
    assert run(tmp_path).made == {"references": 0, "cells": 0, "scores": 0}


def test_without_opengl_it_is_left_out_in_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(entry, "_loads", lambda library: library != "libEGL.so.1" and "OSMesa" not in library)
    entry.missing.cache_clear()
    summary = run(tmp_path)
    entry.missing.cache_clear()
    assert not summary.failures
    assert summary.made["cells"] == TINY_CELLS
    (note,) = summary.left_out
    assert note.what == "baseline pyrender"
    assert note.reason.startswith("libEGL.so.1 cannot be loaded: apt install")


def test_a_study_that_is_not_about_light_has_none(tmp_path: Path) -> None:
    dark = ASKED.replace('"area", "solid-angle"', '"ambient-occlusion"')
    (plan,) = lay_out(parse_sweep(dark, "tiny.toml", tmp_path), "tiny")
    assert all(cell.job.estimator == "ambient-occlusion" for cell in plan.cells)
    assert any(note.what == "baseline pyrender" for note in plan.left_out)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ('baseline = "blender"', r"study\[0\].baseline: .*'pyrender', not 'blender'"),
        ('baseline = "pyrender"\nover = "xresolution"', 'needs over = "spp"'),
    ],
)
def test_wrong_baselines_are_refused(tmp_path: Path, wrong: str, words: str) -> None:
    with pytest.raises(PenumbraError, match=words):
        parse_sweep(ASKED.replace('baseline = "pyrender"', wrong), "tiny.toml", tmp_path)


def test_no_estimator_has_its_name() -> None:
    assert entry.NAME not in ESTIMATORS.names()


@pytest.mark.usefixtures("opengl")
def test_the_command_writes_image_and_depth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "drawn.exr"
    with pytest.raises(SystemExit) as stopped:
        main(
            [
                "baseline",
                "touching-light",
                "-o",
                str(path),
                "-D",
                "xresolution=24",
                "-D",
                "yresolution=18",
                "--json",
            ]
        )
    assert not stopped.value.code
    told = json.loads(capsys.readouterr().out)
    channels = read_exr(path).channels
    assert set(channels) == {"R", "G", "B", "Z"}
    assert np.allclose([channels[c].mean() for c in "RGB"], told["mean"], rtol=1e-6)
    depth = channels["Z"]
    assert told["clip"]["near"] < depth.min() < told["clip"]["far"]
    assert told["bias"] == entry.BIAS
