"""The fingerprint changes with every source and every library that an image's bits depend on."""

from __future__ import annotations

from renderer.fingerprint import fingerprint, fingerprint_of


def test_any_edit_and_any_upgrade_gives_another_fingerprint(tmp_path):
    for folder in ("renderer/lights", "scenes"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "a.py").write_text("x = 1\n")
    seen = {fingerprint_of(tmp_path, {"numpy": "1"}), fingerprint_of(tmp_path, {"numpy": "2"})}
    for edited in ("renderer/lights/a.py", "scenes/a.py"):
        (tmp_path / edited).write_text("x = 2\n")
        seen.add(fingerprint_of(tmp_path, {"numpy": "1"}))
    (tmp_path / "scenes" / "b.py").write_text("x = 2\n")
    seen.add(fingerprint_of(tmp_path, {"numpy": "1"}))
    assert len(seen) == 5
    (tmp_path / "notes.txt").write_text("no source")
    assert fingerprint_of(tmp_path, {"numpy": "1"}) in seen
    assert len(fingerprint()) == 64
