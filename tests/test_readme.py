"""The README's commands, sweep and Python run as they stand, one after the other in one fresh folder.

`make` commands are `.ci/run`'s to cover. A TOML block is saved under the name in its first line.
"""

from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

README = Path(__file__).parent.parent / "README.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)
BLOCKS = BLOCK.findall(README.read_text(encoding="utf-8"))
MAKE = {"make demo", "make test"}


def _run(command: list[str], folder: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, "PATH": path},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}\n{done.stderr}"


def test_every_kind_of_block_is_known() -> None:
    assert {language for language, _ in BLOCKS} == {"sh", "toml", "python"}
    assert {
        line.split("#")[0].strip()
        for _, text in BLOCKS
        for line in text.splitlines()
        if line.startswith("make")
    } == MAKE


@pytest.mark.usefixtures("processes")
def test_blocks_run_and_the_report_of_its_sweep_has_numbers(tmp_path: Path) -> None:
    for language, text in BLOCKS:
        if language == "toml":
            (tmp_path / text.splitlines()[0].removeprefix("# ")).write_text(text, encoding="utf-8")
        elif language == "python":
            _run([sys.executable, "-c", text], tmp_path)
        else:
            script = "\n".join(line for line in text.splitlines() if not line.startswith("make "))
            _run(["sh", "-euc", script or ":"], tmp_path)
    with (tmp_path / "runs/first/report/data.csv").open(newline="") as file:
        points = list(csv.DictReader(file))
    assert [(p["sampler"], p["spp"]) for p in points] == [
        (sampler, spp) for sampler in ("independent", "sobol") for spp in ("1", "4", "16")
    ]
    assert {(p["verdict"], p["seeds"]) for p in points} == {("ok", "5")}
    for p in points:
        assert 0 < float(p["rmse_low"]) < float(p["rmse"]) < float(p["rmse_high"])
        assert float(p["seconds"]) > 0 and float(p["efficiency"]) > 0
    first, last = (float(points[i]["rmse"]) for i in (0, 2))
    assert 3 < first / last < 5  # independent: by the root of 16


def test_picture_is_there() -> None:
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README.read_text(encoding="utf-8"))
    assert pictures
    assert all((README.parent / picture).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" for picture in pictures)


def test_links_lead_somewhere() -> None:
    links = re.findall(r"(?<!!)\[[^\]]+\]\((?!http)([^)#]+)", README.read_text(encoding="utf-8"))
    assert links
    assert all((README.parent / link).exists() for link in links)
