"""Every command by its own command line: what it prints, what it writes, and with which code it exits."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.cli import app, main
from pipeline.schema.sweep import builtin_sweeps
from renderer import render
from scenes import library, load
from scenes.images.exr import read_estimate_exr, write_estimate_exr, write_exr
from scenes.pbrt.parser import parse

ROOT = Path(__file__).parents[3]
SMALL = ["-D", "xresolution=24", "-D", "yresolution=18"]
COMMANDS = (
    "demo", "run", "report", "render", "reference", "baseline", "compare", "test", "verify", "explain", "export", "convert", "ladder", "agreement", "preview", "list", "doctor",  # noqa: E501
)  # fmt: skip

Answer = tuple[int, str, str]
Penumbra = Callable[..., Answer]


@pytest.fixture
def penumbra(capsys: pytest.CaptureFixture[str]) -> Penumbra:
    """Runs a command line in this process: exit code, stdout, stderr."""

    def call(*arguments: str | Path) -> Answer:
        with pytest.raises(SystemExit) as stopped:
            main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return int(stopped.value.code or 0), out, err

    return call


def answer(penumbra: Penumbra, *arguments: str | Path) -> Any:
    code, out, err = penumbra(*arguments, "--json")
    assert code == 0, err
    return json.loads(out)


def test_help_shows_every_command_with_an_example(penumbra: Penumbra) -> None:
    code, out, _ = penumbra("--help")
    assert code == 0
    examples = out[out.index("Examples:") :]
    assert {command.name for command in app.registered_commands} == set(COMMANDS)
    assert all(f"penumbra {name}" in examples for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_each_command_has_an_example_of_its_own(penumbra: Penumbra, name: str) -> None:
    code, out, _ = penumbra(name, "--help")
    assert code == 0
    assert f"penumbra {name}" in out[out.index("Examples:") :]


@pytest.mark.usefixtures("processes")
def test_help_waits_for_nothing_heavy() -> None:
    """`--help` within a second, by what it does not import."""
    heavy = ("numpy", "scenes", "renderer", "reports", "plotly", "scipy", "pydantic")
    code = f"import sys, pipeline.cli; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("kind", ["scenes", "estimators", "samplers", "metrics", "backends", "sweeps"])
def test_lists_name_what_there_is(penumbra: Penumbra, kind: str) -> None:
    rows = answer(penumbra, "list", kind)
    code, table, _ = penumbra("list", kind)
    assert code == 0
    assert rows
    assert all(row["name"] in table and row["title"] for row in rows)


def test_lists_of_scenes_and_sweeps_are_whole(penumbra: Penumbra) -> None:
    kinds = {row["kind"]: row for row in answer(penumbra, "list")}
    assert list(kinds) == ["scenes", "estimators", "samplers", "metrics", "backends", "sweeps"]
    assert kinds["scenes"]["number"] == len(library()) and "sobol" in kinds["samplers"]["names"]
    assert [row["name"] for row in answer(penumbra, "list", "scenes")] == [scene.name for scene in library()]
    assert [row["name"] for row in answer(penumbra, "list", "sweeps")] == list(builtin_sweeps())


def test_render_writes_the_image_of_the_library_call(penumbra: Penumbra, tmp_path: Path) -> None:
    out = tmp_path / "out.exr"
    told = answer(
        penumbra, "render", "touching-light", "-o", out, *SMALL, "-D", "gap=0.1",
        "--estimator", "solid-angle", "--sampler", "sobol", "--spp", "4", "--seed", "3",
    )  # fmt: skip
    scene = load("touching-light", {"xresolution": 24, "yresolution": 18, "gap": 0.1})
    expected = render(scene, estimator="solid-angle", sampler="sobol", spp=4, seed=3)
    stored = read_estimate_exr(out)
    assert np.array_equal(stored.mean, expected.image.astype(np.float32))
    assert (stored.count == 4).all()
    assert json.loads(stored.metadata["job"])["seed"] == 3
    assert told["mean"] == expected.image.mean(axis=(0, 1)).tolist()
    assert told["rays"] == {"primary": 24 * 18 * 4, "shadow": expected.rays.shadow}
    assert told["statistics"]["verdict"] == "ok"


def test_render_takes_what_is_not_given_from_the_scene(penumbra: Penumbra, tmp_path: Path) -> None:
    told = answer(penumbra, "render", "touching-light", "-o", tmp_path / "out.png", *SMALL)
    defaults = load("touching-light").defaults
    assert {name: told["job"][name] for name in ("sampler", "spp", "seed")} == {
        "sampler": defaults.sampler,
        "spp": defaults.spp,
        "seed": defaults.seed,
    }
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG")


def test_one_sample_has_no_noise_and_json_no_nan(penumbra: Penumbra, tmp_path: Path) -> None:
    told = answer(penumbra, "render", "touching-light", "-o", tmp_path / "a.exr", *SMALL, "--spp", "1")
    assert told["statistics"]["noise"] is None


def test_quiet_says_nothing_on_stderr(penumbra: Penumbra, tmp_path: Path) -> None:
    assert penumbra("render", "touching-light", "-o", tmp_path / "a.exr", *SMALL, "--quiet")[2] == ""


def test_a_picture_that_is_not_pbrts_is_told_of(penumbra: Penumbra, tmp_path: Path) -> None:
    scene = tmp_path / "plain.pbrt"
    scene.write_text(
        'Film "rgb" "integer xresolution" 8 "integer yresolution" 6 WorldBegin LightSource "infinite"'
    )
    assert "the file has no Integrator" in penumbra("render", scene, "-o", tmp_path / "a.exr")[2]
    assert penumbra("render", scene, "-o", tmp_path / "a.exr", "--quiet")[2] == ""
    scene.write_text('Integrator "path" "integer maxdepth" 1\n' + scene.read_text())
    assert "Integrator" not in penumbra("render", scene, "-o", tmp_path / "a.exr")[2]


@pytest.mark.parametrize("more", [[], ["--no-prune"], ["--estimator", "solid-angle"]])
def test_a_scene_without_lights_is_black_as_in_pbrt(
    penumbra: Penumbra, tmp_path: Path, more: list[str]
) -> None:
    scene, image = tmp_path / "dark.pbrt", tmp_path / "a.exr"
    film = 'Film "rgb" "integer xresolution" 4 "integer yresolution" 3\n'
    scene.write_text(f'Integrator "path" "integer maxdepth" 1\n{film}WorldBegin\nShape "sphere"\n')
    code, _, err = penumbra("render", scene, "-o", image, "--spp", "1", "--strict", *more)
    assert code == 0, err
    assert "the scene has no lights: its image is black" in err
    assert not read_estimate_exr(image).mean.any()


@pytest.mark.usefixtures("processes")
def test_no_color_is_respected(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "pipeline.cli",
        "render",
        "touching-light",
        "-o",
        str(tmp_path / "a.exr"),
        *SMALL,
    ]
    for variables, coloured in (({"FORCE_COLOR": "1", "NO_COLOR": "1"}, False), ({"FORCE_COLOR": "1"}, True)):
        environment = {**os.environ, "TERM": "xterm-256color", **variables}
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
        assert ("\x1b[38;5;" in done.stderr) is coloured, "of the progress bar"


def test_reference_by_closed_form_agrees_with_a_render(penumbra: Penumbra, tmp_path: Path) -> None:
    out, exact = tmp_path / "out.exr", tmp_path / "exact.exr"
    gap = ["-D", "gap=1"]
    answer(
        penumbra,
        "render",
        "touching-light",
        "-o",
        out,
        *SMALL,
        *gap,
        "--estimator",
        "solid-angle",
        "--spp",
        "256",
    )
    told = answer(
        penumbra, "reference", "touching-light", "-o", exact, *SMALL, *gap, "--backend", "closed-form"
    )
    assert told["batches"] == 0
    assert told["rms_standard_error"] < 1e-6
    stored, truth = read_estimate_exr(out), read_estimate_exr(exact)
    error = np.sqrt(stored.variance.sum(axis=(0, 1))) / stored.count.size
    bias = np.abs(stored.mean.mean(axis=(0, 1)) - truth.mean.mean(axis=(0, 1)))
    assert (bias < 4 * error).all()
    caught = (4 * error / truth.mean.mean(axis=(0, 1))).max()
    assert caught < 0.02
    noise = answer(penumbra, "compare", out, exact, "--metric", "mse")["scores"]["mse"]
    assert noise["low"] < stored.variance.mean() < noise["high"], "against the truth, the MSE is the variance"
    print(f"smallest bias that this would have caught: {caught:.2%} of the image mean")


def test_compare_warns_of_another_scene_and_of_samples_that_cannot_be_trusted(
    penumbra: Penumbra, tmp_path: Path
) -> None:
    size = ("-D", "xresolution=64", "-D", "yresolution=48")
    for name, gap in (("near", "0.0001"), ("far", "1")):
        how = (*size, "-D", f"gap={gap}", "--estimator", "area")
        answer(penumbra, "render", "touching-light", "-o", tmp_path / f"{name}.exr", *how)
    answer(
        penumbra,
        "reference",
        "touching-light",
        "-o",
        tmp_path / "exact.exr",
        *size,
        "-D",
        "gap=1",
        "--backend",
        "closed-form",
    )
    exact = tmp_path / "exact.exr"
    assert answer(penumbra, "compare", tmp_path / "far.exr", exact, "--metric", "mse")["warnings"] == []
    other, heavy = answer(penumbra, "compare", tmp_path / "near.exr", exact, "--metric", "mse")["warnings"]
    assert "not of the same scene" in other
    assert "untrustworthy" in heavy


def test_export_is_text_that_reads_back_as_the_scene(penumbra: Penumbra, tmp_path: Path) -> None:
    code, text, _ = penumbra("export", "touching-light", "-D", "gap=0.001")
    assert code == 0
    assert parse(text).content_hash() == load("touching-light", {"gap": 0.001}).content_hash()
    assert penumbra("export", "touching-light", "-D", "gap=0.001", "-o", tmp_path / "gap.pbrt")[0] == 0
    assert (tmp_path / "gap.pbrt").read_text() == text


def test_explain_gives_effect_decision_and_reason(penumbra: Penumbra) -> None:
    told = answer(penumbra, "explain", "touching-light", *SMALL)
    assert all(effect["reason"] for effect in told["effects"])
    assert told["measured"] == {}
    shadow = next(effect for effect in told["effects"] if effect["pruning"] == "occlusion")
    assert not shadow["needed"], "nothing stands between a floor and a light over it"


def test_explain_measures_and_proves_the_image_the_same(penumbra: Penumbra) -> None:
    told = answer(penumbra, "explain", "touching-light", *SMALL, "--measure", "--spp", "2")
    idle = {effect["pruning"] for effect in told["effects"] if not effect["needed"]} - {"none"}
    assert set(told["measured"]) == {*idle, "all of it"}
    assert all(item["same_image"] for item in told["measured"].values())
    assert all(
        item["cpu_seconds_left_out"] > 0 < item["cpu_seconds_simulated"] for item in told["measured"].values()
    )


def images(tmp_path: Path, shift: float) -> tuple[Path, Path]:
    """A reference of known variance, and an image that is off by `shift`."""
    truth = np.random.default_rng(1).uniform(0.2, 1.0, (12, 16, 3))
    write_exr(tmp_path / "a.exr", {name: truth[..., i] + shift for i, name in enumerate("RGB")})
    write_estimate_exr(tmp_path / "b.exr", truth, np.full_like(truth, 1e-8), 4096, {"batches": "64"})
    return tmp_path / "a.exr", tmp_path / "b.exr"


def test_compare_scores_by_every_metric(penumbra: Penumbra, tmp_path: Path) -> None:
    scores = answer(penumbra, "compare", *images(tmp_path, 0.1))["scores"]
    assert {"mse", "relmse", "ssim", "psnr", "flip", "nonfinite"} <= scores.keys()
    assert scores["mse"]["value"] == pytest.approx(0.01, rel=1e-4)
    assert scores["rmse"]["value"] == pytest.approx(0.1, rel=1e-4)


@pytest.mark.parametrize(
    ("limit", "code"), [("mse=0.02", 0), ("mse=0.005", 1), ("ssim=0.999999", 1), ("ssim=0.1", 0)]
)
def test_compare_fails_beyond_a_limit(penumbra: Penumbra, tmp_path: Path, limit: str, code: int) -> None:
    got, _, err = penumbra("compare", *images(tmp_path, 0.1), "--limit", limit, "--metric", "mse")
    assert got == code
    assert ("is worse than the limit" in err) is bool(code)


FOG = (
    'Camera "perspective"\n'
    'Film "rgb" "integer xresolution" 4 "integer yresolution" 3 "string filename" "a.exr"\n'
    'Integrator "volpath" "integer maxdepth" 1\n'
    'MakeNamedMedium "fog" "string type" "homogeneous"\nWorldBegin\n'
    'LightSource "infinite"\nMediumInterface "fog" ""\nMaterial "interface"\nShape "sphere"\n'
)


@pytest.mark.parametrize("command", ["render", "explain", "agreement", "export"])
def test_a_medium_is_refused_or_rendered_as_empty_space_on_demand(
    penumbra: Penumbra, tmp_path: Path, command: str
) -> None:
    (tmp_path / "fog.pbrt").write_text(FOG)
    more = ["-o", tmp_path / "a.exr"] if command == "render" else []
    line = [command, tmp_path / "fog.pbrt", *more]
    code, _, err = penumbra(*line)
    assert code == 2
    assert "fog.pbrt:7:1: a medium is not supported; --substitute renders it as empty space" in err
    code, _, err = penumbra(*line, "--substitute")
    assert code == 0, err
    assert "a medium: rendered as empty space" in err


def test_what_was_substituted_is_in_the_answer(penumbra: Penumbra, tmp_path: Path) -> None:
    (tmp_path / "fog.pbrt").write_text(FOG)
    found = answer(penumbra, "render", tmp_path / "fog.pbrt", "--substitute", "-o", tmp_path / "a.exr")
    (line,) = found["substitutions"]
    assert line.startswith("a medium: rendered as empty space")
    stored = read_estimate_exr(tmp_path / "a.exr").metadata
    assert json.loads(stored["substitutions"]) == found["substitutions"]
    assert json.loads(stored["notes"]) == found["notes"]


def test_strict_refuses_what_a_note_would_do_for(penumbra: Penumbra, tmp_path: Path) -> None:
    deep = FOG.replace('maxdepth" 1', "maxdepth" + '" 7').replace('MediumInterface "fog" ""\n', "")
    (tmp_path / "deep.pbrt").write_text(deep)
    line = ["explain", tmp_path / "deep.pbrt"]
    code, _, err = penumbra(*line)
    assert code == 0 and "maxdepth is 7" in err
    code, _, err = penumbra(*line, "--strict")
    assert code == 2 and "deep.pbrt:3:" in err and "maxdepth is 7" in err
