"""The reference cache: hits, what makes another entry, damage, interruption, two who want the same."""

from __future__ import annotations

import dataclasses
import logging
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.references import cache
from pipeline.references.cache import EXR, STATE, StoredReference, reference_for, reference_key, to_info
from pipeline.references.protocol import Progress, ReferenceImage, ReferenceRequest
from scenes.description import Diffuse, SceneDescription
from scenes.errors import PenumbraError
from scenes.images import ExrImage, read_estimate_exr, read_exr, write_exr
from tests.references.mitsuba_scenes import above, floor, rectangle, scene, shape, vector

REQUEST = ReferenceRequest(spp=8, batches=4, seed=3)


def small(albedo: float = 0.5) -> SceneDescription:
    light = shape(rectangle(vector(0, 2, 0), vector(1, 0, 0), vector(0, 0, 1)), 0.0, (1, 2, 3))
    ground = dataclasses.replace(floor(), material=Diffuse(np.full(3, albedo)))
    return scene([ground, light], *above(vector(0.1, 0, 0.2), 0.5), 6, 5)


class FakeBackend:
    """Counts its renders, each of which differs; `during` runs in the middle of one."""

    name = "fake"

    def __init__(self, during: Callable[[], None] = lambda: None) -> None:
        self.renders = 0
        self.revision = "1"
        self.during = during

    def version(self) -> str:
        return self.revision

    def refuses(self, scene: SceneDescription) -> str | None:
        return "it is too small" if scene.film.width < 2 else None

    def render(
        self, scene: SceneDescription, request: ReferenceRequest, progress: Progress | None = None
    ) -> ReferenceImage:
        self.renders += 1
        mean, variance = np.random.default_rng(self.renders).random((2, scene.film.height, scene.film.width, 3)) / 3
        self.during()
        return ReferenceImage(mean, variance, request.spp, request.batches, 0.1 + 0.2, {"note": "λ = 1"})


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeBackend:
    backend = FakeBackend()
    monkeypatch.setattr(cache, "BACKENDS", {"fake": backend})
    return backend


def ask(root: Path, given: SceneDescription | None = None, request: ReferenceRequest = REQUEST) -> StoredReference:
    return reference_for(given or small(), "fake", request, root)


def test_mitsuba_through_the_cache(tmp_path: Path):
    first = reference_for(small(), "mitsuba", REQUEST, tmp_path / "references")
    again = reference_for(small(), "mitsuba", REQUEST, tmp_path / "references")
    assert (first.fresh, again.fresh) == (True, False)
    np.testing.assert_array_equal(first.image.mean, again.image.mean)
    exr = read_estimate_exr(again.path)
    np.testing.assert_array_equal(exr.mean, again.image.mean.astype(np.float32))
    np.testing.assert_array_equal(exr.variance, again.image.variance.astype(np.float32))
    np.testing.assert_array_equal(exr.count, np.full((5, 6), 8.0))
    named = {key: exr.metadata[key] for key in ("key", "backend", "spp", "batches", "seed")}
    assert named == {"key": again.key, "backend": "mitsuba", "spp": "8", "batches": "4", "seed": "3"}
    assert {"version", "seconds", "variant", "integrator"} <= set(exr.metadata)


def test_a_second_call_reads_what_the_first_wrote(fake: FakeBackend, tmp_path: Path):
    first, again = ask(tmp_path), ask(tmp_path)
    assert fake.renders == 1 and (first.fresh, again.fresh) == (True, False)
    assert first.path == again.path and first.key == again.key and first.image.provenance == again.image.provenance
    np.testing.assert_array_equal(first.image.mean, again.image.mean)  # to the last bit of float64
    np.testing.assert_array_equal(first.image.variance, again.image.variance)
    assert again.image.seconds == 0.1 + 0.2 and (again.image.spp, again.image.batches) == (8, 4)
    assert sorted(path.name for path in tmp_path.rglob("*")) == sorted([first.key, EXR, STATE])


def test_whatever_the_image_depends_on_makes_another_entry(fake: FakeBackend, tmp_path: Path):
    keys = {ask(tmp_path).key, ask(tmp_path, small(albedo=0.500001)).key}
    for change in ({"spp": 16}, {"batches": 8}, {"seed": 4}):
        keys.add(ask(tmp_path, request=dataclasses.replace(REQUEST, **change)).key)
    fake.revision = "2"
    keys.add(ask(tmp_path).key)
    assert len(keys) == fake.renders == 6
    assert reference_key(small(), "other", "2", REQUEST) not in keys


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
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_is_reported_and_mended(fake: FakeBackend, tmp_path: Path, caplog: pytest.LogCaptureFixture, kind: str):
    name, damage = DAMAGE[kind]
    first = ask(tmp_path)
    damage(first.path.with_name(name))
    with caplog.at_level(logging.WARNING, "penumbra"):
        again = ask(tmp_path)
    assert fake.renders == 2 and again.fresh
    assert [record.levelname for record in caplog.records] == ["WARNING"] and first.key in caplog.text
    assert not np.array_equal(first.image.mean, again.image.mean)
    assert not ask(tmp_path).fresh and fake.renders == 2


def test_another_entrys_files_are_damage(fake: FakeBackend, tmp_path: Path, caplog: pytest.LogCaptureFixture):
    first = ask(tmp_path)
    other = ask(tmp_path, small(albedo=0.25))
    for name in (EXR, STATE):
        first.path.with_name(name).write_bytes(other.path.with_name(name).read_bytes())
    assert ask(tmp_path).fresh and "another's" in caplog.text


def test_an_interrupted_render_leaves_nothing(fake: FakeBackend, tmp_path: Path):
    def interrupt() -> None:
        raise KeyboardInterrupt

    fake.during = interrupt
    with pytest.raises(KeyboardInterrupt):
        ask(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_write_is_not_taken(fake: FakeBackend, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(cache, "_publish", killed)  # both files are there, under the temporary name
        patch.setattr(cache.shutil, "rmtree", lambda *_, **__: None)  # as after SIGKILL: nobody tidies up
        with pytest.raises(KeyboardInterrupt):
            ask(tmp_path)
    assert len(list(tmp_path.iterdir())) == 1
    assert ask(tmp_path).fresh and fake.renders == 2


def test_of_two_at_once_both_get_the_same(fake: FakeBackend, tmp_path: Path):
    """Two are made to render at the same time; the second to finish takes the first's entry for its own."""
    both = threading.Barrier(2, timeout=30)
    fake.during = both.wait  # pyright: ignore[reportAttributeAccessIssue]
    got: list[StoredReference] = []
    threads = [threading.Thread(target=lambda: got.append(ask(tmp_path))) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert fake.renders == 2 and len(got) == 2
    np.testing.assert_array_equal(got[0].image.mean, got[1].image.mean)
    assert [path.name for path in tmp_path.iterdir()] == [got[0].key]


def test_refusals_and_unwritable_folders_come_before_rendering(fake: FakeBackend, tmp_path: Path):
    tiny = scene([floor()], np.eye(4), 40.0, 1, 1)
    with pytest.raises(PenumbraError, match="no fake reference: it is too small"):
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
