"""The scenes that pbrt-v4 rendered: they parse as they stand, and their lights appear just where pbrt saw
them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.description.lights import DistantLight, Environment
from scenes.description.scene import SceneDescription
from scenes.description.shapes import BilinearMesh, Disk, Sphere
from scenes.images.exr import read_rgb
from scenes.pbrt.parser import parse, parse_file
from scenes.pbrt.write.scene import to_pbrt
from tests.kit.scene_texts import face_normals

FOLDER = Path(__file__).parents[4] / "shared" / "references"
pytestmark = pytest.mark.skipif(
    not FOLDER.is_dir(), reason="pbrt's reference images are not beside this checkout"
)


@pytest.mark.parametrize("name", ["rect-over-floor", "disk-over-floor", "sphere-light", "touching-light"])
def test_they_parse_as_they_stand(name: str) -> None:
    scene = parse_file(FOLDER / f"{name}.pbrt")
    assert scene.name == name
    assert (scene.film.width, scene.film.height, scene.film.filename) == (160, 120, f"{name}.exr")
    assert scene.defaults.spp == 2048
    assert scene.camera.fov == 40
    assert len(scene.shapes) == (2 if name == "touching-light" else 4)
    assert parse(to_pbrt(scene)).content_hash() == scene.content_hash()


def test_their_lights_face_where_pbrt_s_do() -> None:
    lights = {}
    for name in ("rect-over-floor", "disk-over-floor", "touching-light"):
        lights[name] = parse_file(FOLDER / f"{name}.pbrt").shapes[-1].geometry
    rectangle, disk, upright = lights.values()
    assert isinstance(rectangle, BilinearMesh)
    assert isinstance(disk, Disk)
    assert isinstance(upright, BilinearMesh)
    assert face_normals(rectangle.vertices, rectangle.faces, rectangle.reverse).tolist() == [[0, -1, 0]]
    assert face_normals(upright.vertices, upright.faces, upright.reverse).tolist() == [[0, 0, 1]]
    assert disk.normal.tolist() == [0, -1, 0]
    assert disk.center.tolist() == [-0.2, 3, 0.5]


def test_the_scenes_with_lights_that_are_no_shapes() -> None:
    scene = parse_file(FOLDER / "sky-and-sun.pbrt")
    sky, sun = scene.lights
    assert isinstance(sky, Environment)
    assert isinstance(sun, DistantLight)
    assert (sky.radiance.tolist(), sky.image, sky.hemisphere) == ([0.9, 0.75, 0.25], None, False)
    assert sun.irradiance.tolist() == [1.6, 0.9, 0.3]
    np.testing.assert_allclose(sun.wi, np.array([3, 4, 2]) / np.sqrt(29), atol=1e-15)
    assert (len(scene.shapes), scene.film.width, scene.film.height) == (3, 160, 120)
    scene = parse_file(FOLDER / "asymmetric.pbrt")
    (sun,) = scene.lights
    assert isinstance(sun, DistantLight)
    np.testing.assert_allclose(sun.wi, np.array([-2, 5, 3]) / np.sqrt(38), atol=1e-15)
    assert (len(scene.shapes), scene.film.width, scene.film.height) == (4, 200, 96)


def rays(scene: SceneDescription, dx: float, dy: float) -> tuple[np.ndarray, np.ndarray]:
    """Eye (3,) and directions (h, w, 3) through the point (dx, dy) of each pixel, by pbrt's conventions
    written out anew.
    """
    width, height = scene.film.width, scene.film.height
    half = np.tan(np.radians(scene.camera.fov) / 2) / min(width, height)
    x = (2 * (np.arange(width) + dx) - width) * half
    y = (height - 2 * (np.arange(height) + dy)) * half
    local = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1)
    return scene.camera.camera_to_world[:3, 3], local @ scene.camera.camera_to_world[:3, :3].T


def hits_light(scene: SceneDescription, dx: float, dy: float) -> np.ndarray:
    """(h, w) bool: whether the line through that point of each pixel meets the light, the last shape of these
    files.
    """
    eye, d = rays(scene, dx, dy)
    light = scene.shapes[-1].geometry
    if isinstance(light, Sphere):
        to_center = light.center - eye
        along = d @ to_center / np.linalg.norm(d, axis=-1)
        return to_center @ to_center - along**2 < light.radius**2
    assert isinstance(light, BilinearMesh)
    p00, p10, p01 = light.vertices[light.faces[0, :3]]
    normal = np.cross(p10 - p00, p01 - p00)
    hit = eye + d * ((p00 - eye) @ normal / (d @ normal))[..., None] - p00
    u, v = (hit @ edge / (edge @ edge) for edge in (p10 - p00, p01 - p00))
    return (u > 0) & (u < 1) & (v > 0) & (v < 1)


@pytest.mark.parametrize("name", ["sphere-light", "touching-light"])
def test_the_light_covers_exactly_pbrt_s_pixels(name: str) -> None:
    """A wrong handedness, field of view, aspect or transformation moves the light's outline by more than a
    pixel.

    pbrt samples wavelengths, so that a pixel full of light is noisy too; its noise is half the difference of
    the two runs.
    """
    scene = parse_file(FOLDER / f"{name}.pbrt")
    first, second = (read_rgb(FOLDER / f"{name}.{run}.exr") for run in "ab")
    image = (first + second) / 2
    emission = scene.shapes[-1].emission
    assert emission is not None
    corners = np.stack([hits_light(scene, dx, dy) for dx in (0, 0.5, 1) for dy in (0, 0.5, 1)])
    inside, outside = corners.all(axis=0), ~corners.any(axis=0)
    assert inside.sum() > 100
    assert (~inside & ~outside).sum() > 20  # pixels on the outline, which say nothing either way
    noise = np.sqrt(np.mean(((first - second)[inside] / 2) ** 2, axis=0))
    assert np.all(
        np.abs(image[inside] - emission.radiance) < 6 * noise
    )  # 17,000 values: 6 sigma at random in one of 30,000 runs
    assert np.all(
        6 * noise < 0.1 * emission.radiance
    )  # so a pixel that the light fills to nine tenths would be seen
    assert image[outside].max() < 0.5 * emission.radiance.max()
