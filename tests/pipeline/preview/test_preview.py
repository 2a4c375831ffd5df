"""The preview: what it says of an estimator's samples is true, and its picture shows it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scenes
from pipeline.cli import main
from pipeline.preview import drawing as preview
from pipeline.preview.samples import HIDDEN, IDLE, OPEN_WORDS, SEEN, Tried, try_pixel
from pipeline.preview.view import extent_of, look
from renderer import RenderScene, build, render
from renderer.math.vectors import Floats
from scenes.errors import PenumbraError
from scenes.images.exr import read_texture
from tests.kit.library import library_cases

SMALL = {"xresolution": 64, "yresolution": 48}
PENUMBRA_PIXEL, SKY_PIXEL = (30, 36), (32, 30)


def tried(scene: RenderScene, estimator: str, pixel: tuple[int, int], spp: int = 64) -> Tried:
    return try_pixel(scene, estimator, pixel, spp, 0, 5.0, "independent")


@pytest.fixture(scope="module")
def soft() -> RenderScene:
    return build(scenes.load("soft-shadow", SMALL))


def blocked(scene: RenderScene, start: Floats, end: Floats) -> np.ndarray:
    """(n,): whether a straight line between two points, (n, 3) each, meets a triangle or a ball, its ends
    left out.
    """
    way = (end - start).T
    length = np.sqrt((way * way).sum(axis=0))
    d = way / length
    out = np.zeros(length.size, dtype=np.bool_)
    for i in range(length.size):
        o = start[i][:, None] + d[:, i : i + 1] * 1e-4
        t = np.inf if scene.triangles is None else scene.triangles.closest(o, d[:, i : i + 1])[0][0]
        t = min(t, scene.analytic.closest(np.arange(len(scene.analytic)), o, d[:, i : i + 1])[0][0])
        out[i] = t < length[i] - 2e-4
    return out


@pytest.mark.parametrize("estimator", ["area", "solid-angle", "projected-solid-angle", "analytic-visibility"])
def test_a_light_sampler_s_rays_run_to_the_light_or_to_what_hides_it(
    soft: RenderScene, estimator: str
) -> None:
    """Each that arrives ends on the light with nothing in between; each that is hidden ends on something
    before it.
    """
    found = tried(soft, estimator, PENUMBRA_PIXEL)
    assert len(found.state) == 64 and found.count(IDLE) == 0
    assert found.count(SEEN) > 4 and found.count(HIDDEN) > 4
    (light,) = [shape.geometry for shape in soft.description.shapes if shape.emission]
    corner, _, _, opposite = light.vertices
    normal = np.cross(light.vertices[1] - corner, opposite - corner)
    seen, hidden = found.state == SEEN, found.state == HIDDEN
    np.testing.assert_allclose((found.end[seen] - corner) @ (normal / np.linalg.norm(normal)), 0, atol=1e-9)
    assert not blocked(soft, found.start[seen], found.end[seen]).any()
    assert (
        (found.end[hidden] - corner) @ normal * np.sign((found.start[hidden][0] - corner) @ normal) > 1e-6
    ).all()


def test_the_share_that_arrives_is_the_pixel_s_visibility(soft: RenderScene) -> None:
    """Solid-angle samples are nearly of one weight: their share, of 4,096, is the pixel over the unshadowed
    closed form, to 5 %.
    """
    found = tried(soft, "solid-angle", PENUMBRA_PIXEL, 4096)
    share = found.count(SEEN) / len(found.state)
    images = [render(soft, estimator=name, spp=256).image for name in ("solid-angle", "analytic-visibility")]
    assert 0.05 < share < 0.95
    bare = build(_without_objects())
    full = render(bare, estimator="solid-angle", spp=256).image[PENUMBRA_PIXEL[::-1]]
    for image in images:
        assert np.abs(image[PENUMBRA_PIXEL[::-1]] / full - share).max() < 0.05


def _without_objects() -> scenes.SceneDescription:
    scene = scenes.load("soft-shadow", SMALL)
    return scenes.SceneDescription("bare", scene.camera, scene.film, scene.shapes[:3])


def test_mis_shows_both_its_techniques(soft: RenderScene) -> None:
    assert len(tried(soft, "mis", PENUMBRA_PIXEL).state) == 128
    assert len(tried(soft, "cosine", PENUMBRA_PIXEL).state) == 64
    assert tried(soft, "hemisphere", PENUMBRA_PIXEL).count(IDLE) > 40  # a small light is seldom met


def test_ambient_occlusion_and_the_sky_have_no_ends() -> None:
    scene = build(scenes.load("sky", SMALL))
    open_ = tried(scene, "ambient-occlusion", SKY_PIXEL)
    assert open_.words == OPEN_WORDS
    assert open_.count(SEEN) + open_.count(HIDDEN) == 64
    assert open_.far.all() and np.isfinite(open_.end).all()
    assert tried(scene, "mis", SKY_PIXEL).far.any()


def test_watching_changes_nothing(soft: RenderScene) -> None:
    """The renders of the estimator before and after are the same bit for bit: no witness stays behind."""
    before = render(soft, estimator="mis", spp=2).image
    tried(soft, "mis", PENUMBRA_PIXEL)
    np.testing.assert_array_equal(before, render(soft, estimator="mis", spp=2).image)


@pytest.mark.parametrize("pixel", [(-1, 0), (64, 0), (0, 48)])
def test_a_pixel_outside_is_refused(soft: RenderScene, pixel: tuple[int, int]) -> None:
    with pytest.raises(PenumbraError, match="is not in the image of 64 x 48 pixels"):
        tried(soft, "area", pixel)


@pytest.mark.parametrize("name", library_cases())
def test_the_view_holds_the_camera_and_what_it_sees(name: str) -> None:
    """For each scene: everything labelled, and the camera's screen, fall inside the picture."""
    scene = build(scenes.load(name, SMALL))
    estimator = scene.description.defaults.estimator or "mis"
    samples = tried(scene, estimator, (32, 30), 4)
    view = look(scene, (32, 30), samples, estimator)
    low, high = extent_of(scene)
    assert view.extent == pytest.approx(float(np.linalg.norm(high - low)))
    forward = (view.target - view.position) / np.linalg.norm(view.target - view.position)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    points = (
        np.concatenate([view.screen.reshape(-1, 3), np.stack([place for place, _ in view.labels])])
        - view.position
    )
    depth = points @ forward
    half = np.tan(np.radians(view.angle / 2))
    assert depth.min() > 0
    assert np.abs(points @ np.cross(forward, right) / depth).max() < half
    assert np.abs(points @ right / depth).max() < half * preview.SIZE[0] / preview.SIZE[1]
    assert view.image.shape == (48, 64, 3)


