"""The fingerprint changes with every source and every library that an image's bits depend on."""

from __future__ import annotations

from importlib import metadata

from renderer.fingerprint import fingerprint, fingerprint_of


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
