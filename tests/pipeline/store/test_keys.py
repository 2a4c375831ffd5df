"""Keys change with every input that their entry depends on, and with nothing else."""

from __future__ import annotations

import importlib.metadata
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.backends import BACKENDS
from pipeline.schema.record import Job
from pipeline.store import keys
from pipeline.store.keys import ROOT, cell_key, imported_code, reference_key
from renderer.fingerprint import fingerprint_of
from scenes import load
from scenes.hashing import hash_values
from scenes.images.exr import write_exr
from scenes.imports import imported_files

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
    return set(imported_files([ROOT / (MODULES[name].replace(".", "/") + ".py")], ROOT, keys.FOLLOWED))


def test_every_backend_is_here() -> None:
    assert set(BACKENDS.names()) == set(MODULES)


@pytest.mark.parametrize("name", MODULES)
@pytest.mark.usefixtures("processes")
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
    monkeypatch.setattr(keys, "ROOT", tmp_path)

    def now() -> str:
        imported_code.cache_clear()
        return imported_code(folder / "a.py")

    seen = [now()]
    for name in ("c", "b", "a"):
        with (folder / f"{name}.py").open("a") as file:
            file.write("# changed\n")
        seen.append(now())
    assert len(set(seen)) == 4
    (folder / "d.py").write_text("X = 2\n")
    assert now() == seen[-1]
    imported_code.cache_clear()


def test_cell_keys_tell_apart_what_an_image_depends_on_and_nothing_else() -> None:
    job = Job(scene="a", parameters={"gap": 1.0}, estimator="area", sampler="sobol", spp=4, seed=0)
    base = cell_key("hash", job, "renderer")
    others = [
        cell_key("other", job, "renderer"),
        cell_key("hash", job, "changed"),
        *(
            cell_key("hash", job.model_copy(update=change), "renderer")
            for change in ({"estimator": "solid-angle"}, {"sampler": "independent"}, {"spp": 5}, {"seed": 1})
        ),
    ]
    assert len({base, *others}) == 7
    assert base == cell_key("hash", job.model_copy(update={"scene": "b", "parameters": {}}), "renderer")


JOB = Job(scene="painted", estimator="mis", sampler="independent", spp=4, seed=0)
SCENE = """
Camera "perspective"
WorldBegin
LightSource "infinite" "string filename" "sky.exr"
Shape "sphere"
"""


class Inputs:
    """A project and a scene that may be edited, with the key of one cell and of its reference."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("renderer/render.py", "scenes/catalog.py", "pipeline/references/backends/b.py"):
            self.write(name, "x = 1\n")
        self.write("painted.pbrt", SCENE)
        self.sky(1.0)
        self.versions = {"numpy": "1", "scipy": "1", "embreex": "1", "trimesh": "1"}
        self.job = JOB

    def write(self, name: str, text: str) -> None:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def sky(self, value: float) -> None:
        write_exr(self.folder / "sky.exr", {name: np.full((4, 4), value) for name in "RGB"})

    def cell(self) -> str:
        scene = load(str(self.folder / "painted.pbrt"))
        return cell_key(scene.content_hash(), self.job, fingerprint_of(self.folder))

    def reference(self) -> str:
        imported_code.cache_clear()
        code = imported_code(self.folder / "pipeline/references/backends/b.py")
        scene = load(str(self.folder / "painted.pbrt"))
        return reference_key(scene.content_hash(), "b", code, "radiance", self.job.seed)


CHANGES: dict[str, tuple[Callable[[Inputs], object], set[str]]] = {
    "a source of the renderer": (lambda i: i.write("renderer/render.py", "x = 2\n"), {"cell"}),
    "a source of the scenes": (lambda i: i.write("scenes/catalog.py", "x = 2\n"), {"cell"}),
    "a new source": (lambda i: i.write("renderer/new.py", ""), {"cell"}),
    "a source of the backend": (
        lambda i: i.write("pipeline/references/backends/b.py", "x = 2\n"),
        {"reference"},
    ),
    "NumPy": (lambda i: i.versions.update(numpy="2"), {"cell", "reference"}),
    "SciPy": (lambda i: i.versions.update(scipy="2"), {"cell", "reference"}),
    "trimesh": (lambda i: i.versions.update(trimesh="2"), {"cell", "reference"}),
    "embreex": (lambda i: i.versions.update(embreex="2"), {"cell"}),
    "a byte of the scene": (
        lambda i: i.write("painted.pbrt", SCENE.replace('sphere"', 'sphere" "float radius" 2')),
        {"cell", "reference"},
    ),
    "a byte of an asset": (lambda i: i.sky(1.5), {"cell", "reference"}),
    "the seed": (lambda i: setattr(i, "job", JOB.model_copy(update={"seed": 1})), {"cell", "reference"}),
    "a comment in the scene": (lambda i: i.write("painted.pbrt", f"# a comment\n{SCENE}"), set()),
    "a file that is no source": (lambda i: i.write("renderer/notes.txt", "no source"), set()),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_key_changes_with_each_of_its_inputs_and_with_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    change, expected = CHANGES[what]
    inputs = Inputs(tmp_path)
    monkeypatch.setattr(keys, "ROOT", tmp_path)
    monkeypatch.setattr(importlib.metadata, "version", lambda name: inputs.versions[name])
    before = {"cell": inputs.cell(), "reference": inputs.reference()}
    change(inputs)
    after = {"cell": inputs.cell(), "reference": inputs.reference()}
    assert {name for name in before if before[name] != after[name]} == expected
    imported_code.cache_clear()


def test_values_that_differ_hash_apart() -> None:
    """Types, lengths and boundaries count: no two of these feed the same bytes."""
    values: list[object] = [
        (), [1], (1, 2), ((1,), 2), (1, (2,)), "12", ("1", "2"), 1, 1.0, True, "1", b"1", None, "None",
        {"a": 1}, {"a": "1"}, {"b": 1}, ("a", 1), np.ones(1), np.ones((1, 1)), np.ones(1, np.float32),
        np.float64(1), -0.0, 0.0,
    ]  # fmt: skip
    assert len({hash_values(value) for value in values}) == len(values)
    assert hash_values("a", "b") != hash_values("ab")
    assert hash_values({"a": 1, "b": 2}) == hash_values({"b": 2, "a": 1})
    with pytest.raises(TypeError, match="a set has no content hash"):
        hash_values({1, 2})
