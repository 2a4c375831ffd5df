"""The pbrt backend with a stand-in for the binary: what it is given, what is made of its images, and every
way of failing.
"""

from __future__ import annotations

import dataclasses
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import scenes
from pipeline.references.backends.closed_form import ClosedFormBackend
from pipeline.references.backends.pbrt import PbrtBackend, batch_seed, exported
from pipeline.references.pbrt.channels import gray_scenes
from pipeline.references.protocol import ReferenceRequest
from pipeline.statistics.welch import Moments, compare_images
from scenes.description.lights import Environment
from scenes.description.materials import Diffuse
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Array, ShapeDescription
from scenes.description.textures import ImageTexture
from scenes.errors import PenumbraError
from scenes.images.exr import read_rgb, write_exr
from scenes.pbrt.parser import parse
from tests.kit.fake_batches import small
from tests.kit.mitsuba_scenes import floor, scene
from tests.kit.pbrt_images import NO_PBRT, PBRT

# Takes pbrt's options, notes how it was called, and copies the image prepared for that pass and that call of
# it.
FAKE = """#!{python} -IS
import json, pathlib, shutil, sys, time
here, work = pathlib.Path({home!r}), pathlib.Path.cwd()
quiet, *rest, name = sys.argv[1:]
options = dict(zip(rest[::2], rest[1::2]))
log = here / "calls.jsonl"
calls = log.read_text().splitlines() if log.exists() else []
number = sum(json.loads(call)["pass"] == work.name for call in calls)
text = (work / name).read_text()
called = dict(options, quiet=quiet, text=text)
called["pass"] = work.name
log.write_text("".join(line + "\\n" for line in [*calls, json.dumps(called)]))
{then}
"""
COPY = "shutil.copy(here / f'{work.name}-{number % 2}.exr', options['--outfile'])"


class FakePbrt:
    """A folder with a script that stands for pbrt, and the images that it will give."""

    def __init__(self, home: Path) -> None:
        self.home, self.binary = home, home / "pbrt"

    def does(self, then: str) -> None:
        """What it does once it has read its options."""
        self.binary.write_text(FAKE.format(python=sys.executable, home=str(self.home), then=then))
        self.binary.chmod(0o755)

    def gives(self, channel: int, call: int, plane: Array) -> None:
        """A gray image (h, w) for a pass, at its even or odd calls."""
        write_exr(self.home / f"{channel}-{call}.exr", dict.fromkeys("RGB", plane))

    @property
    def calls(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in (self.home / "calls.jsonl").read_text().splitlines()]


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakePbrt:
    """Named in PENUMBRA_PBRT; gives black images."""
    made = FakePbrt(tmp_path)
    made.does(COPY)
    for channel in range(3):
        for call in range(2):
            made.gives(channel, call, np.zeros((5, 6)))
    monkeypatch.setenv("PENUMBRA_PBRT", str(made.binary))
    return made


def gray() -> SceneDescription:
    light = small().shapes[1]
    assert light.emission is not None
    emission = dataclasses.replace(light.emission, radiance=np.ones(3))
    return dataclasses.replace(
        small(), shapes=(small().shapes[0], dataclasses.replace(light, emission=emission))
    )


@pytest.mark.usefixtures("processes")
def test_a_gray_scene_takes_one_pass_a_batch_each_with_its_own_seed(fake: FakePbrt):
    fake.gives(0, 0, np.full((5, 6), 1.0))
    fake.gives(0, 1, np.full((5, 6), 3.0))
    image = PbrtBackend().render(gray(), ReferenceRequest(100, 4, 9))
    np.testing.assert_array_equal(image.mean, np.full((5, 6, 3), 2.0))
    np.testing.assert_allclose(image.variance, np.full((5, 6, 3), 4 / 3 / 4))  # of 1 3 1 3, over 4
    assert (image.spp, image.batches) == (100, 4)
    assert [call["--spp"] for call in fake.calls] == ["25"] * 4
    assert [int(call["--seed"]) for call in fake.calls] == [batch_seed(9, k, 0) for k in range(4)]
    assert len({call["--seed"] for call in fake.calls}) == 4
    assert all(call["quiet"] == "--quiet" for call in fake.calls)