def command(*words: str) -> int:
    try:
        main(["preview", *words, "--quiet"])
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


def test_errors_are_one_line_and_exit_with_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = str(tmp_path / "p.png")
    for words, told in [
        (("soft-shadow", "-o", str(tmp_path / "p.exr")), "a preview is a .png"),
        (("soft-shadow", "-o", target, "--pixel", "3"), "--pixel 3: write it as x,y"),
        (("soft-shadow", "-o", str(tmp_path / "gone" / "p.png")), "there is no folder"),
    ]:
        assert command(*words) == 2
        error = capsys.readouterr().err
        assert told in error and error.count("\n") == 1


@pytest.mark.usefixtures("opengl")
def test_where_nothing_can_be_drawn_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """VTK ends a process that has no OpenGL; the trial's process is the one that ends."""
    monkeypatch.setattr(preview, "TRIAL", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    assert command("soft-shadow", "-o", str(tmp_path / "p.png")) == 2
    error = capsys.readouterr().err
    assert "no picture can be drawn off screen here: vtkEGLRenderWindow: OpenGL does not start" in error
    assert "apt install libegl1" in error and not list(tmp_path.iterdir())


@pytest.mark.usefixtures("opengl")
def test_a_preview_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All that the legend names is there in its colour."""
    target = tmp_path / "p.png"
    assert (
        command(
            "soft-shadow",
            "-o",
            str(target),
            "--pixel",
            "30,36",
            "-D",
            "xresolution=64",
            "-D",
            "yresolution=48",
        )
        == 0
    )
    image = (255 * read_texture(target, "linear")).round()
    assert image.shape == (*preview.SIZE[::-1], 3)
    for colour in preview.COLOURS.values():
        wanted = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
        assert np.count_nonzero(np.abs(image[:700] - wanted).max(axis=-1) < 12) > 15, (
            colour
        )  # above the legend
    assert "samples" in capsys.readouterr().out
