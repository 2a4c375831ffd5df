"""The sweeps `noise` and `penumbra` show what they say they do: made small, and run whole."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import scenes
from examples.penumbra_width import width
from pipeline.console.command import script
from pipeline.run.driver import run_sweep
from pipeline.schema.sweep import Sweep, load_sweep
from pipeline.store.run_folder import Run, load_run
from renderer import render
from tests.kit.fakes import InlineExecutor, Recorder

LEVELS = {"light-size": [0.5, 2.0], "occluder-height": [0.5, 2.0]}


def shrunk(name: str) -> Sweep:
    """The built-in sweep at 40 x 40 pixels, two values along its axis, one estimator and two seeds."""
    sweep = load_sweep(name)
    studies = []
    for study in sweep.study:
        parameters = {
            **study.axes.parameters,
            "xresolution": [40.0],
            "yresolution": [40.0],
            study.over: LEVELS[study.name],
        }
        axes = study.axes.model_copy(
            update={"parameters": parameters, "seeds": [0, 1], "estimator": ["solid-angle"]}
        )
        studies.append(study.model_copy(update={"axes": axes, "metrics": ["rmse", "umbra-leak"]}))
    return sweep.model_copy(update={"study": studies})


@pytest.fixture(scope="module")
def penumbra(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("penumbra")
    summary = run_sweep("penumbra", shrunk("penumbra"), root, InlineExecutor(), Recorder())
    assert not summary.failures
    return root


def score(run: Run, study: int, over: str, level: float, metric: str) -> float:
    cells = [c for c in run.studies[study].cells if c.entry.job.parameters[over] == level]
    values = [c.card.scores[metric].value for c in cells if c.card is not None]
    assert len(values) == 2 and None not in values
    return float(np.mean([v for v in values if v is not None]))


@pytest.mark.usefixtures("statistical")
def test_the_error_grows_with_the_light_and_with_the_edge_s_height(penumbra: Path) -> None:
    run = load_run(penumbra)
    for study, over in enumerate(("light_size", "occluder_height")):
        narrow, wide = (score(run, study, over, level, "rmse") for level in (0.5, 2.0))
        assert wide > 1.2 * narrow
        assert score(run, study, over, 2.0, "umbra-leak") == 0.0


@pytest.mark.usefixtures("statistical")
def test_the_widths_of_a_run_are_told(penumbra: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exact: by the closed form; of the images: within a tenth where the penumbra is five rows wide or
    more.
    """
    assert _width(str(penumbra)) == 0
    rows = json.loads(capsys.readouterr().out)
    assert len(rows) == 4
    for row in rows:
        assert row["images"] == 2 and row["estimator"] == "solid-angle"
        assert 0.84 < row["exact"] / row["similar_triangles"] <= 0.9
        if row["pixels"] > 5:
            assert row["width"]["value"] == pytest.approx(row["exact"], rel=0.1)
            assert row["reference"] == pytest.approx(row["exact"], rel=0.05)
    by_light = {row["scene"].split("light_size=")[1].split()[0]: row["exact"] for row in rows[:2]}
    assert by_light["2"] == pytest.approx(4 * by_light["0.5"], rel=0.03)


def _width(folder: str) -> int:
    try:
        script(width, [folder, "--json", "--quiet"])
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


def test_a_run_without_an_edge_has_no_width(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _width(str(tmp_path)) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.usefixtures("statistical")
def test_noise_grows_with_the_light_and_a_hundred_rays_make_a_tenth_of_it() -> None:
    """The claim of `noise`.

    Errors from 3,072 pixels are known to some 3 %; independent samples' variances differ by 100 exactly.
    """
    noise: dict[tuple[float, int], float] = {}
    for size in (0.125, 4.0):
        scene = scenes.load("large-light", {"size": size, "xresolution": 64, "yresolution": 48})
        truth = render(scene, estimator="solid-angle", sampler="sobol", spp=1024).image
        for spp in (1, 100):
            image = render(scene, estimator="solid-angle", spp=spp, seed=5).image
            noise[size, spp] = float(np.sqrt(np.mean((image - truth) ** 2)))
        assert noise[size, 1] == pytest.approx(10 * noise[size, 100], rel=0.12)
    assert noise[4.0, 1] > 1.3 * noise[0.125, 1]


def test_the_sweeps_ask_what_the_lecture_asks() -> None:
    size, _ = load_sweep("noise").study
    assert (size.scenes, size.over, size.axes.spp) == (["large-light"], "size", [1, 100])
    widths = load_sweep("penumbra").study
    assert [study.over for study in widths] == ["light_size", "occluder_height"]
    assert {study.reference.backend for study in widths} == {"closed-form-edge"}