@pytest.mark.usefixtures("processes")
def test_the_file_names_no_seed_and_reads_back_as_the_scene(fake: FakePbrt):
    """pbrt ignores --seed where the file gives one, and every batch would be the same."""
    given = dataclasses.replace(
        gray(), defaults=dataclasses.replace(gray().defaults, sampler="sobol", seed=7, spp=3)
    )
    PbrtBackend().render(given, ReferenceRequest(2, 2))
    text = fake.calls[0]["text"]
    assert "seed" not in text and text.count('Sampler "independent"') == 1
    assert '"path" "integer maxdepth" [ 1 ]' in text
    back = parse(text)
    np.testing.assert_allclose(back.camera.camera_to_world, given.camera.camera_to_world, atol=1e-15)
    assert dataclasses.replace(back, camera=given.camera).content_hash() == given.content_hash()


@pytest.mark.usefixtures("processes")
def test_a_scene_in_colour_takes_a_gray_pass_for_each_channel(fake: FakePbrt):
    for channel in range(3):
        for call in range(2):
            fake.gives(channel, call, np.full((5, 6), 1.0 + channel))
    given = dataclasses.replace(small(), shapes=(red_floor(), small().shapes[1]))
    image = PbrtBackend().render(given, ReferenceRequest(4, 2))
    np.testing.assert_array_equal(image.mean, np.broadcast_to([1.0, 2.0, 3.0], (5, 6, 3)))
    assert [call["pass"] for call in fake.calls] == ["0", "1", "2"] * 2
    assert len({call["--seed"] for call in fake.calls}) == 6, "channels are independent"
    ground, light = parse(fake.calls[2]["text"]).shapes
    assert isinstance(ground.material, Diffuse) and light.emission is not None
    np.testing.assert_array_equal(ground.material.reflectance, [0.1] * 3)
    np.testing.assert_array_equal(light.emission.radiance, [3.0] * 3)


def red_floor() -> ShapeDescription:
    return dataclasses.replace(floor(), material=Diffuse(np.array([0.8, 0.3, 0.1])))


def test_every_colour_of_a_scene_is_split():
    """Textures and skies too; a gray one is left alone."""
    image = np.random.default_rng(1).random((2, 2, 3))
    lights = (Environment(np.array([1.0, 2.0, 3.0]), image),)
    ground = dataclasses.replace(floor(), material=Diffuse(ImageTexture(image)))
    parts = gray_scenes(dataclasses.replace(small(), shapes=(ground, small().shapes[1]), lights=lights))
    for c, part in enumerate(parts):
        (sky,), material = part.lights, part.shapes[0].material
        assert isinstance(sky, Environment) and sky.image is not None and isinstance(material, Diffuse)
        assert isinstance(material.reflectance, ImageTexture)
        for plane in (sky.image, material.reflectance.image):
            np.testing.assert_array_equal(plane, image[..., c : c + 1].repeat(3, axis=-1))
        np.testing.assert_array_equal(sky.radiance, [1.0 + c] * 3)
    assert len(gray_scenes(gray())) == 1


@NO_PBRT
@pytest.mark.usefixtures("processes")
def test_pbrts_own_images_through_the_backend_agree_with_the_closed_form(tmp_path: Path, fake: FakePbrt):
    """What pbrt made of touching-light, two seeds, as two batches: orientation, variance and provenance are
    in order.
    """
    given = scenes.load(str(PBRT / "touching-light.pbrt"))
    for call, which in enumerate("ab"):
        fake.gives(0, call, read_rgb(PBRT / f"touching-light.{which}.exr").mean(axis=-1))
    image = PbrtBackend().render(given, ReferenceRequest(4096, 2))
    exact = ClosedFormBackend().render(given, ReferenceRequest())
    truth = Moments(exact.mean, exact.variance, np.inf)
    for result in compare_images(truth, Moments(image.mean, image.variance, 1), regions=(8, 8), alpha=1e-3):
        print(result)
        assert not result.reject
    mirrored = Moments(np.ascontiguousarray(image.mean[:, ::-1]), image.variance, 1)
    assert any(result.reject for result in compare_images(truth, mirrored, regions=(8, 8), alpha=1e-3))
    assert image.provenance["binary"] == str(fake.binary) and "gray" in image.provenance["colour"]


@pytest.mark.usefixtures("processes")
def test_ambient_occlusion_is_asked_of_the_bare_scene(fake: FakePbrt):
    fake.gives(0, 0, np.full((5, 6), 0.75))
    near = dataclasses.replace(small(), occlusion_distance=1.5)
    image = PbrtBackend().render(near, ReferenceRequest(2, 2, quantity="ambient-occlusion"))
    assert image.mean.max() == 0.375
    assert 'Integrator "ambientocclusion" "float maxdistance" [ 1.5 ]' in fake.calls[0]["text"]
    assert "AreaLightSource" not in fake.calls[0]["text"]
    assert "maxdistance" not in exported(small(), "ambient-occlusion").text


