"""The rasterised baseline against closed forms: what is drawn is exactly what its lights without size send.

One picture has a light to each colour channel, so that a channel that is wrong names its light. The
thresholds are for float32: no sum here has more than some tens of roundings of 6e-8, and none of these biases
is below 1e-3.
"""

from __future__ import annotations

import os
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pipeline.baseline import process
from pipeline.baseline.process import Raster, rasterise
from pipeline.baseline.scene import refuses
from renderer import render
from scenes import PenumbraError, SceneDescription, load
from scenes.description.lights import DistantLight, Environment, Light, PointLight, SpotLight
from scenes.description.materials import Conductor, Diffuse
from scenes.description.scene import Film, PerspectiveCamera
from scenes.description.shapes import Array, BilinearMesh, Disk, Emission, ShapeDescription, Sphere

pytestmark = pytest.mark.usefixtures("opengl")

ALBEDO = np.array([0.9, 0.5, 0.2])
BLACK = Diffuse(np.zeros(3))
RED, GREEN, BLUE = np.eye(3)
ROUNDING = 1e-5
PATCH = np.array([[-60.0, 0, -60], [60, 0, -60], [-60, 0, 60], [60, 0, 60]])
LOOK = np.array([[0.8, 0.36, 0.48, -2.0], [0.0, 0.8, -0.6, 4.0], [-0.6, 0.48, 0.64, -3.0], [0, 0, 0, 1.0]])
FLOOR = ShapeDescription(BilinearMesh(PATCH, np.array([[0, 1, 2, 3]])), Diffuse(ALBEDO))

PLACE, HIGH, WI = np.array([1.0, 2.5, -0.5]), np.array([0.0, 6.0, 0.0]), np.array([0.6, 0.64, -0.48])
CENTER, MIDDLE, NORMAL = np.array([2.0, 5.0, 1.0]), np.array([-1.0, 6.0, 0.0]), np.array([0.28, -0.96, 0.0])
DOWN = np.array([0.0, -1.0, 0.0])
LARGE, SHIFT = 1e6, np.array([3e6, -2e6, 5e6])


def _scene(*shapes: ShapeDescription, lights: tuple[Light, ...] = ()) -> SceneDescription:
    """Shapes seen aslant and off centre."""
    return SceneDescription("floor", PerspectiveCamera(LOOK, 30.0), Film(40, 24), shapes, lights)


def _lamp(side: float, two_sided: bool = False) -> ShapeDescription:
    """A disk ahead of the camera that turns its emitting side to it, or its back."""
    ahead = LOOK[:3, 2] * 2 + LOOK[:3, 3]
    return ShapeDescription(
        Disk(ahead, -side * LOOK[:3, 2], 0.2), BLACK, Emission(np.full(3, 1e6), two_sided)
    )


def _enlarged(scene: SceneDescription) -> SceneDescription:
    """The point-lit floor a million times as large and far from the origin, its light's power scaled by the
    square.
    """
    camera = LOOK.copy()
    camera[:3, 3] = LOOK[:3, 3] * LARGE + SHIFT
    floor = replace(FLOOR, geometry=BilinearMesh(PATCH * LARGE + SHIFT, np.array([[0, 1, 2, 3]])))
    lights = (PointLight(PLACE * LARGE + SHIFT, 7 * LARGE**2 * np.ones(3)),)
    return replace(
        scene, camera=replace(scene.camera, camera_to_world=camera), shapes=(floor,), lights=lights
    )


def _scenes() -> dict[str, SceneDescription]:
    points = (
        PointLight(PLACE, 7 * RED),
        SpotLight(HIGH, DOWN, 90 * GREEN, 80.0, 1.0),
        DistantLight(WI, 3 * BLUE),
    )
    sized = (
        ShapeDescription(Sphere(CENTER, 0.3), BLACK, Emission(11 * RED)),
        ShapeDescription(Disk(MIDDLE, NORMAL, 0.7), BLACK, Emission(13 * GREEN)),
    )
    white = _scene(FLOOR, lights=(PointLight(PLACE, 7 * np.ones(3)),))
    metal = replace(FLOOR, material=Conductor(np.full(3, 0.2), np.full(3, 3.0), 0.1))
    sky = (Environment(np.array([0.1, 0.2, 0.3])),)
    return {
        "points": _scene(FLOOR, lights=points),
        "sized": _scene(FLOOR, *sized, lights=(Environment(0.25 * BLUE),)),
        "front": _scene(_lamp(1.0), lights=sky),
        "back": _scene(_lamp(-1.0), lights=sky),
        "both": _scene(_lamp(-1.0, two_sided=True), lights=sky),
        "metal": replace(white, shapes=(metal,)),
        "white": white,
        "large": _enlarged(white),
        "library": load("sphere-light", {"xresolution": 64.0, "yresolution": 48.0}),
    }


@cache
def _drawn() -> dict[str, Raster]:
    """All pictures of this file, drawn by one process."""
    scenes = _scenes()
    return dict(zip(scenes, rasterise([*scenes.values()]), strict=True))


