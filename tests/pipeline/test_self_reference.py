"""Our own renderer as a reference: labelled, agreeing with independent ones, and never its own judge."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.backends import BACKENDS
from pipeline.references.backends.closed_form import ClosedFormBackend
from pipeline.references.backends.mitsuba import MitsubaBackend
from pipeline.references.protocol import ReferenceImage, ReferenceRequest
from pipeline.run.grid import lay_out, quantity_of
from pipeline.run.worker import ScoreTask, score_cell
from pipeline.schema.record import Job, ReferenceInfo
from pipeline.schema.sweep import parse_sweep
from pipeline.self_reference import SelfBackend, batch_seed, judges_itself
from pipeline.statistics.welch import Moments, compare_images
from renderer import fingerprint
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Sphere
from scenes.errors import PenumbraError
from tests.kit.closed_form_scenes import LIGHTS, lit_by
from tests.kit.mitsuba_scenes import floor, look_at, scene, shape, vector

SWEEP = """
title = "own"
[[study]]
name = "own"
scenes = ["touching-light"]
metrics = ["mse"]
reference = { backend = "self", spp = 64, batches = 64 }
[study.axes]
estimator = ["solid-angle", "mis"]
spp = [1]
parameters = { xresolution = [8], yresolution = [6] }
"""


def moments(image: ReferenceImage) -> Moments:
    return Moments(image.mean, image.variance, image.batches - 1 if image.batches else np.inf)


def test_it_agrees_with_the_closed_form_and_says_what_it_is():
    given = lit_by(LIGHTS["upright rectangle"])
    own = SelfBackend().render(given, ReferenceRequest(256, 64))
    exact = ClosedFormBackend().render(given, ReferenceRequest())
    for result in compare_images(moments(exact), moments(own), alpha=1e-3):
        print(result)
        assert not result.reject
        assert result.name != "image" or result.smallest_detectable < 1e-2
    assert own.provenance["estimator"] == "mis" and own.provenance["independence"].startswith("none")
    assert fingerprint() in SelfBackend().version()
    assert BACKENDS["self"].name == "self"


def occluded() -> SceneDescription:
    """A ball over a floor, and some sky in view."""
    camera = look_at(vector(0, 1.2, -4), vector(0, 0.4, 0), vector(0, 1, 0))
    return scene([floor(3.0), shape(Sphere(vector(0, 0.5, 0), 0.5), 0.2, (5, 5, 5))], camera, 45.0, 32, 24)


@pytest.mark.usefixtures("mitsuba")
def test_ambient_occlusion_agrees_with_mitsubas_white_sky():
    """Two ways that share nothing: rays counted here, light of a white sky on white surfaces there; nothing
    is seen of the sky.
    """
    request = ReferenceRequest(1024, 64, quantity="ambient-occlusion")
    own, other = SelfBackend().render(occluded(), request), MitsubaBackend().render(occluded(), request)
    for result in compare_images(moments(other), moments(own), alpha=1e-3):
        print(result)
        assert not result.reject
        assert result.name != "image" or result.smallest_detectable < 5e-3
    assert 0.95 < own.mean.max() <= 1.0 and np.all(own.mean[0] == 0), "the open floor, and what meets nothing"
    wrong = dataclasses.replace(other, mean=other.mean * 1.01)
    assert any(result.reject for result in compare_images(moments(wrong), moments(own), alpha=1e-3))


def test_ambient_occlusion_that_ends_is_not_mitsubas():
    near = dataclasses.replace(occluded(), occlusion_distance=0.5)
    assert "no ambient occlusion that ends" in str(MitsubaBackend().refuses(near, "ambient-occlusion"))
    assert "lights that may be in the way" in str(ClosedFormBackend().refuses(near, "ambient-occlusion"))
    assert SelfBackend().refuses(near, "ambient-occlusion") is None
    image = SelfBackend().render(near, ReferenceRequest(64, 64, quantity="ambient-occlusion"))
    full = SelfBackend().render(occluded(), ReferenceRequest(64, 64, quantity="ambient-occlusion"))
    assert image.mean.mean() > full.mean.mean() + 0.01


def test_its_seeds_are_its_own():
    seeds = {batch_seed(seed, number) for seed in range(3) for number in range(100)}
    assert len(seeds) == 300 and min(seeds) >= 2**63


def test_it_takes_no_scene_without_light():
    dark = scene([floor()], np.eye(4), 40.0)
    assert "no lights" in str(SelfBackend().refuses(dark))
    with pytest.raises(PenumbraError, match="by hand: it has no lights"):
        SelfBackend().render(dark, ReferenceRequest(2, 2))


def test_a_sweep_leaves_out_the_estimator_that_made_the_reference(tmp_path: Path):
    (plan,) = lay_out(parse_sweep(SWEEP, "own.toml", tmp_path), "own.toml")
    assert {cell.job.estimator for cell in plan.cells} == {"solid-angle"}
    (note,) = plan.left_out
    assert note.what == "mis" and "made by 'mis' itself" in note.reason


def test_scoring_refuses_it_too(tmp_path: Path):
    """Whatever asked for it."""
    job = Job(scene="touching-light", estimator="mis", sampler="independent", spp=1, seed=0)
    info = ReferenceInfo(
        backend="self", key="k", spp=1, batches=2, rms_standard_error=0, seconds=0, image="i"
    )
    with pytest.raises(PenumbraError, match="made by 'mis' itself"):
        score_cell(ScoreTask(tmp_path, "score", "cell", job, tmp_path / "scene", ("mse",), tmp_path, info))
    assert judges_itself("mitsuba", "mis") is None and judges_itself("self", "area") is None


def test_one_reference_serves_one_quantity():
    assert quantity_of(["ambient-occlusion"], "s") == "ambient-occlusion"
    assert quantity_of(["area", "mis"], "s") == "radiance"
    with pytest.raises(PenumbraError, match="study s: area estimates radiance, ambient-occlusion estimates"):
        quantity_of(["area", "ambient-occlusion"], "s")
