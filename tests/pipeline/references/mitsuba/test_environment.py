"""Resampled environments: is the error that is claimed the error that there is, and is it small."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.references.mitsuba.environment import equal_area_square, interpolated, resampled
from scenes.description.lights import Environment
from scenes.description.shapes import Array
from tests.kit.mitsuba_checks import solid_angles, towards

pytestmark = pytest.mark.usefixtures("thorough")

RNG = np.random.default_rng(7)
NOISE = RNG.random((16, 16, 3))
SUN = np.full((32, 32, 3), 0.1)
SUN[20, 9] = 500
FRAME = np.linalg.qr(RNG.normal(size=(3, 3)))[0]


def test_the_map_is_pbrts():
    """Against pbrt's map the other way, at random points and at those where its formula changes: 1e-12 of the
    square.
    """
    square = np.concatenate(
        [RNG.random((4000, 2)), np.array([[0.5, 0.5], [0.5, 1e-9], [1 - 1e-9, 0.3], [0.25, 0.75]])]
    )
    np.testing.assert_allclose(equal_area_square(towards(square)), square, atol=1e-12)
    # On the diagonals and edges, where several points of the square are one direction: directions, not
    # points.
    folds = np.stack([np.linspace(0, 1, 101), 1 - np.linspace(0, 1, 101)], -1)
    np.testing.assert_allclose(towards(equal_area_square(towards(folds))), towards(folds), atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("hemisphere", [False, True])
@pytest.mark.parametrize(
    ("image", "mapping"), [(NOISE, "equal-area"), (SUN, "equal-area"), (NOISE[:5], "latitude-longitude")]
)
def test_irradiance_survives_resampling(image: Array, mapping: str, hemisphere: bool):
    """Measured here, and by other directions than the code's own: at most 5e-5 of the largest, and at most
    three times what is claimed.

    A map that is off by half a texel is 1e-3; a sun whose one texel is lost or doubled, 1.
    """
    environment = Environment(np.ones(3), image, mapping, FRAME, hemisphere)
    made = resampled((environment,))
    normals = RNG.normal(size=(10, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    d, light = solid_angles(environment)
    rows, columns = made.image.shape[:2]
    theta = (np.arange(2 * rows) + 0.5) * np.pi / (2 * rows)
    phi = (np.arange(2 * columns) + 0.5) * np.pi / columns
    error, largest = 0.0, 0.0
    ours = np.zeros((len(normals), 3))
    for polar in theta:  # a row at a time: the whole is gigabytes
        own = np.stack(
            [np.sin(polar) * np.cos(phi), np.sin(polar) * np.sin(phi), np.full_like(phi, np.cos(polar))], -1
        )
        value = interpolated(made.image, own) * (np.sin(polar) * (np.pi / (2 * rows)) * (np.pi / columns))
        ours += np.maximum(normals @ (own @ made.frame.T).T, 0) @ value
    for normal, got in zip(normals, ours, strict=True):
        want = np.maximum(d @ normal, 0) @ light
        error, largest = max(error, float(np.abs(got - want).max())), max(largest, float(want.max()))
    print(f"{mapping} {made.image.shape}: {error / largest:.1e}, claimed {made.irradiance_error:.1e}")
    assert error / largest < 5e-5
    assert error / largest < 3 * made.irradiance_error + 1e-5


def test_a_half_of_constant_light_is_a_narrow_image():
    made = resampled((Environment(np.array([1.0, 2.0, 3.0]), frame=FRAME, hemisphere=True),))
    assert made.irradiance_error < 1e-5 and made.image.shape[1] == 256
    middle = len(made.image) // 2
    np.testing.assert_allclose(
        made.image[:middle], np.broadcast_to([1.0, 2.0, 3.0], (middle, 256, 3)), rtol=1e-12
    )
    assert not made.image[middle + 1 :].any()
    np.testing.assert_allclose(made.image[middle], np.broadcast_to([0.5, 1.0, 1.5], (256, 3)), rtol=1e-12)


def test_texels_of_a_latitude_longitude_image_keep_their_edges():
    """Whole numbers of columns and rows for a texel: away from edges each value is the source's own."""
    image = RNG.random((4, 8, 3))
    made = resampled((Environment(np.ones(3), image, "latitude-longitude", FRAME),))
    rows, columns = made.image.shape[:2]
    assert ((rows - 1) % 4, columns % 8) == (0, 0)
    high, wide = (rows - 1) // 4, columns // 8
    np.testing.assert_allclose(made.image[high // 2 :: high, wide // 2 :: wide][:4], image, rtol=1e-12)
