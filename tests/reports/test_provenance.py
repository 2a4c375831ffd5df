"""What a report says of its scenes beside their figures."""

from __future__ import annotations

from pathlib import Path

from pipeline.run.job import ReadScene, build_scene, run_job
from pipeline.schema.record import Job, Record
from pipeline.store.run_folder import load_run
from reports.provenance import said_of_scenes
from scenes.pbrt.parser import parse
from tests.kit.scene_texts import HEAD, TRIANGLE


def record(name: str, text: str) -> Record:
    scene = build_scene(ReadScene(parse(text, substitute=True), name, 0.0))
    job = Job(scene=name, estimator="mis", sampler="independent", spp=1, seed=0)
    return run_job(job, scene).record


def test_each_note_and_each_substitution_is_one_line_with_its_scenes() -> None:
    deep = HEAD.replace('maxdepth" [ 1 ]', 'maxdepth" [ 7 ]') + TRIANGLE
    records = [
        record("deep", deep),
        record("too", deep),
        record("hair", HEAD + 'Material "hair" ' + TRIANGLE),
    ]
    note, substituted = said_of_scenes(records)
    assert note[0] == "Note"
    assert note[1].startswith("deep, too: maxdepth is 7")
    assert substituted[0] == "Substituted"
    assert substituted[1].startswith('hair: Material "hair": rendered as diffuse of its colour')
    assert said_of_scenes([record("plain", HEAD + TRIANGLE)]) == []


def test_a_record_of_before_says_nothing_of_its_scene(small_run: Path) -> None:
    records = [cell.record for study in load_run(small_run).studies for cell in study.cells]
    assert said_of_scenes(records) == []
