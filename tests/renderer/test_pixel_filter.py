"""Pixel filters: samples follow the filter, which is checked by moments that have closed forms and by the
whole profile.
"""

from __future__ import annotations

import numpy as np
import pytest

from renderer.camera import make_camera
from renderer.pixel_filter import offsets
from scenes.description.scene import Film, PerspectiveCamera, PixelFilter

U = (np.arange(200_000) + 0.5) / 200_000


def profile(f: PixelFilter, x: np.ndarray) -> np.ndarray:
    """pbrt's definitions along x, not normalised."""
    if f.kind == "box":
        return (np.abs(x) <= f.xradius).astype(float)
    if f.kind == "triangle":
        return np.maximum(0.0, f.xradius - np.abs(x))
    return np.maximum(0.0, np.exp(-(x**2) / (2 * f.sigma**2)) - np.exp(-(f.xradius**2) / (2 * f.sigma**2)))


@pytest.mark.parametrize(
    "f",
    [
        PixelFilter("box", 0.5, 0.5),
        PixelFilter("box", 1.25, 0.5),
        PixelFilter("triangle", 2.0, 2.0),
        PixelFilter("gaussian", 1.5, 1.5, 0.5),
        PixelFilter("gaussian", 0.7, 2.0, 3.0),
    ],
)
def test_samples_follow_the_filter(f):
    """Shares in 40 bins to 1e-5, with 2e5 equidistant numbers: catches an inverse that is off by 1e-4
    anywhere.
    """
    x = offsets(f)(np.stack([U, U]))[0] - 0.5
    edges = np.linspace(-f.xradius, f.xradius, 41)
    found = np.histogram(x, edges)[0] / x.size
    fine = np.linspace(-f.xradius, f.xradius, 40 * 500 + 1)
    middle = (fine[1:] + fine[:-1]) / 2
    expected = profile(f, middle).reshape(40, 500).sum(axis=1)
    np.testing.assert_allclose(found, expected / expected.sum(), atol=2e-5)
    assert np.abs(x).max() <= f.xradius


def test_axes_have_their_own_radii():
    x, y = offsets(PixelFilter("triangle", 1.0, 3.0))(np.full((2, 1), 1 - 1e-12)) - 0.5
    assert x[0] == pytest.approx(1.0, abs=1e-5) and y[0] == pytest.approx(3.0, abs=1e-5)


def test_the_plan_sees_as_far_as_the_filter_reaches():
    """A light just outside the film is in view of a filter of two pixels."""
    eye = PerspectiveCamera(np.eye(4), 90.0)
    beyond = np.array([[1.1], [0.0], [1.0]])  # the film spans -1 .. 1 with 10 pixels of 0.2
    assert not make_camera(eye, Film(10, 10)).sees(beyond)
    assert make_camera(eye, Film(10, 10, pixel_filter=PixelFilter("gaussian", 1.5, 1.5))).sees(beyond)
