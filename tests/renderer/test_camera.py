"""The camera: pbrt's left-handed space, field of view over the shorter side, box filter, and what it can
see.
"""

from __future__ import annotations

import numpy as np
import pytest

from renderer.camera import make_camera
from tests.kit.scenes import look_at


def test_x_goes_right_and_y_goes_up_as_in_pbrt():
    """Looking along +z with y up, pbrt's camera has +x on the right: a mirrored image would be caught
    here.
    """
    camera = make_camera(*look_at([0, 0, -5], [0, 0, 0], 40, 20))
    corners = np.array([0, 39, 19 * 40])
    left_top, right_top, left_bottom = camera.rays(corners, np.full((2, 3), 0.5)).T
    assert left_top[0] < 0 < right_top[0]
    assert left_bottom[1] < 0 < left_top[1]
    assert left_top[2] > 0


@pytest.mark.parametrize(("width", "height"), [(40, 20), (20, 40), (30, 30)])
def test_the_field_of_view_spans_the_shorter_side(width, height):
    camera = make_camera(*look_at([0, 0, -5], [0, 0, 0], width, height, fov=50.0))
    middle = height // 2 * width + width // 2
    edge = {True: (width // 2, 0), False: (0, height // 2)}[width >= height]
    pixel = np.array([edge[1] * width + edge[0], middle])
    d = camera.rays(pixel, np.zeros((2, 2)))
    angle = np.degrees(np.arccos(np.clip(d[:, 0] @ d[:, 1], -1, 1)))
    assert angle == pytest.approx(25, abs=1e-9)


def test_samples_fill_the_pixel_uniformly():
    camera = make_camera(*look_at([0, 0, -5], [0, 0, 0], 4, 4, fov=90.0))
    u = np.random.default_rng(0).random((2, 1000))
    d = camera.rays(np.full(1000, 5), u)
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
