"""A job: the same bits each time, and a record that says what was done."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.run.job import JobResult, PreparedScene, run_job
from pipeline.schema.record import Job, Record
from pipeline.store.keys import cell_key
from renderer import fingerprint, image_fingerprint
from scenes.errors import PenumbraError
from tests.kit.prepared import prepare

SIZE = {"xresolution": 32.0, "yresolution": 24.0}


def job(**changes: object) -> Job:
    given = {
        "scene": "soft-shadow",
        "parameters": SIZE,
        "estimator": "area",
        "sampler": "independent",
        "spp": 4,
        "seed": 1,
    }
    return Job.model_validate({**given, **changes})


@pytest.fixture(scope="module")
def scene() -> PreparedScene:
    return prepare("soft-shadow", SIZE)


@pytest.fixture(scope="module")
def result(scene: PreparedScene) -> JobResult:
    return run_job(job(), scene)


def test_the_same_job_gives_the_same_bits(scene: PreparedScene, result: JobResult) -> None:
    run_job(job(seed=2), scene)  # what came before must not matter
    again = run_job(job(), prepare("soft-shadow", SIZE))
    assert again.render.image.tobytes() == result.render.image.tobytes()
    assert again.render.film.m2.tobytes() == result.render.film.m2.tobytes()
    assert again.record.key == result.record.key
    assert again.record.statistics == result.record.statistics


def test_another_seed_gives_another_image(scene: PreparedScene, result: JobResult) -> None:
    assert not np.array_equal(run_job(job(seed=2), scene).render.image, result.render.image)


def test_the_record_says_what_was_done(scene: PreparedScene, result: JobResult) -> None:
    record = result.record
    assert record.job == job()
    assert record.key == cell_key(scene.hash, job(), image_fingerprint(job().estimator, job().sampler))
    assert record.image == f"cells/{record.key}/image.exr"
    assert (record.width, record.height) == (32, 24)
    assert record.rays.primary == 32 * 24 * 4
    assert 0 < record.rays.shadow < record.rays.primary
    assert record.provenance.renderer == fingerprint()
    assert {"numpy", "embreex", "mitsuba"} <= record.provenance.versions.keys()
    assert {decision.effect for decision in record.plan} == {d.effect for d in result.render.plan.decisions}


def test_set_up_is_timed_apart_from_the_passes(result: JobResult) -> None:
    """The passes' time is the renderer's own, and what was done once a scene is told beside it, not in it."""
    seconds = result.record.seconds
    assert min(seconds.load, seconds.build, seconds.plan, seconds.render, seconds.cpu) > 0
    assert seconds.render == result.render.seconds.render
    assert seconds.cpu == result.render.seconds.cpu


def test_a_record_survives_json(result: JobResult) -> None:
    assert Record.model_validate_json(result.record.model_dump_json()) == result.record


def test_unknown_names_and_scenes() -> None:
    with pytest.raises(PenumbraError, match="unknown scene 'nine'"):
        prepare("nine", {})
    with pytest.raises(PenumbraError, match="unknown sampler 'halton'"):
        run_job(job(sampler="halton"), prepare("touching-light", SIZE))
