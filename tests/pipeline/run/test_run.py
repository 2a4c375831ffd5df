"""A run makes what is missing and nothing else; the reference is a fake, the renderer and the store are
real.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import pipeline.run.driver
import pipeline.run.worker
import scenes.catalog
from pipeline.references.protocol import BACKENDS
from pipeline.run.driver import Summary, run_sweep
from pipeline.schema.sweep import parse_sweep
from pipeline.store.run_folder import Store, load_run
from renderer import render
from scenes import load
from scenes.errors import PenumbraError
from tests.kit.fakes import TINY, TINY_CELLS, FakeBackend, InlineExecutor, Recorder

ALL = {"references": 1, "cells": TINY_CELLS, "scores": TINY_CELLS}
TOO_CLOSE = "it is too close to the floor; backends that take it: closed-form, mitsuba, self"
NOTHING = {"references": 0, "cells": 0, "scores": 0}


@pytest.fixture
def backend(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeBackend]:
    BACKENDS.names()  # the real ones are registered before the fake joins them
    fake = FakeBackend()
    monkeypatch.setitem(BACKENDS._entries, "fake", fake)
    pipeline.run.driver._version.cache_clear()
    pipeline.run.worker._scene.cache_clear()
    pipeline.run.worker._warm_up.cache_clear()
    pipeline.run.worker._reference.cache_clear()
    yield fake
    pipeline.run.driver._version.cache_clear()


def run(
    root: Path, text: str = TINY, executor: InlineExecutor | None = None, recorder: Recorder | None = None
) -> Summary:
    sweep = parse_sweep(text, "tiny.toml", root)
    return run_sweep("tiny.toml", sweep, root, executor or InlineExecutor(), recorder or Recorder())


def times(root: Path, kind: str) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in (root / kind).iterdir()}


@pytest.mark.usefixtures("backend")
def test_a_run_makes_every_reference_cell_and_score(tmp_path: Path) -> None:
    recorder = Recorder()
    summary = run(tmp_path, recorder=recorder)
    assert (summary.cells, summary.made, summary.failures) == (TINY_CELLS, ALL, ())
    assert recorder.steps == {"references": (1, 1), "cells": (8, 8), "scores": (8, 8)}
    (study,) = load_run(tmp_path).studies
    assert (len(study.cells), study.missing) == (TINY_CELLS, 0)
    assert all(cell.card is not None and cell.card.cell == cell.record.key for cell in study.cells)
    assert all((tmp_path / cell.record.image).is_file() for cell in study.cells)


@pytest.mark.usefixtures("backend")
def test_every_cell_is_scored_by_region(tmp_path: Path) -> None:
    """Regions cover the image; the mean over pixels of their MSE is the whole's; one label image serves all
    cells of the scene.
    """
    run(tmp_path)
    (study,) = load_run(tmp_path).studies
    for cell in study.cells:
        assert cell.card is not None and cell.card.region_map is not None
        parts = cell.card.regions
        assert {"lit", "light"} <= set(parts) and sum(part.pixels for part in parts.values()) == 16 * 12
        assert cell.card.region_map.pixels == {name: part.pixels for name, part in parts.items()}
        sums = [part.pixels * (part.scores["mse"].value or 0.0) for part in parts.values()]
        assert cell.card.scores["mse"].value == pytest.approx(sum(sums) / (16 * 12))
    assert (
        len({cell.card.region_map.image for cell in study.cells if cell.card and cell.card.region_map}) == 1
    )
    assert all((tmp_path / cell.card.reference.image).is_file() for cell in study.cells if cell.card)


@pytest.mark.usefixtures("backend")
def test_a_stored_cell_is_what_the_library_renders(tmp_path: Path) -> None:
    run(tmp_path)
    entry = load_run(tmp_path).manifest.studies[0].cells[-1]
    job = entry.job
    image = render(
        load(job.scene, job.parameters),
        estimator=job.estimator,
        sampler=job.sampler,
        spp=job.spp,
        seed=job.seed,
    ).image
    assert np.array_equal(Store(tmp_path).read_state(entry.key)["mean"], image)


def test_a_second_run_finds_everything_done(tmp_path: Path, backend: FakeBackend) -> None:
    run(tmp_path)
    before = [times(tmp_path, kind) for kind in ("cells", "scores", "references")]
    executor = InlineExecutor()
    assert run(tmp_path, executor=executor).made == NOTHING
    assert (executor.began, backend.asked) == ([], 1)
    assert [times(tmp_path, kind) for kind in ("cells", "scores", "references")] == before


@pytest.mark.usefixtures("backend")
def test_an_interrupted_run_goes_on_with_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, executor=InlineExecutor(stop_after=3))
    before = times(tmp_path, "cells")
    assert len(before) == 3
    assert load_run(tmp_path).studies[0].missing == TINY_CELLS - 3
    assert run(tmp_path).made == {"references": 0, "cells": TINY_CELLS - 3, "scores": TINY_CELLS}
    assert before.items() <= times(tmp_path, "cells").items()


@pytest.mark.usefixtures("backend")
@pytest.mark.parametrize("name", ["record.json", "image.exr", "state.npz"])
def test_a_damaged_cell_is_told_and_rendered_again(tmp_path: Path, name: str) -> None:
    run(tmp_path)
    victim = load_run(tmp_path).manifest.studies[0].cells[2].key
    path = tmp_path / "cells" / victim / name
    whole = Store(tmp_path).read_state(victim)["mean"]
    path.write_bytes(path.read_bytes()[:100])
    recorder = Recorder()
    assert run(tmp_path, recorder=recorder).made == {"references": 0, "cells": 1, "scores": 0}
    (note,) = recorder.notes
    assert f"{victim}: {name} is not what was written; it will be made again" in note
    assert np.array_equal(Store(tmp_path).read_state(victim)["mean"], whole)


@pytest.mark.usefixtures("backend")
def test_a_damaged_score_is_scored_again_and_nothing_rendered(tmp_path: Path) -> None:
    run(tmp_path)
    entry = load_run(tmp_path).manifest.studies[0].cells[0]
    (tmp_path / "scores" / entry.score / "card.json").write_text("{}")
    assert run(tmp_path).made == {"references": 0, "cells": 0, "scores": 1}


@pytest.mark.usefixtures("backend")
def test_a_changed_reference_scores_anew_and_renders_nothing(tmp_path: Path) -> None:
    run(tmp_path)
    other = TINY.replace("spp = 64, batches", "spp = 128, batches")
    assert other != TINY
    assert run(tmp_path, other).made == {"references": 1, "cells": 0, "scores": TINY_CELLS}
    cards = [cell.card for cell in load_run(tmp_path).studies[0].cells]
    assert len({card.reference.key for card in cards if card}) == 1


@pytest.mark.usefixtures("backend")
def test_a_changed_metric_scores_anew_and_renders_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(tmp_path)
    monkeypatch.setattr(pipeline.run.driver, "metrics_fingerprint", lambda: "another formula")
    assert run(tmp_path).made == {"references": 0, "cells": 0, "scores": TINY_CELLS}


@pytest.mark.usefixtures("backend")
def test_a_wider_grid_keeps_what_it_shares_with_the_old_one(tmp_path: Path) -> None:
    run(tmp_path)
    assert run(tmp_path, TINY.replace("seeds = 2", "seeds = 3")).made == {
        "references": 0,
        "cells": 4,
        "scores": 4,
    }


@pytest.mark.usefixtures("backend")
def test_two_names_of_one_content_share_a_cell_and_keep_their_names(tmp_path: Path) -> None:
    """0.01 is the gap's default: the second study's scenes are the first's, under another name."""
    second = (
        TINY.split('title = "tiny"')[1]
        .replace('name = "tiny"', 'name = "again"')
        .replace("= { x", "= { gap = [0.01], x")
    )
    summary = run(tmp_path, TINY + second)
    assert (summary.cells, summary.made["cells"]) == (TINY_CELLS, TINY_CELLS)
    first, again = load_run(tmp_path).studies
    assert [cell.record.key for cell in first.cells] == [cell.record.key for cell in again.cells]
    assert all("gap" in cell.entry.job.parameters for cell in again.cells)


