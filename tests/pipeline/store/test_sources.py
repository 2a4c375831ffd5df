"""What a reference is kept by holds every source that it depends on."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.backends import BACKENDS
from pipeline.store import sources
from pipeline.store.sources import ROOT, digest

MODULES = {
    "mitsuba": "pipeline.references.backends.mitsuba",
    "pbrt": "pipeline.references.backends.pbrt",
    "closed-form": "pipeline.references.backends.closed_form",
    "closed-form-edge": "pipeline.references.backends.closed_form_edge",
    "self": "pipeline.self_reference",
}
LOADED = """
import sys, importlib
importlib.import_module(sys.argv[1])
print("\\n".join(m.__file__ for n, m in sys.modules.items() if n.startswith("pipeline.references.")))
"""


def found(name: str) -> set[Path]:
    return set(sources.sources(ROOT / (MODULES[name].replace(".", "/") + ".py")))


def test_every_backend_is_here() -> None:
    assert set(BACKENDS.names()) == set(MODULES)


@pytest.mark.parametrize("name", MODULES)
def test_all_that_is_loaded_with_a_backend_is_found_by_its_imports(name: str) -> None:
    """Read from the text on one side, run on the other.

    Registries import no neighbours here: nobody looks anything up.
    """
    command = [sys.executable, "-c", LOADED, MODULES[name]]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = {Path(line) for line in done.stdout.split()}
    assert ROOT / "pipeline/references/protocol.py" in loaded and loaded <= found(name)


@pytest.mark.parametrize(
    ("name", "needed"),
    [
        (
            "mitsuba",
            ["mitsuba/worker", "mitsuba/limits", "mitsuba/__init__", "ambient", "batches", "accumulator"],
        ),
        ("pbrt", ["pbrt/channels", "ambient", "batches", "accumulator"]),
        ("self", ["batches", "accumulator"]),
        ("closed-form", ["closed_form/uniform", "closed_form/image", "closed_form/cone"]),
    ],
)
def test_what_was_once_forgotten_is_there(name: str, needed: list[str]) -> None:
    assert {ROOT / f"pipeline/references/{module}.py" for module in needed} <= found(name)
    assert name != "pbrt" or ROOT / "scenes/pbrt/write/text.py" in found(name)


def test_a_change_of_any_source_changes_the_digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three files, of which one imports the next, and one that nobody imports."""
    folder = tmp_path / "pipeline" / "references"
    folder.mkdir(parents=True)
    texts = {
        "a": "def f():\n    from pipeline.references import b\n",
        "b": "import pipeline.references.c\n",
        "c": "X = 1\n",
        "d": "",
    }
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)
    monkeypatch.setattr(sources, "ROOT", tmp_path)

    def now() -> str:
        digest.cache_clear()
        return digest(folder / "a.py")

    seen = [now()]
    for name in ("c", "b", "a"):
        with (folder / f"{name}.py").open("a") as file:
            file.write("# changed\n")
        seen.append(now())
    assert len(set(seen)) == 4
    (folder / "d.py").write_text("X = 2\n")
    assert now() == seen[-1]
    digest.cache_clear()
