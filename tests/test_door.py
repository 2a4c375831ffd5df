"""The open door: licences, hooks, and the ways in that a stranger takes."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from pipeline import doctor, extras
from pipeline.baseline import entry
from pipeline.cli import main
from reports.viewer import flipbook_source
from scenes import load

ROOT = Path(__file__).parent.parent


def _commands_of_make_check() -> list[str]:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    recipe = re.search(r"^check:.*\n((?:\t.*\n)+)", text, flags=re.MULTILINE)
    assert recipe is not None
    lines = (line.strip().lstrip("@") for line in recipe[1].splitlines())
    return [line.replace("$(UV)", "uv").replace("$(BIN)", ".venv/bin") for line in lines]


def test_hooks_run_the_commands_of_make_check() -> None:
    hooks = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    assert re.findall(r"entry: (.+)", hooks) == _commands_of_make_check()


def test_hooks_take_the_uv_that_make_installs() -> None:
    hooks = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert re.findall(r"uv==([\d.]+)", hooks) == re.findall(r"UV_VERSION := ([\d.]+)", makefile)


def test_workflow_runs_the_checks_and_the_tests() -> None:
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    assert {"make check", "make test"} <= set(re.findall(r"run: (make .+)", workflow))
    assert re.findall(r"python: \[(.+)\]", workflow) == ['"3.11", "3.12", "3.13"']


def test_licence_is_told_alike_everywhere() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert project["license"] == "Apache-2.0"
    assert "license: Apache-2.0" in citation
    assert f"version: {project['version']}\n" in citation
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert "Apache License" in text and "END OF TERMS AND CONDITIONS" in text


def test_notice_names_every_bundled_file() -> None:
    notice = (ROOT / "NOTICE").read_text(encoding="utf-8")
    bundled = [path for folder in ("reports/bundled", "scenes/data") for path in (ROOT / folder).iterdir()]
    assert bundled
    assert [path for path in bundled if path.relative_to(ROOT).as_posix() not in notice] == []


def test_flip_book_is_the_published_one() -> None:
    """Byte for byte the file of simpleimageio, wherever that package could be built."""
    import simpleimageio

    published = Path(simpleimageio.__file__).with_name("flipbook.js")
    assert flipbook_source() == published.read_text(encoding="utf-8")


def test_table_of_tests_names_folders_that_exist() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = set(re.findall(r"\btests/[\w/.]*\w", text)) - {"tests/test_wheel.py"}
    assert named
    assert [name for name in named if not (ROOT / name).exists()] == []


def _without(monkeypatch: pytest.MonkeyPatch, *modules: str) -> None:
    there = extras.find_spec
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name in modules else there(name))


@pytest.mark.parametrize(
    ("extra", "module", "command"),
    [
        ("preview", "pyvista", ["preview", "soft-shadow", "-o", "look.png"]),
        ("baseline", "pyrender", ["baseline", "soft-shadow", "-o", "look.png"]),
    ],
)
def test_command_without_its_extra_says_how_to_get_it(
    extra: str,
    module: str,
    command: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    _without(monkeypatch, module)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stop:
        main([*command, "--quiet"])
    assert stop.value.code == 2
    assert capsys.readouterr().err == (
        f"penumbra: {module} is not installed: pip install 'penumbra[{extra}]'\n"
    )


def test_sweep_without_the_baseline_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    _without(monkeypatch, "pyrender", "OpenGL")
    entry.missing.cache_clear()
    reason = entry.refuses(load("soft-shadow"))
    entry.missing.cache_clear()
    assert reason == "pyrender and OpenGL are not installed: pip install 'penumbra[baseline]'"


def test_doctor_tells_extras_that_are_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    _without(monkeypatch, "pyrender", "pyvista")
    (raster,), (view,) = doctor.rasteriser(), doctor.preview()
    assert not raster.works and raster.detail == "pyrender is not installed"
    assert raster.remedy == "pip install 'penumbra[baseline]'"
    assert not view.works and view.detail == "pyvista is not installed"
    assert view.remedy == "pip install 'penumbra[preview]'"


def test_extras_are_those_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = project["optional-dependencies"]
    assert set(extras.EXTRAS) == set(declared) - {"all"}
    assert declared["all"] == [f"penumbra[{','.join(extras.EXTRAS)}]"]
    assert all(extras.missing_extra(name) is None for name in extras.EXTRAS)
