"""The fingerprint changes with every source and every library that an image's bits depend on."""

from __future__ import annotations

import shutil
from importlib import import_module, metadata

from renderer.fingerprint import fingerprint, fingerprint_of

code = import_module("renderer.fingerprint")  # `renderer.fingerprint` is the function, too


def test_any_edit_and_any_upgrade_gives_another_fingerprint(tmp_path, monkeypatch):
    installed = {"numpy": "1", "scipy": "1", "embreex": "1", "trimesh": "1"}
    monkeypatch.setattr(metadata, "version", lambda name: installed[name])
    for folder in ("renderer/lights", "scenes"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "a.py").write_text("x = 1\n")
    seen = {fingerprint_of(tmp_path)}
    for library in installed:
        installed[library] = "2"
        seen.add(fingerprint_of(tmp_path))
    for edited in ("renderer/lights/a.py", "scenes/a.py"):
        (tmp_path / edited).write_text("x = 2\n")
        seen.add(fingerprint_of(tmp_path))
    (tmp_path / "scenes" / "b.py").write_text("x = 2\n")
    seen.add(fingerprint_of(tmp_path))
    assert len(seen) == 8
    (tmp_path / "notes.txt").write_text("no source")
    assert fingerprint_of(tmp_path) in seen
    monkeypatch.undo()
    assert len(fingerprint()) == 64


def test_images_depend_on_their_own_estimator_with_what_it_imports_and_on_all_that_is_shared(
    tmp_path, monkeypatch
):
    """Catches an import that is not followed, a folder left out, and an edit that renders everything anew."""
    for room in ("renderer", "scenes"):
        shutil.copytree(
            code.ROOT / room, tmp_path / room, ignore=shutil.ignore_patterns("*.pbrt", "*.exr", "*.ply")
        )
    estimators = {"mis": "mis", "environment": "environment", "area": "light_sampling"}
    monkeypatch.setattr(code, "ROOT", tmp_path)
    monkeypatch.setattr(
        code.ESTIMATORS, "file", lambda name: tmp_path / f"renderer/estimators/{estimators[name]}.py"
    )
    monkeypatch.setattr(code.SAMPLERS, "file", lambda name: tmp_path / f"renderer/samplers/{name}.py")
    monkeypatch.setattr(code.ESTIMATORS, "code", lambda _: "")
    monkeypatch.setattr(code.SAMPLERS, "code", lambda _: "")

    def keys():
        code._shared.cache_clear()
        code._plugged.cache_clear()
        return {(e, s): code.image_fingerprint(e, s) for e in estimators for s in ("sobol", "independent")}

    def changed(path):
        before = keys()
        with (tmp_path / path).open("a") as file:
            file.write("\n# edited\n")
        after = keys()
        return {pair for pair in after if after[pair] != before[pair]}

    every = set(keys())
    of = {name: {pair for pair in every if name in pair} for name in (*estimators, "sobol")}
    # `environment` falls back on what `mis` prefers, and both draw lights by `light_sampling`.
    assert changed("renderer/estimators/mis.py") == of["mis"] | of["environment"]
    assert changed("renderer/estimators/light_sampling.py") == of["area"] | of["environment"]
    assert changed("renderer/estimators/direction_sampling.py") == set()
    assert changed("renderer/samplers/sobol.py") == of["sobol"]
    assert changed("renderer/samplers/stratified.py") == set()
    for shared in ("renderer/film.py", "renderer/estimators/__init__.py", "scenes/color.py"):
        assert changed(shared) == every
    keys()
    code._shared.cache_clear()
    code._plugged.cache_clear()
