"""Terminals and file names as they come: other encodings and widths, names that are no UTF-8."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SIZE = ("-D", "xresolution=8", "-D", "yresolution=6", "--spp", "1")


def run(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "penumbra", *arguments]
    given = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    return subprocess.run(command, cwd=folder, env=given, capture_output=True)


@pytest.mark.usefixtures("processes")
def test_a_terminal_without_unicode_gets_a_table(tmp_path: Path) -> None:
    done = run(tmp_path, "list", "metrics", PYTHONIOENCODING="ascii", COLUMNS="70")
    assert (done.returncode, done.stderr) == (0, b"")
    lines = done.stdout.decode("ascii").splitlines()
    assert max(map(len, lines)) == 70
    assert any("relmse" in line for line in lines)


@pytest.mark.usefixtures("processes")
@pytest.mark.parametrize(
    "line",
    [
        ("render", "soft-shadow", *SIZE, "-o", "\udcff.exr"),
        ("render", "soft-shadow", *SIZE, "-o", "\udcff.png"),
        ("run", "sweep.toml", "-o", "\udcff"),
        ("compare", "\udcff.exr", "\udcff.exr"),
    ],
)
def test_a_name_that_is_not_utf8_is_refused_before_any_work(tmp_path: Path, line: tuple[str, ...]) -> None:
    (tmp_path / "\udcff.exr").write_bytes(b"kept")
    study = '[[study]]\nname = "a"\nscenes = ["soft-shadow"]\nmetrics = ["mse"]\n'
    axes = '[study.axes]\nestimator = ["area"]\nspp = [1]\n'
    (tmp_path / "sweep.toml").write_text(f'title = "t"\n{study}{axes}')
    done = run(tmp_path, *line)
    assert (done.returncode, done.stdout) == (2, b"")
    assert b": the name is not UTF-8, which images need; rename the file or its folder\n" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sweep.toml", "\udcff.exr"]
    assert (tmp_path / "\udcff.exr").read_bytes() == b"kept"
