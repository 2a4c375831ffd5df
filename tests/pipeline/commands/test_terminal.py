"""Terminals and file names as they come: other encodings and widths, names that are no UTF-8."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest

from pipeline.cli import main

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


def picture(folder: Path, power: float, *options: str, capsys: pytest.CaptureFixture[str]) -> tuple[str, int]:
    """A white floor of radiance `power` from edge to edge: what is said of it, and its code in the PNG."""
    (folder / "floor.pbrt").write_text(
        'LookAt 0 0 1  0 0 0  0 1 0  Camera "perspective" "float fov" [ 40 ]\n'
        'Film "rgb" "integer xresolution" [ 4 ] "integer yresolution" [ 4 ]\nWorldBegin\n'
        'LightSource "distant" "point3 from" [ 0 0 1 ] "point3 to" [ 0 0 0 ] '
        f'"rgb L" [ {power} {power} {power} ]\n'
        'Material "diffuse" "rgb reflectance" [ 1 1 1 ]\n'
        'Shape "trianglemesh" "point3 P" [ -9 -9 0  9 -9 0  0 9 0 ] "integer indices" [ 0 1 2 ]\n'
    )
    with pytest.raises(SystemExit) as stopped:
        main(["render", str(folder / "floor.pbrt"), "-o", str(folder / "a.png"), "--spp", "1", *options])
    assert stopped.value.code == 0
    said = [line for line in capsys.readouterr().err.splitlines() if "--exposure" in line]
    pixels = OpenImageIO.ImageBuf(str(folder / "a.png")).get_pixels(OpenImageIO.UINT8)
    assert np.ptp(pixels) == 0
    return "".join(said), int(pixels[0, 0, 0])


def test_a_picture_that_shows_nothing_names_the_exposure_that_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The floor's radiance is power / pi; codes are those of sRGB."""
    assert picture(tmp_path, 0.5 * np.pi, capsys=capsys) == ("", 188)
    said, code = picture(tmp_path, 6 * np.pi, capsys=capsys)
    assert said.endswith("a.png: the picture is clipped to white; --exposure -3 shows it better")
    assert code == 255
    assert picture(tmp_path, 6 * np.pi, "--exposure", "-3", capsys=capsys) == ("", 225)  # 6 / 8
    said, code = picture(tmp_path, 0.01 * np.pi, capsys=capsys)
    assert said.endswith("a.png: the picture is nearly black; --exposure 6 shows it better")
    assert picture(tmp_path, 0.01 * np.pi, "--exposure", "6", capsys=capsys) == ("", 209)  # 0.64


@pytest.mark.usefixtures("processes")
@pytest.mark.parametrize("line", ["list scenes", "list scenes --json"])
def test_a_reader_that_leaves_is_no_failed_check(tmp_path: Path, line: str) -> None:
    """What a shell reports for a program that a closed pipe stops, and not a word."""
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "penumbra", *line.split()]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, b"")