def _points(scene: SceneDescription) -> Array:
    """(h, w, 3) points of the plane y = 0 in the middles of pixels."""
    w, h = scene.film.width, scene.film.height
    half = np.tan(np.radians(scene.camera.fov) / 2) / min(w, h)
    x, y = np.meshgrid((2 * np.arange(w) + 1 - w) * half, (h - 1 - 2 * np.arange(h)) * half)
    d = np.stack([x, y, np.ones_like(x)], axis=-1) @ LOOK[:3, :3].T
    return LOOK[:3, 3] + d * (-LOOK[1, 3] / d[..., 1:2])


def _from(place: Array, p: Array) -> tuple[Array, Array, Array]:
    """Unit vectors to a place, squared distances, cosines on the floor."""
    to = place - p
    square = np.sum(to * to, axis=-1)
    wi = to / np.sqrt(square)[..., None]
    return wi, square, np.maximum(wi[..., 1], 0.0)


def _compare(image: Array, expected: Array) -> None:
    assert expected.min() > 0
    worst = np.abs(image / expected - 1).max(axis=(0, 1))
    print(f"largest relative errors by channel: {worst}")
    assert (worst < ROUNDING).all(), worst


def test_points_spots_and_distant_lights() -> None:
    """Red a point, green a spot in whose falloff the whole picture lies, blue a distant light: albedo / pi
    times each irradiance.
    """
    p = _points(_scenes()["points"])
    _, square, cosine = _from(PLACE, p)
    spot, spot_square, spot_cosine = _from(HIGH, p)
    low, high = np.cos(np.radians([80.0, 1.0]))
    t = np.clip((-(spot @ DOWN) - low) / (high - low), 0, 1)
    green = 90 * t * t * (3 - 2 * t) * spot_cosine / spot_square
    irradiance = np.stack([7 * cosine / square, green, np.full_like(t, 3 * WI[1])], axis=-1)
    _compare(_drawn()["points"].image, ALBEDO / np.pi * irradiance)


def test_lights_with_a_size_and_environments() -> None:
    """Red a sphere, green a tilted disk as a point that falls off with the cosine, blue a constant
    environment.
    """
    p = _points(_scenes()["sized"])
    _, square, cosine = _from(CENTER, p)
    wi, far, lambert = _from(MIDDLE, p)
    area = 0.7**2 * 512 / 2 * np.sin(2 * np.pi / 512)  # of the polygon that stands for the disk
    red = 11 * np.pi * 0.3**2 * cosine / square
    green = 13 * area * np.maximum(-(wi @ NORMAL), 0) * lambert / far
    irradiance = np.stack([red, green, np.full_like(far, 0.25 * np.pi)], axis=-1)
    _compare(_drawn()["sized"].image, ALBEDO / np.pi * irradiance)


def test_what_is_seen_directly() -> None:
    """A light shows its radiance on its emitting side alone, however bright; where nothing is, the
    environment shows.
    """
    images = [_drawn()[name].image for name in ("front", "back", "both")]
    assert np.allclose([image[11, 19] for image in images], [[1e6] * 3, [0.0] * 3, [1e6] * 3], rtol=ROUNDING)
    assert np.allclose([image[0, 0] for image in images], [0.1, 0.2, 0.3], rtol=ROUNDING)


def test_metal_stays_finite_and_is_no_diffuse_surface() -> None:
    """A rough metal mirrors a point light about the mirror direction, and is dark far from it."""
    image = _drawn()["metal"].image
    assert np.isfinite(image).all()
    assert image.max() > 20 * np.median(image)


def test_scale_and_place_change_nothing() -> None:
    one, other = _drawn()["white"], _drawn()["large"]
    assert np.allclose(one.image, other.image, rtol=ROUNDING)
    assert np.allclose(one.depth, other.depth / LARGE, rtol=ROUNDING)


def test_library_scene_is_near_what_its_light_sends() -> None:
    """A sphere is a point exactly but for shadows: most of the picture agrees with a render's image to a
    hundredth.
    """
    ours = render(_scenes()["library"], estimator="solid-angle", spp=64).image
    off = np.abs(_drawn()["library"].image / np.where(ours > 0, ours, np.inf) - 1).max(axis=-1)
    print(f"median {np.median(off):.4f}, {100 * (off < 0.02).mean():.1f} % within 2 %")
    assert np.median(off) < 0.01


def test_refusals_say_why() -> None:
    many = _scene(FLOOR, lights=tuple(PointLight(np.ones(3), np.ones(3)) for _ in range(97)))
    assert "97 lights" in str(refuses(many))
    sheared = LOOK.copy()
    sheared[:3, 0] += 0.5 * sheared[:3, 1]
    wrong = replace(_scene(FLOOR), camera=PerspectiveCamera(sheared, 40.0))
    with pytest.raises(PenumbraError, match="shear"):
        rasterise([wrong])


def test_a_machine_without_opengl_is_told_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The platforms' own words, and what to install; no traceback."""
    (tmp_path / "OpenGL").mkdir()
    (tmp_path / "OpenGL" / "__init__.py").write_text("raise ImportError('no OpenGL on this machine')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(
        process, "worker_environment", lambda **_: os.environ | {"PYTHONPATH": f"{tmp_path}:{Path.cwd()}"}
    )
    with pytest.raises(PenumbraError, match=r"no OpenGL on this machine.*apt install libegl1") as caught:
        rasterise([_scene(FLOOR)])
    assert "\n" not in str(caught.value)
