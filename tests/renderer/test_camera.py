"""The camera: pbrt's left-handed space, field of view over the shorter side, box filter, and what it can
see.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from renderer.camera import make_camera
from scenes.description.scene import Lens, OrthographicCamera
from tests.kit.scenes import look_at


def test_x_goes_right_and_y_goes_up_as_in_pbrt():
    """Looking along +z with y up, pbrt's camera has +x on the right: a mirrored image would be caught
    here.
    """
    camera = make_camera(*look_at([0, 0, -5], [0, 0, 0], 40, 20))
    corners = np.array([0, 39, 19 * 40])
    left_top, right_top, left_bottom = camera.rays(corners, np.full((2, 3), 0.5))[1].T
    assert left_top[0] < 0 < right_top[0]
    assert left_bottom[1] < 0 < left_top[1]
    assert left_top[2] > 0


@pytest.mark.parametrize(("width", "height"), [(40, 20), (20, 40), (30, 30)])
def test_the_field_of_view_spans_the_shorter_side(width, height):
    camera = make_camera(*look_at([0, 0, -5], [0, 0, 0], width, height, fov=50.0))
    middle = height // 2 * width + width // 2
    edge = {True: (width // 2, 0), False: (0, height // 2)}[width >= height]
    pixel = np.array([edge[1] * width + edge[0], middle])
    _, d = camera.rays(pixel, np.zeros((2, 2)))
    angle = np.degrees(np.arccos(np.clip(d[:, 0] @ d[:, 1], -1, 1)))
    assert angle == pytest.approx(25, abs=1e-9)


def test_samples_fill_the_pixel_uniformly():
    camera = make_camera(*look_at([0, 0, -5], [0, 0, 0], 4, 4, fov=90.0))
    u = np.random.default_rng(0).random((2, 1000))
    _, d = camera.rays(np.full(1000, 5), u)
    x, y = d[0] / d[2], d[1] / d[2]  # pixel (1, 1) of 4 x 4 over [-1, 1]: x in [-0.5, 0], y in [0, 0.5]
    np.testing.assert_allclose(x, -0.5 + 0.5 * u[0], atol=1e-14)
    np.testing.assert_allclose(y, 0.5 - 0.5 * u[1], atol=1e-14)


def test_what_lies_outside_one_side_of_the_frustum_is_not_seen():
    camera = make_camera(*look_at([0, 0, -5], [0, 0, 0], 40, 20))
    box = np.indices((2, 2, 2)).reshape(3, 8) - 0.5
    assert camera.sees(box)
    for shift in ([100, 0, 0], [-100, 0, 0], [0, 100, 0], [0, -100, 0], [0, 0, -100]):
        assert not camera.sees(box + np.array(shift)[:, None])
    assert camera.sees(box * 1000)  # around the camera


def test_a_lens_blurs_a_point_into_its_circle_of_confusion():
    """A point at depth z is seen by a lens of radius r, sharp at f, through film points up to r |1/z - 1/f|
    about its own, uniformly, in units of the film at distance 1.
    """
    eye, film = look_at([0, 0, 0], [0, 0, 1], 40, 20, fov=90.0)
    radius, sharp, z = 0.3, 5.0, 2.0
    camera = make_camera(replace(eye, lens=Lens(radius, sharp)), film)
    pixel, u = np.full(4000, 10 * 40 + 20), np.random.default_rng(2).random((4, 4000))
    assert camera.dimensions == 4
    o, d = camera.rays(pixel, u)
    assert np.hypot(o[0], o[1]).max() <= radius and not o[2].any()
    at = o + d * (sharp / d[2])  # the sharp plane: where the pinhole's ray meets it, wherever it starts
    pinhole = make_camera(eye, film).rays(pixel, u[:2])[1]
    np.testing.assert_allclose(at, pinhole * (sharp / pinhole[2]), atol=1e-13)
    blur = (o + d * (z / d[2]))[:2] / z - (pinhole / pinhole[2])[:2]
    share = np.hypot(*blur) / (radius * abs(1 / z - 1 / sharp))
    assert share.max() <= 1 + 1e-12
    assert np.mean(share**2) == pytest.approx(0.5, abs=4.5 / np.sqrt(12 * 4000))  # uniform on the disk


def test_an_orthographic_film_is_its_own_footprint():
    eye, film = look_at([1, 2, -5], [1, 2, 0], 40, 20)
    window = np.array([-3.0, 1.0, -0.5, 1.5])
    camera = make_camera(OrthographicCamera(eye.camera_to_world, window), film)
    corners = np.array([0, 39, 19 * 40 + 39])
    o, d = camera.rays(corners, np.full((2, 3), 0.5))
    np.testing.assert_allclose(d, np.repeat([[0.0], [0.0], [1.0]], 3, axis=1), atol=1e-15)
    x, y, z = o - np.array([[1.0], [2.0], [-5.0]])
    np.testing.assert_allclose(x, [-2.95, 0.95, 0.95], atol=1e-12)  # pixels of 0.1
    np.testing.assert_allclose(y, [1.45, 1.45, -0.45], atol=1e-12)
    np.testing.assert_allclose(z, 0.0, atol=1e-12)


@pytest.mark.parametrize("kind", ["lens", "orthographic", "both"])
def test_no_ray_leaves_what_the_camera_sees(kind: str):
    """Points on rays are in view at all distances; what is behind, or far aside, is not."""
    eye, film = look_at([1, 2, -5], [0, 0, 0], 8, 6)
    lens = None if kind == "orthographic" else Lens(0.5, 3.0)
    parallel = OrthographicCamera(eye.camera_to_world, lens=lens)
    camera = make_camera(replace(eye, lens=lens) if kind == "lens" else parallel, film)
    o, d = camera.rays(np.arange(48), np.random.default_rng(1).random((camera.dimensions, 48)))
    for t in (0.1, 1.0, 3.0, 10.0, 1e4):
        assert all(camera.sees((o + d * t)[:, i : i + 1]) for i in range(48))
    forward = eye.camera_to_world[:3, 2:3]
    box = np.indices((2, 2, 2)).reshape(3, 8) - 0.5
    assert camera.sees(box)
    assert not camera.sees(box + camera.origin - 20 * forward)
    assert not camera.sees(box + camera.origin + 5 * forward + 50 * eye.camera_to_world[:3, 0:1])


@pytest.mark.parametrize("sheared", [False, True])
@pytest.mark.parametrize("parallel", [False, True])
def test_distances_are_those_that_rays_go(parallel: bool, sheared: bool):
    """Of parallel rays from the film: a distance from its middle is off by a multiple at its rim."""
    eye, film = look_at([1, 2, 3], [0, 0, 0], 40, 30)
    matrix = eye.camera_to_world
    if sheared:
        matrix = matrix @ np.array([[1, 0.2, 0.4, 0], [0, 2, 0.3, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    camera = make_camera(
        OrthographicCamera(matrix) if parallel else replace(eye, camera_to_world=matrix), film
    )
    rng = np.random.default_rng(5)
    o, d = camera.through(*(rng.random((2, 50)) * [[40.0], [30.0]]))
    t = rng.random(50) * 10
    np.testing.assert_allclose(camera.distance(o + t * d), t, atol=1e-12)
