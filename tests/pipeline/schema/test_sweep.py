"""Sweep files: what is refused and how it is said; and the grid that a sweep lays out."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.run.grid import fair_order, lay_out
from pipeline.schema.sweep import Sweep, builtin_sweeps, load_sweep, parse_sweep
from pipeline.scoring.metric import METRICS
from renderer.interfaces.estimator import ESTIMATORS
from scenes.errors import PenumbraError

GOOD = """
title = "good"
[[study]]
name = "one"
scenes = ["soft-shadow"]
metrics = ["mse"]
reference = { backend = "mitsuba", spp = 640, batches = 64 }
[study.axes]
estimator = ["area", "solid-angle"]
sampler = ["independent", "sobol"]
spp = [1, 4]
seeds = 3
parameters = { xresolution = [64], yresolution = [48] }
"""

# What is changed in GOOD, into what, and the message: where it stands and what is allowed.
MISTAKES = [
    ('title = "good"', "", "title: missing key"),
    ('title = "good"', "title = 3", "title: input should be a valid string, not 3"),
    ('title = "good"', 'title = "good', "not valid TOML"),
    ('title = "good"', 'title = "good"\ncolour = 1', ("colour: unknown key; allowed here: title, "
"description, plugins, study")),
    ('name = "one"', 'name = "one"\nscene = "x"', "study[0].scene: unknown key; allowed here: name, title"),
    ("seeds = 3", "seed = 3", ("study[0].axes.seed: unknown key; allowed here: estimator, sampler, spp, "
"seeds, parameters (did you mean seeds?)")),
    ("seeds = 3", "seeds = 0", "study[0].axes.seeds: 0 replicates: give at least 1"),
    ("seeds = 3", "seeds = [1, 1]", "study[0].axes.seeds: 1 is given twice"),
    ("seeds = 3", "seeds = [-1]", ("study[0].axes.seeds[0]: input should be greater than or equal to "
"0, not -1")),
    ("spp = [1, 4]", "spp = [1, 0]", ("study[0].axes.spp[1]: input should be greater than or equal to "
"1, not 0")),
    ("spp = [1, 4]", "spp = []", "study[0].axes.spp: is empty; give at least one"),
    ("spp = [1, 4]", "spp = [1.5]", "study[0].axes.spp[0]: input should be a valid integer, not 1.5"),
    ('"area", "solid-angle"', '"aera"', ("study[0].axes.estimator: unknown estimator 'aera'; "
"there are: ") + ", ".join(ESTIMATORS.names())),
    ('"independent", "sobol"', '"halton"', ("study[0].axes.sampler: unknown sampler 'halton'; there are: "
"independent")),
    ('metrics = ["mse"]', 'metrics = ["l2"]', ("study[0].metrics: unknown metric 'l2'; "
"there are: ") + ", ".join(METRICS.names())),
    ('"mitsuba"', '"prbt"', ("study[0].reference.backend: unknown reference backend 'prbt'; there are: "
"closed-form, closed-form-edge, mitsuba")),
    ("spp = 640", "spp = 63", "study[0].reference: spp = 63 cannot be dealt to batches = 64"),
    ("spp = 640", "ssp = 640", ("study[0].reference.ssp: unknown key; allowed here: backend, spp, batches, "
"seed (did you mean spp?)")),
    ("[64]", "[nan]", "study[0].axes.parameters.xresolution[0]: input should be a finite number, not nan"),
    ('name = "one"', 'name = "one"\nover = "gap"', ("study[0]: over = 'gap' is no axis of this study; "
"allowed: spp, xresolution")),
]  # fmt: skip


def parse(text: str, folder: Path = Path()) -> Sweep:
    return parse_sweep(text, "file.toml", folder)


def test_a_good_sweep_is_read() -> None:
    study = parse(GOOD).study[0]
    assert (study.name, study.over, study.axes.seeds, study.reference.spp) == ("one", "spp", [0, 1, 2], 640)


@pytest.mark.parametrize(("old", "new", "message"), MISTAKES)
def test_a_mistake_is_one_clear_line(old: str, new: str, message: str) -> None:
    assert old in GOOD
    with pytest.raises(PenumbraError) as caught:
        lay_out(parse(GOOD.replace(old, new)), "file.toml")
    assert str(caught.value).startswith(f"file.toml: {message}")
    assert "\n" not in str(caught.value)


def test_every_mistake_has_its_line() -> None:
    with pytest.raises(PenumbraError) as caught:
        parse(GOOD.replace("spp = [1, 4]", "spp = [0]").replace("seeds = 3", "seeds = -1"))
    assert [line.split(": ")[1] for line in str(caught.value).splitlines()] == [
        "study[0].axes.spp[0]",
        "study[0].axes.seeds",
    ]


def test_two_studies_of_one_name_are_refused() -> None:
    with pytest.raises(PenumbraError, match="two studies are called 'one'"):
        parse(GOOD + GOOD.split('title = "good"')[1])


def test_missing_file_and_unknown_name(tmp_path: Path) -> None:
    with pytest.raises(PenumbraError, match=r"none\.toml: cannot read the sweep: No such file"):
        load_sweep(str(tmp_path / "none.toml"))
    with pytest.raises(
        PenumbraError, match=r"unknown sweep 'nine'; there are: demo, .*or give a \.toml file"
    ):
        load_sweep("nine")


def test_a_byte_order_mark_is_no_part_of_a_sweep(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_bytes(b"\xef\xbb\xbf" + GOOD.encode())
    assert load_sweep(str(tmp_path / "s.toml")).title == parse_sweep(GOOD, "s.toml", tmp_path).title


def test_scene_paths_are_relative_to_the_sweep(tmp_path: Path) -> None:
    sweep = parse(GOOD.replace('"soft-shadow"', '"sub/mine.pbrt", "soft-shadow"'), tmp_path)
    assert sweep.study[0].scenes == [str(tmp_path / "sub/mine.pbrt"), "soft-shadow"]


@pytest.mark.parametrize("name", builtin_sweeps())
def test_builtin_sweeps_lay_out(name: str) -> None:
    sweep = load_sweep(name)
    plans = lay_out(sweep, name)
    assert all(plan.cells for plan in plans)
    assert Sweep.model_validate_json(sweep.model_dump_json()) == sweep


def test_the_demo_is_the_grid_that_was_promised() -> None:
    """5 spp, 3 seeds, both samplers: 2 estimators on three scenes; and 6 gaps, 2 estimators, 3 seeds."""
    samples, overflow = lay_out(load_sweep("demo"), "demo")
    renders = [cell for cell in samples.cells if cell.job.estimator != samples.study.baseline]
    assert (len(renders), len(overflow.cells)) == (3 * 2 * 5 * 2 * 3, 6 * 2 * 3)
    assert {variant.parameters["gap"] for variant in overflow.variants} == {
        1,
        0.1,
        0.01,
        0.001,
        0.0001,
        0.00001,
    }
    assert min(v.scene.film.width for v in samples.variants) >= 128
    assert min(v.scene.film.height for v in samples.variants) >= 96


def test_an_estimator_that_refuses_a_scene_is_left_out_with_its_reason() -> None:
    text = GOOD.replace('"solid-angle"', '"projected-solid-angle"')
    sweep = parse(text.replace('["soft-shadow"]', '["soft-shadow", "sphere-light"]'))
    (plan,) = lay_out(sweep, "file.toml")
    ball = next(variant for variant in plan.variants if variant.name == "sphere-light")
    (note,) = plan.left_out
    assert (note.scene, note.what) == ("sphere-light", "projected-solid-angle")
    assert note.reason == ESTIMATORS["projected-solid-angle"].refuses(ball.scene)
    assert {cell.job.estimator for cell in plan.cells if cell.job.scene == "sphere-light"} == {"area"}


def test_nothing_left_is_an_error() -> None:
    text = GOOD.replace('["soft-shadow"]', '["disk-light"]').replace('"area", "solid-angle"', '"environment"')
    with pytest.raises(PenumbraError, match="nothing is left to render: environment left out for disk-light"):
        lay_out(parse(text), "file.toml")


def test_a_parameter_that_the_scene_lacks_names_the_study_and_the_scene() -> None:
    text = GOOD.replace("xresolution = [64]", "gap = [0.1]")
    with pytest.raises(
        PenumbraError, match=r"file\.toml: study\[0\]: scene soft-shadow with gap = 0\.1.*no parameter 'gap'"
    ):
        lay_out(parse(text), "file.toml")


def test_order_is_seed_by_seed_shuffled_and_a_function_of_the_cells() -> None:
    (plan,) = lay_out(parse(GOOD), "file.toml")
    order = fair_order(plan.cells)
    assert [cell.key for cell in order] == [cell.key for cell in fair_order((*plan.cells, plan.cells[0]))]
    assert [cell.job.seed for cell in order] == sorted(cell.job.seed for cell in plan.cells)
    assert {cell.key for cell in order} == {cell.key for cell in plan.cells}
    rounds = [[cell.job.estimator for cell in order if cell.job.seed == seed] for seed in range(3)]
    alternating = (["area", "solid-angle"] * 4, ["solid-angle", "area"] * 4)
    # A round alternates by chance in 2 of 70 orders, all three rounds in 2e-5.
    assert any(r not in alternating for r in rounds), "two workers would each get one estimator"
