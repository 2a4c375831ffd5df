"""The spherical camera against pbrt's formulas written out, and against a sky of its own map."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.references.protocol import BACKENDS
from renderer import render
from renderer.camera import make_camera
from scenes.description.lights import Environment
from scenes.description.scene import Film, PixelFilter, SceneDescription, SphericalCamera
from scenes.pbrt.parser import parse
from scenes.pbrt.write.scene import to_pbrt
from tests.kit.scene_texts import HEAD, TRIANGLE, fails

CAMERA = 'Camera "perspective" "float fov" [ 40 ]'
TURN = np.eye(4)
TURN[:3, :3] = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix() * [1, 1, -2]
TURN[:3, 3] = [1, 2, 3]


def scene(camera: str, film: str = "") -> SceneDescription:
    return parse(
        HEAD.replace(CAMERA, camera).replace(
            '"integer yresolution" [ 6 ]', film or '"integer yresolution" [ 8 ]'
        )
        + TRIANGLE
    )


def square_to_sphere(u: float, v: float) -> np.ndarray:
    """pbrt's WrapEqualAreaSquare and EqualAreaSquareToSphere."""
    if u < 0 or u > 1:
        u, v = -u if u < 0 else 2 - u, 1 - v
    if v < 0 or v > 1:
        u, v = 1 - u, -v if v < 0 else 2 - v
    u, v = 2 * u - 1, 2 * v - 1
    d = 1 - (abs(u) + abs(v))
    r = 1 - abs(d)
    phi = (1 if r == 0 else (abs(v) - abs(u)) / r + 1) * np.pi / 4
    flat = r * np.sqrt(2 - r * r)
    return np.array(
        [np.copysign(np.cos(phi), u) * flat, np.copysign(np.sin(phi), v) * flat, np.copysign(1 - r * r, d)]
    )


def polar(u: float, v: float) -> np.ndarray:
    """pbrt's SphericalDirection of pi v and 2 pi u."""
    theta, phi = np.pi * v, 2 * np.pi * u
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


@pytest.mark.parametrize(("mapping", "map_"), [("equalarea", square_to_sphere), ("equirectangular", polar)])
def test_rays_are_pbrt_s(mapping, map_):
    """Turned, mirrored and scaled unevenly, with a filter that reaches beyond every edge of the film."""
    description = SphericalCamera(TURN, mapping)
    camera = make_camera(description, Film(5, 4, pixel_filter=PixelFilter("box", 1.5, 1.5)))
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-1, 6, 300), rng.uniform(-1, 5, 300)
    o, d = camera.through(x, y)
    assert o.ravel().tolist() == [1, 2, 3]
    for i in range(300):
        w = map_(x[i] / 5, y[i] / 4)
        want = TURN[:3, :3] @ [w[0], w[2], w[1]]
        np.testing.assert_allclose(d[:, i], want / np.linalg.norm(want), atol=1e-12)
    low, high = camera.rays(np.array([0]), np.array([[0.0, 1.0], [0.0, 1.0]])[:, :1])[1], camera.eyes
    assert np.isfinite(low).all() and high.shape == (3, 1)


def test_it_sees_behind_itself():
    camera = make_camera(SphericalCamera(np.eye(4)), Film(4, 4))
    assert camera.sees(np.array([[0.0], [0.0], [-5.0]]))


def test_a_sky_of_the_same_map_is_the_image():
    """Texel for texel: a flip, a turn or y and z left as they are would show another."""
    image = np.random.default_rng(2).uniform(0, 1, (6, 6, 3))
    sky = Environment(np.ones(3), image, frame=np.eye(3)[[0, 2, 1]].T.copy())
    given = SceneDescription("sky", SphericalCamera(np.eye(4)), Film(6, 6), (), (sky,))
    assert np.array_equal(render(given, spp=4).image, image)


def test_the_mean_of_an_equal_area_image_is_the_mean_over_the_sphere():
    """Of a sky that is 1 on half of the sphere it is a half, wherever that is; 4.5 errors are 3 in 1000."""
    sky = Environment(np.ones(3), hemisphere=True, frame=TURN[:3, :3] / np.array([1, 1, -2]))
    given = SceneDescription("sky", SphericalCamera(np.eye(4)), Film(32, 32), (), (sky,))
    assert render(given, spp=16).image.mean() == pytest.approx(0.5, abs=3e-3)


@pytest.mark.parametrize("mapping", ["", '"string mapping" "equirectangular"'])
@pytest.mark.parametrize(
    "crop", ["", '"integer pixelbounds" [ 3 6 1 4 ]', '"float cropwindow" [ .2 .8 .1 .9 ]']
)
def test_it_reads_back_to_the_bit(mapping: str, crop: str):
    given = scene(f'Camera "spherical" {mapping}', f'"integer yresolution" [ 7 ] {crop}')
    assert isinstance(given.camera, SphericalCamera)
    assert given.camera.mapping == ("equirectangular" if mapping else "equalarea")
    assert parse(to_pbrt(given)).content_hash() == given.content_hash()


def test_a_crop_shows_its_part_of_the_map():
    whole, part = (
        scene('Camera "spherical"'),
        scene('Camera "spherical"', '"integer yresolution" [ 8 ] "integer pixelbounds" [ 2 5 1 7 ]'),
    )
    assert (part.film.width, part.film.height) == (3, 6)
    a, b = (make_camera(s.camera, s.film) for s in (whole, part))
    x, y = np.array([0.5, 2.5]), np.array([0.5, 4.5])
    np.testing.assert_allclose(b.through(x, y)[1], a.through(x + 2, y + 1)[1], atol=1e-12)


def test_a_window_and_a_lens_change_nothing_as_in_pbrt():
    given = scene('Camera "spherical" "float screenwindow" [ -1 2 -3 4 ] "float lensradius" .3')
    assert given.content_hash() == scene('Camera "spherical"').content_hash()


def test_an_unknown_mapping_is_told_with_its_place():
    fails(
        HEAD.replace(CAMERA, 'Camera "spherical" "string mapping" "cube"'), 2, 20, '"cube"', "equirectangular"
    )


def test_other_programs_say_that_they_lack_it(tmp_path: Path):
    given = replace(scene('Camera "spherical"'), lights=(Environment(np.ones(3)),))
    for name in ("mitsuba", "closed-form"):
        why = BACKENDS[name].refuses(given)
        assert why is not None
        assert "spherical" in why.lower()