FAILURES: dict[str, tuple[str, str]] = {
    "exit code": (("print('Error: bad scene', file=sys.stderr); "
"sys.exit(3)"), "failed with code 3: Error: bad scene$"),
    "crash": ("import os; os.abort()", "failed with code -6; it said nothing$"),
    "no image": ("print('rendered')", "ended well and wrote no image: rendered$"),
    "text for an image": ("pathlib.Path(options['--outfile']).write_text('hello')", ("image cannot be read: "
"not a readable")),
    "another size": (("shutil.copy(here / 'wide.exr', "
"options['--outfile'])"), "image is 7 x 5 pixels, not 6 x 5"),
    "NaN": ("shutil.copy(here / 'nan.exr', options['--outfile'])", "90 non-finite values"),
}  # fmt: skip


@pytest.mark.parametrize("kind", FAILURES)
@pytest.mark.usefixtures("processes")
def test_failures_are_one_clear_error(fake: FakePbrt, kind: str):
    then, message = FAILURES[kind]
    write_exr(fake.home / "wide.exr", dict.fromkeys("RGB", np.zeros((5, 7))))
    write_exr(fake.home / "nan.exr", dict.fromkeys("RGB", np.full((5, 6), np.nan)))
    fake.does(then)
    with pytest.raises(PenumbraError, match=message) as caught:
        PbrtBackend().render(gray(), ReferenceRequest(2, 2))
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("processes")
def test_a_pbrt_that_hangs_is_stopped(fake: FakePbrt):
    fake.does("print('working', flush=True); time.sleep(60)")
    start = time.monotonic()
    with pytest.raises(PenumbraError, match=r"gave no image in 1 s and was stopped: working$"):
        PbrtBackend(timeout=1.0).render(gray(), ReferenceRequest(2, 2))
    assert time.monotonic() - start < 20


def _missing(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PENUMBRA_PBRT", str(home / "nowhere"))


def _not_executable(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (home / "plain").write_text("")
    monkeypatch.setenv("PENUMBRA_PBRT", str(home / "plain"))


def _not_on_path(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PENUMBRA_PBRT", raising=False)
    monkeypatch.setenv("PATH", str(home))


ABSENT: dict[str, Callable[[Path, pytest.MonkeyPatch], None]] = {
    "nowhere, and there is no such file": _missing,
    "plain, which is not executable": _not_executable,
    "there is no pbrt on PATH; put pbrt-v4 there or name its binary in PENUMBRA_PBRT": _not_on_path,
}


@pytest.mark.parametrize("message", ABSENT)
def test_a_pbrt_that_is_not_there_is_a_refusal(message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    ABSENT[message](tmp_path, monkeypatch)
    assert message in str(PbrtBackend().refuses(gray()))
    with pytest.raises(PenumbraError, match=message):
        PbrtBackend().version()
    with pytest.raises(PenumbraError, match=rf"scene by hand: .*{message}"):
        PbrtBackend().render(gray(), ReferenceRequest(2, 2))


@pytest.mark.usefixtures("processes")
def test_a_file_that_is_no_program_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "pbrt").write_bytes(b"\0not a program")
    (tmp_path / "pbrt").chmod(0o755)
    monkeypatch.setenv("PENUMBRA_PBRT", str(tmp_path / "pbrt"))
    with pytest.raises(PenumbraError, match=r"pbrt cannot be run: Exec format error"):
        PbrtBackend().render(gray(), ReferenceRequest(2, 2))


def test_it_is_found_on_the_path_and_its_version_is_its_content(
    fake: FakePbrt, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.delenv("PENUMBRA_PBRT")
    monkeypatch.setenv("PATH", str(fake.home))
    assert PbrtBackend().refuses(gray()) is None
    before = PbrtBackend().version()
    fake.does("pass")
    assert PbrtBackend().version() != before


def test_what_pbrt_has_not_is_refused(fake: FakePbrt):
    assert "no lights" in str(PbrtBackend().refuses(scene([floor()], np.eye(4), 40.0)))
    half = dataclasses.replace(small(), lights=(Environment(np.ones(3), hemisphere=True),))
    assert "no such light" in str(PbrtBackend().refuses(half))
    assert PbrtBackend().refuses(scene([floor()], np.eye(4), 40.0), "ambient-occlusion") is None