def test_scenes_that_the_reference_refuses_are_left_out_in_words(
    tmp_path: Path, backend: FakeBackend
) -> None:
    backend.refused["touching-light"] = "it is too close to the floor"
    text = TINY.replace('["touching-light"]', '["touching-light", "sphere-light"]')
    recorder = Recorder()
    summary = run(tmp_path, text, recorder=recorder)
    label = "touching-light xresolution=16 yresolution=12"
    assert recorder.notes == [f"reference fake left out for {label}: {TOO_CLOSE}"]
    assert load_run(tmp_path).studies[0].left_out == summary.left_out
    assert {cell.entry.job.scene for cell in load_run(tmp_path).studies[0].cells} == {"sphere-light"}


@pytest.mark.usefixtures("backend")
def test_a_cell_that_fails_is_told_and_does_not_stop_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = pipeline.run.worker.run_job

    def fail(job, scene):
        if job.spp == 4 and job.seed == 1 and job.estimator == "area":
            raise PenumbraError("out of light")
        return real(job, scene)

    monkeypatch.setattr(pipeline.run.worker, "run_job", fail)
    summary = run(tmp_path)
    assert summary.made == {"references": 1, "cells": TINY_CELLS - 1, "scores": TINY_CELLS - 1}
    (failure,) = summary.failures
    assert failure.startswith("cells: touching-light")
    assert failure.endswith("area independent spp=4 seed=1: out of light")
    monkeypatch.undo()


@pytest.mark.usefixtures("backend")
def test_nothing_is_written_for_a_sweep_that_cannot_be_laid_out(tmp_path: Path) -> None:
    with pytest.raises(PenumbraError, match="there is no scene file"):
        run(tmp_path / "run", TINY.replace("touching-light", "missing.pbrt"))
    assert not (tmp_path / "run").exists()


@pytest.mark.usefixtures("backend")
def test_a_scene_without_lights_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    scene = tmp_path / "dark.pbrt"
    scene.write_text('Camera "perspective"\nWorldBegin\nShape "sphere"\n')
    text = TINY.replace("touching-light", str(scene)).replace("xresolution = [16], yresolution = [12]", "")
    with pytest.raises(PenumbraError, match="has no lights: nothing in it would be lit or seen"):
        run(tmp_path / "run", text)
    assert not (tmp_path / "run").exists()


@pytest.mark.usefixtures("backend")
def test_a_scene_is_parsed_once_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two studies of one scene, its cells and its scores: all of them share what was read."""
    parsed: list[object] = []
    real = scenes.catalog.parse_file

    def counted(path, *rest):
        parsed.append(path)
        return real(path, *rest)

    monkeypatch.setattr(scenes.catalog, "parse_file", counted)
    second = TINY.split('title = "tiny"')[1].replace('name = "tiny"', 'name = "again"')
    assert run(tmp_path, TINY + second.replace("seeds = 2", "seeds = 3")).made["cells"] == 12
    assert len(parsed) == 1
