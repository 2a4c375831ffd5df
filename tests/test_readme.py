"""The README's commands, sweep and Python run as they stand, one after the other in one fresh folder.

`make` commands are `.ci/run`'s to cover. A TOML block is saved under the name in its first line.
"""

from __future__ import annotations

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


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("readme")


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


@pytest.mark.parametrize(("language", "text"), BLOCKS, ids=[text.split("\n")[0][:40] for _, text in BLOCKS])
@pytest.mark.usefixtures("processes")
def test_block_runs(language: str, text: str, folder: Path) -> None:
    if language == "toml":
        (folder / text.splitlines()[0].removeprefix("# ")).write_text(text, encoding="utf-8")
    elif language == "python":
        _run([sys.executable, "-c", text], folder)
    else:
        script = "\n".join(line for line in text.splitlines() if not line.startswith("make "))
        _run(["sh", "-euc", script or ":"], folder)


def test_picture_is_there() -> None:
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README.read_text(encoding="utf-8"))
    assert pictures
    assert all((README.parent / picture).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" for picture in pictures)


def test_links_lead_somewhere() -> None:
    links = re.findall(r"(?<!!)\[[^\]]+\]\((?!http)([^)#]+)", README.read_text(encoding="utf-8"))
    assert links
    assert all((README.parent / link).exists() for link in links)
