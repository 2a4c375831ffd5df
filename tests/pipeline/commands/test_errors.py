"""What a user gets wrong: one clear line, exit code 2, no traceback, nothing half-written."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.pipeline.commands.test_commands import SMALL, Penumbra, images, penumbra

__all__ = ["penumbra"]

SWEEP = (
    'title = "t"\n[[study]]\nname = "s"\nscenes = ["soft-shadow"]\nmetrics = '
    '["mse"]\n[study.axes]\nestimator = ["area"]\nspp = [1]\n'
)
DARK = 'Camera "perspective"\nIntegrator "path" "integer maxdepth" 1\nWorldBegin\nShape "sphere"\n'

# The command line and the message; {tmp} is an empty folder, in which {tmp}/file is a file.
MISTAKES = [
    ("render nine -o {tmp}/a.exr", "unknown scene 'nine'; there are: .*disk-light, .*"),
    ("render {tmp}/no.pbrt -o {tmp}/a.exr", "there is no scene file '.*no.pbrt'"),
    ("render {tmp}/bad.pbrt -o {tmp}/a.exr", r".*bad\.pbrt:3:1: .*WorldBgein.*"),
    ("render soft-shadow -o {tmp}/a.exr --spp 0", "spp is 0: it must be a whole number of at least 1"),
    ("render soft-shadow -o {tmp}/a.exr --seed -1", "seed is -1: .*"),
    ("render soft-shadow -o {tmp}/a.exr --threads 0", "threads is 0: it must be a whole number of .*"),
    ("render soft-shadow -o {tmp}/a.exr --estimator aera", ("unknown estimator 'aera'; there are: .*area, "
"bsdf, .*")),
    ("--plugin {tmp}/none.py list metrics", r"plug-in .*/none\.py: No such file or directory"),
    ("--plugin {tmp}/b.exr list metrics", r"plug-in .*/b\.exr: give a Python file, whose name ends in \.py"),
    ("render soft-shadow -o {tmp}/a.exr --sampler halton", "unknown sampler 'halton'; there are: .*"),
    (("render disk-light -o {tmp}/a.exr --estimator "
"environment"), "estimator 'environment' does not apply to scene .*"),
    ("render soft-shadow -o {tmp}/a.jpg", r".*a\.jpg: cannot tell the format; allowed: \.exr, \.png"),
    ("render soft-shadow -o {tmp}/none/a.exr", ".*a.exr: there is no folder .*none"),
    ("render soft-shadow -o {tmp}/file/a.exr", ".*a.exr: there is no folder .*file"),
    ("render soft-shadow -o {tmp}/a.exr -D size", "-D size: write it as name=number, .*"),
    ("render soft-shadow -o {tmp}/a.exr -D size=x", "-D size=x: write it as name=number, .*"),
    ("render soft-shadow -o {tmp}/a.exr -D size=1 -D size=2", "-D size=2: size is set twice"),
    ("render soft-shadow -o {tmp}/a.exr -D gap=1", "the scene has no parameter 'gap'; it has: .*"),
    ("reference soft-shadow -o {tmp}/a.exr --backend prbt", ("unknown reference backend 'prbt'; there are: "
"closed-form, closed-form-edge, mitsuba, pbrt, self, .*")),
    ("reference soft-shadow --batches 8", ("--batches 8: at least 64 are needed for a variance that tests "
"can trust")),
    ("reference soft-shadow --target-se 2", "--target-se 2: a number between 0 and 1 is needed, .*"),
    ("reference soft-shadow --quantity light", "--quantity light: there are radiance, ambient-occlusion"),
    (("reference soft-shadow --backend self --cache "
"{tmp}/file"), ".*file: references cannot be written here: .*"),
    ("reference soft-shadow -o {tmp}/a.exr --spp 0", "spp = 0, .*"),
    ("reference soft-shadow -o {tmp}/a.exr --backend closed-form", "scene soft-shadow: .*"),
    ("compare {tmp}/no.exr {tmp}/b.exr", r".*no\.exr: no such image file"),
    ("compare {tmp}/file {tmp}/b.exr", ".*file: not a readable EXR image: .*"),
    ("compare {tmp}/b.exr {tmp}/b.exr --limit relmse=x",
     "--limit relmse=x: write it as name=number, for example --limit relmse=0.01"),
    ("compare {tmp}/b.exr {tmp}/b.exr --limit l2=1", "--limit l2: there is no such metric; there are: .*"),
    ("compare {tmp}/b.exr {tmp}/b.exr --metric l2", "unknown metric 'l2'; there are: .*"),
    ("compare {tmp}/b.exr {tmp}/b.exr --reference-variance {tmp}/no.exr", r".*no\.exr: no such image file"),
    ("verify nine --estimator area", "unknown scene 'nine'; .*"),
    ("verify soft-shadow --estimator aera", "unknown estimator 'aera'; there are: .*"),
    ("verify disk-light --estimator projected-solid-angle", ("estimator 'projected-solid-angle' does not "
"apply to scene .*")),
    ("verify soft-shadow --estimator area --correction fdr", "unknown correction 'fdr'; allowed: sidak, bh"),
    (("verify soft-shadow --estimator mis "
"--reference self"), "the reference 'self' is made by 'mis' itself, .*"),
    (("verify soft-shadow --estimator area --reference closed-form --cache "
"{tmp}/cache"), "scene soft-shadow: no closed-form reference: .*"),
    ("explain nine", "unknown scene 'nine'; .*"),
    ("export soft-shadow -o {tmp}/none/a.pbrt", "there is no folder .*none|.*a.pbrt: there is no folder .*"),
    ("list colours", "cannot list 'colours'; allowed: scenes, .*"),
    ("report {tmp}/none", ".*none: no run here: .*"),
    ("run nine --out {tmp}/run", "unknown sweep 'nine'; there are: demo, .*"),
    ("run {tmp}/no.toml --out {tmp}/run", r".*no\.toml: cannot read the sweep: No such file or directory"),
    ("run {tmp}/bad.toml --out {tmp}/run", (r".*bad\.toml: study\[0\]\.axes\.ssp: unknown key; allowed "
r"here: .*")),
    ("run {tmp}/dark.toml --out {tmp}/run", ".*scene .*dark.pbrt has no lights: .*"),
    ("run {tmp}/good.toml --out {tmp}/file/run", ".*run: cannot write to this folder: Not a directory"),
    ("run {tmp}/good.toml --out {tmp}/run --workers 0", "workers = 0: give at least 1"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "message"), MISTAKES)
def test_a_mistake_gets_one_line_and_exit_code_2(
    penumbra: Penumbra, tmp_path: Path, line: str, message: str
) -> None:
    (tmp_path / "file").write_text("no image, no folder")
    (tmp_path / "dark.pbrt").write_text(DARK)
    (tmp_path / "bad.pbrt").write_text(DARK.replace("WorldBegin", "WorldBgein"))
    (tmp_path / "good.toml").write_text(SWEEP)
    (tmp_path / "bad.toml").write_text(SWEEP.replace("spp", "ssp") + "spp = [1]\n")
    (tmp_path / "dark.toml").write_text(SWEEP.replace("soft-shadow", "dark.pbrt"))
    images(tmp_path, 0.0)
    before = sorted(tmp_path.rglob("*"))
    code, out, err = penumbra(*line.format(tmp=tmp_path).split())
    assert (code, out) == (2, "")
    (said,) = [text for text in err.splitlines() if text.strip()]
    assert re.fullmatch(f"penumbra: {message}", said)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    "line", ["render soft-shadow", "run demo", "render soft-shadow -o a.exr --spp x", "paint", "run"]
)
def test_a_command_line_that_cannot_be_parsed(penumbra: Penumbra, line: str) -> None:
    code, out, err = penumbra(*line.split())
    assert (code, out) == (2, "")
    assert "Error" in err
    assert "Traceback" not in err


def test_an_error_of_ours_is_not_hidden(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A fault of ours keeps its traceback, and its exit code is not that of a check that failed."""
    import pipeline.run.job
    from pipeline.cli import main

    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(pipeline.run.job, "render", broken)
    with pytest.raises(SystemExit) as stopped:
        main(["render", "touching-light", "-o", str(tmp_path / "a.exr"), *SMALL])
    err = capsys.readouterr().err
    assert stopped.value.code == 3
    assert "ZeroDivisionError" in err and err.endswith("please report it\n")
