"""The examples of docs/extending.md run as they stand.

Each block is saved under the name in its first line. Each `use_` block runs in a process of its own: what it
registers there does not reach the registries of these tests.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.test_kinds import TABLE

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
BLOCKS = {
    text.split("\n")[0].removeprefix("# "): text
    for text in re.findall(r"^```python\n(.*?)^```$", PAGE, flags=re.MULTILINE | re.DOTALL)
}
USES = [name for name in BLOCKS if name.startswith("use_")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("extending")
    for name, text in BLOCKS.items():
        (made / name).write_text(text, encoding="utf-8")
    return made


def test_every_module_is_used() -> None:
    assert all(name.endswith(".py") for name in BLOCKS)
    assert {f"use_{name}" for name in BLOCKS if name != "stage.py" and name not in USES} == set(USES)
    assert len(USES) >= 3


@pytest.mark.parametrize("name", USES)
@pytest.mark.usefixtures("processes")
def test_example_runs(name: str, folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, name],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", [name for name in BLOCKS if name not in USES])
def test_module_is_small(name: str) -> None:
    assert len(BLOCKS[name].splitlines()) <= 80


@pytest.mark.parametrize("kind", ["spot light", "conductor", "checkerboard", "disk"])
def test_files_to_touch_are_those_of_the_house_test(kind: str) -> None:
    """The page promises no fewer files than tests/test_kinds.py allows."""
    told = re.search(rf"as the {kind} \| up to (\d+) \|", PAGE)
    assert told
    assert int(told.group(1)) >= next(entry.limit for entry in TABLE if entry.name == kind)
