"""The reference cache: hits, what makes another entry, damage, more samples later, two who want the same."""

from __future__ import annotations

import dataclasses
import json
import logging
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.references import cache
from pipeline.references.cache import EXR, PROVENANCE, STATE, key_for, reference_for, to_info
from pipeline.store.sealed_folder import SEAL
from scenes.errors import PenumbraError
from scenes.images.exr import ExrImage, read_estimate_exr, read_exr, write_exr
from tests.kit.fake_batches import REQUEST, FakeBackend, ask, fake, small
from tests.kit.mitsuba_scenes import floor, scene

__all__ = ["fake"]


@pytest.mark.usefixtures("mitsuba")
def test_mitsuba_through_the_cache(tmp_path: Path):
    root = tmp_path / "references"
    first, again = (reference_for(small(), "mitsuba", REQUEST, root) for _ in range(2))
    assert (first.fresh, again.fresh) == (True, False)
    np.testing.assert_array_equal(first.image.mean, again.image.mean)
    exr = read_estimate_exr(again.path)
    np.testing.assert_array_equal(exr.mean, again.image.mean.astype(np.float32))
    np.testing.assert_array_equal(exr.variance, again.image.variance.astype(np.float32))
    np.testing.assert_array_equal(exr.count, np.full((5, 6), 8.0))
    named = {key: exr.metadata[key] for key in ("key", "backend", "spp", "batches", "seed")}
    assert named == {"key": again.key, "backend": "mitsuba", "spp": "8", "batches": "4", "seed": "3"}
    assert {"version", "seconds", "variant", "integrator", "seeds", "machine", "created"} <= set(exr.metadata)
    assert exr.metadata["scene"] == small().content_hash()
    assert json.loads(again.path.with_name(PROVENANCE).read_text()) == exr.metadata
    more = reference_for(small(), "mitsuba", dataclasses.replace(REQUEST, spp=40), root)
    whole = reference_for(small(), "mitsuba", dataclasses.replace(REQUEST, spp=40), tmp_path / "other")
    assert (more.kept, more.image.spp, whole.kept) == (8, 48, 0)
    assert not np.array_equal(more.image.mean, whole.image.mean), (
        "other batches: of 2 and 10 samples, not of 10"
    )
    error = np.sqrt(more.image.variance + whole.image.variance)
    assert np.all(np.abs(more.image.mean - whole.image.mean) < 8 * error + 1e-12)


def test_a_second_call_reads_what_the_first_wrote(fake: FakeBackend, tmp_path: Path):
    first, again = ask(tmp_path), ask(tmp_path)
    assert fake.renders == 1 and (first.fresh, again.fresh) == (True, False)
    assert (
        first.path == again.path
        and first.key == again.key
        and first.image.provenance == again.image.provenance
    )
    np.testing.assert_array_equal(first.image.mean, again.image.mean)  # to the last bit of float64
    np.testing.assert_array_equal(first.image.variance, again.image.variance)
    assert again.image.seconds == first.image.seconds and (again.image.spp, again.image.batches) == (8, 4)
    names = sorted(path.name for path in tmp_path.rglob("*") if path.name != f".{first.key}.lock")
    assert names == sorted([first.key, EXR, STATE, PROVENANCE, SEAL])


def test_whatever_the_image_depends_on_makes_another_entry(fake: FakeBackend, tmp_path: Path):
    keys = {ask(tmp_path).key, ask(tmp_path, small(albedo=0.500001)).key}
    keys.add(ask(tmp_path, request=dataclasses.replace(REQUEST, seed=4)).key)
    keys.add(ask(tmp_path, request=dataclasses.replace(REQUEST, quantity="ambient-occlusion")).key)
    fake.revision = "2"
    keys.add(ask(tmp_path).key)
    assert len(keys) == fake.renders == 5
    assert key_for(small().content_hash(), "other", "2", REQUEST) not in keys


def test_more_samples_are_added_and_fewer_are_served_by_what_is_there(fake: FakeBackend, tmp_path: Path):
    first = ask(tmp_path)
    more = ask(tmp_path, request=dataclasses.replace(REQUEST, spp=80))
    assert (more.key, more.fresh, more.kept) == (first.key, True, 8)
    assert (more.image.spp, more.image.batches) == (88, 8) and fake.drawn == [2] * 4 + [20] * 4
    again = ask(tmp_path)
    assert (again.fresh, again.kept, again.image.spp) == (False, 88, 88)
    np.testing.assert_array_equal(read_estimate_exr(again.path).count, np.full((5, 6), 88.0))


def test_a_target_is_gone_on_to(fake: FakeBackend, tmp_path: Path):
    """Samples of the fake are uniform on [0, 1]: relative standard errors of 0.58 / sqrt(spp)."""
    found = ask(tmp_path, request=dataclasses.replace(REQUEST, target=0.02))
    assert 500 < found.image.spp < 2500
    drawn = len(fake.drawn)
    assert not ask(tmp_path, request=dataclasses.replace(REQUEST, target=0.05)).fresh
    assert len(fake.drawn) == drawn


