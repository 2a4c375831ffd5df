"""One folder, one sweep: what may go on in a run's folder, and that nothing in it is forgotten without a
word.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.store.run_folder import load_run
from scenes.errors import PenumbraError
from tests.kit.fakes import TINY, TINY_CELLS, FakeBackend, Recorder
from tests.pipeline.run.test_run import NOTHING, backend, run

__all__ = ["backend"]

MORE = TINY.replace("spp = [1, 4]", "spp = [1, 2, 4]")
FEWER = TINY.replace("spp = [1, 4]", "spp = [1]")
RENAMED = TINY.replace('name = "tiny"', 'name = "other"')
RESCORED = TINY.replace('["mse", "nonfinite"]', '["mse"]')


@pytest.fixture
def folder(tmp_path: Path, backend: FakeBackend) -> Iterator[Path]:
    """A finished run of TINY."""
    run(tmp_path)
    yield tmp_path


def test_the_same_sweep_goes_on(folder: Path) -> None:
    assert run(folder).made == NOTHING


def test_a_sweep_that_was_added_to_goes_on(folder: Path) -> None:
    assert run(folder, MORE).made == {"references": 0, "cells": 4, "scores": 4}
    assert len(load_run(folder).studies[0].cells) == TINY_CELLS + 4


def test_a_sweep_scored_otherwise_renders_nothing(folder: Path) -> None:
    assert run(folder, RESCORED).made == {"references": 0, "cells": 0, "scores": TINY_CELLS}


@pytest.mark.parametrize(
    ("text", "reason"),
    [(FEWER, "with 4 cells in 'tiny' that it has no more"), (RENAMED, "had a study 'tiny'")],
    ids=["fewer cells", "another study"],
)
def test_a_sweep_that_would_forget_cells_is_refused(folder: Path, text: str, reason: str) -> None:
    before = (folder / "manifest.json").read_bytes()
    recorder = Recorder()
    with pytest.raises(PenumbraError, match=rf"{reason}; name another folder$"):
        run(folder, text, recorder=recorder)
    assert (folder / "manifest.json").read_bytes() == before and recorder.steps == {}
    assert len(load_run(folder).studies[0].cells) == TINY_CELLS


def test_another_sweep_is_refused(folder: Path) -> None:
    from pipeline.run.driver import run_sweep
    from pipeline.schema.sweep import parse_sweep
    from tests.kit.fakes import InlineExecutor

    with pytest.raises(
        PenumbraError, match=r"holds a run of the sweep 'tiny.toml', and this is 'second.toml'"
    ):
        run_sweep(
            "second.toml", parse_sweep(MORE, "second.toml", folder), folder, InlineExecutor(), Recorder()
        )


def test_a_manifest_that_cannot_be_read_is_written_anew(folder: Path) -> None:
    """Of another version, or torn: its cells are found by their keys."""
    (folder / "manifest.json").write_text('{"manifest_version": 0}')
    assert run(folder).made == NOTHING


def test_more_samples_for_the_reference_score_again_and_render_nothing(
    folder: Path, backend: FakeBackend
) -> None:
    more = TINY.replace("spp = 64, batches = 64", "spp = 256, batches = 64")
    assert run(folder, more).made == {"references": 1, "cells": 0, "scores": TINY_CELLS}
    assert backend.asked == 2


def test_studies_that_want_one_reference_at_different_samples_share_the_better(
    tmp_path: Path, backend: FakeBackend
) -> None:
    second = TINY[TINY.index("[[study]]") :].replace('"tiny"', '"twin"').replace("spp = 64,", "spp = 512,")
    assert run(tmp_path, TINY + second).made["references"] == backend.asked == 1
    cards = [cell.card for study in load_run(tmp_path).studies for cell in study.cells]
    assert {card.reference.spp for card in cards if card} == {512}