def test_a_name_makes_no_other_entry(fake: FakeBackend, tmp_path: Path):
    ask(tmp_path)
    ask(tmp_path, dataclasses.replace(small(), name="renamed", parameters=(("gap", 1.0),)))
    assert fake.renders == 1


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0x40
    path.write_bytes(content)


def change_values(path: Path) -> None:
    """A whole, readable file whose values are not what they were."""
    with np.load(path) as state:
        parts = dict(state)
    np.savez(path, **(parts | {"mean": parts["mean"] * 1.0001}))


def change(image: ExrImage) -> dict[str, Any]:
    return {"channels": image.channels | {"R": image.channels["R"] * 1.001}, "metadata": image.metadata}


DAMAGE: dict[str, tuple[str, Callable[[Path], object]]] = {
    "truncated state": (STATE, lambda path: path.write_bytes(path.read_bytes()[:-200])),
    "empty state": (STATE, lambda path: path.write_bytes(b"")),
    "flipped bit in the state": (STATE, flip),
    "other values in the state": (STATE, change_values),
    "no state": (STATE, Path.unlink),
    "truncated image": (EXR, lambda path: path.write_bytes(path.read_bytes()[:-200])),
    "other values in the image": (EXR, lambda path: write_exr(path, **change(read_exr(path)))),
    "text for an image": (EXR, lambda path: path.write_text("hello")),
    "no image": (EXR, Path.unlink),
    "other words in the provenance": (PROVENANCE, lambda path: path.write_text("{}")),
    "no provenance": (PROVENANCE, Path.unlink),
    "no seal": (SEAL, Path.unlink),
    "empty seal": (SEAL, lambda path: path.write_text("")),
    "truncated seal": (SEAL, lambda path: path.write_text(path.read_text().splitlines()[0] + "\n")),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_is_reported_and_mended(
    fake: FakeBackend, tmp_path: Path, caplog: pytest.LogCaptureFixture, kind: str
):
    name, damage = DAMAGE[kind]
    first = ask(tmp_path)
    damage(first.path.with_name(name))
    with caplog.at_level(logging.WARNING, "penumbra"):
        again = ask(tmp_path)
    assert fake.renders == 2 and again.fresh
    assert [record.levelname for record in caplog.records] == ["WARNING"] and first.key in caplog.text
    np.testing.assert_array_equal(first.image.mean, again.image.mean)  # the same batches, drawn again
    assert not ask(tmp_path).fresh and fake.renders == 2


def test_another_entrys_files_are_damage(fake: FakeBackend, tmp_path: Path, caplog: pytest.LogCaptureFixture):
    first = ask(tmp_path)
    other = ask(tmp_path, small(albedo=0.25))
    for name in (EXR, STATE, PROVENANCE, SEAL):
        first.path.with_name(name).write_bytes(other.path.with_name(name).read_bytes())
    assert ask(tmp_path).fresh and "another's" in caplog.text


def test_of_two_at_once_one_waits_and_both_get_the_same(fake: FakeBackend, tmp_path: Path):
    """The second asks while the first is in the middle of its work."""
    other: list[threading.Thread] = []
    got = []

    def begin() -> None:
        if not other:
            other.append(threading.Thread(target=lambda: got.append(ask(tmp_path))))
            other[0].start()
            other[0].join(0.2)
            assert other[0].is_alive()

    fake.during = begin
    got.append(ask(tmp_path))
    other[0].join(30)
    assert fake.renders == 1 and sorted(item.fresh for item in got) == [False, True]
    np.testing.assert_array_equal(got[0].image.mean, got[1].image.mean)


def test_what_is_there_is_served_from_a_folder_that_cannot_be_written(
    fake: FakeBackend, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    ask(tmp_path)

    def no_lock(*_: object) -> None:
        raise AssertionError("a lock is a file in the folder")

    monkeypatch.setattr(cache, "_locked", no_lock)
    assert not ask(tmp_path).fresh


def test_refusals_and_unwritable_folders_come_before_rendering(fake: FakeBackend, tmp_path: Path):
    tiny = scene([floor()], np.eye(4), 40.0, 1, 1)
    with pytest.raises(PenumbraError, match="no fake reference: it is too small; no other backend takes it"):
        ask(tmp_path, tiny)
    (tmp_path / "file").write_text("")
    with pytest.raises(PenumbraError, match="references cannot be written here"):
        ask(tmp_path / "file" / "references")
    assert fake.renders == 0


def test_what_a_record_says_of_it(fake: FakeBackend, tmp_path: Path):
    stored = ask(tmp_path / "references")
    info = to_info(stored, tmp_path)
    assert info.image == f"references/{stored.key}/{EXR}"
    assert (info.backend, info.key, info.spp, info.batches) == ("fake", stored.key, 8, 4)
    assert info.rms_standard_error == pytest.approx(np.sqrt(stored.image.variance.mean()))
