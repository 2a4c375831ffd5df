"""Lights whose own surface reflects, or which others shine past: nothing lights itself, nothing shines
through a dark side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from renderer import build
from renderer.interfaces.estimator import ESTIMATORS, RADIANCE
from renderer.render import render
from scenes.description.lights import Environment, PointLight
from scenes.description.materials import Diffuse
from scenes.description.shapes import BilinearMesh, Disk, Emission, ShapeDescription, Sphere, TriangleMesh
from tests.kit.scenes import floor, light, patch, reflect, scene

UP = np.array([0.0, 1.0, 0.0])
HALF = Diffuse(np.full(3, 0.5))
TILTED = np.array([[-1.0, -0.3, 0.1], [1.1, -0.2, 0.3], [-0.9, 0.9, 1.3], [1.2, 1.0, 1.5]])
TILTED[3] = TILTED[1] + TILTED[2] - TILTED[0]
NORMAL = np.cross(TILTED[1] - TILTED[0], TILTED[2] - TILTED[0])


def rectangle() -> BilinearMesh:
    x = TILTED[1] - TILTED[0]
    y = np.cross(NORMAL / np.linalg.norm(NORMAL), x)
    return BilinearMesh(TILTED[0] + np.stack([0 * x, x, y, x + y]), np.array([[0, 1, 2, 3]]))


SHAPES = {
    "rectangle": (rectangle(), TILTED.mean(axis=0), NORMAL),
    "triangle": (TriangleMesh(TILTED, np.array([[0, 1, 2]])), TILTED[:3].mean(axis=0), NORMAL),
    "disk": (
        Disk(np.array([0.1, 0.2, 0.3]), NORMAL / np.linalg.norm(NORMAL), 0.7),
        np.array([0.1, 0.2, 0.3]),
        NORMAL,
    ),
}


def names(given) -> list[str]:
    some = (n for n in ESTIMATORS.names() if ESTIMATORS[n].quantity == RADIANCE)
    return [n for n in some if not ESTIMATORS[n].refuses(given)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    ("two_sided", "front", "truth"), [(False, False, 0.0), (False, True, 1.0), (True, False, 1.0)]
)
def test_a_flat_gray_light_does_not_light_itself(shape, two_sided, front, truth):
    """Alone in the dark: its radiance where it emits, nothing where it does not.

    Rounding gave 0.14 for 0, and 1.14 for 1.
    """
    geometry, centre, normal = SHAPES[shape]
    lamp = ShapeDescription(geometry, HALF, Emission(np.ones(3), two_sided))
    away = normal / np.linalg.norm(normal) * (3.0 if front else -3.0)
    given = scene([lamp], eye=tuple(centre + away), target=tuple(centre), width=8, height=6, fov=3.0)
    for name in names(given):
        for prune in (True, False):
            image = render(given, estimator=name, spp=16, prune=prune).image
            np.testing.assert_allclose(image, truth, atol=1e-9, err_msg=name)


def test_gray_spheres_light_their_inside_and_not_their_outside():
    """Inside a sphere that emits inwards, albedo 0.5: 1 + 0.5.

    Outside of it: nothing; of a two-sided one: 1.
    """
    centre = np.array([0.1, 0.2, 0.3])
    ball = ShapeDescription(Sphere(centre, 1.3, reverse=True), HALF, Emission(np.ones(3)))
    inside = scene([ball], eye=(0.4, 0.1, 0.2), target=(0.0, 0.0, 2.0), width=8, height=6)
    outside = scene([ball], eye=(0.0, 0.0, -5.0), target=tuple(centre), width=8, height=6, fov=5.0)
    both = replace(outside, shapes=(replace(ball, emission=Emission(np.ones(3), True)),))
    for name in names(inside):
        result = render(inside, estimator=name, spp=256)
        se = np.sqrt(result.variance.sum(axis=(0, 1))) / 48
        assert np.all(np.abs(result.image.mean(axis=(0, 1)) - 1.5) < 4.5 * se + 1e-6), name
        assert not render(outside, estimator=name, spp=16).image.any(), name
        np.testing.assert_allclose(render(both, estimator=name, spp=16).image, 1.0, atol=1e-9, err_msg=name)


def test_a_flat_light_whose_faces_turn_both_ways_is_pruned_soundly():
    p = np.array([[-1.0, 1, -1], [1, 1, -1], [1, 1, 1], [-1, 1, 1]])
    lamp = light(TriangleMesh(p, np.array([[0, 1, 2], [3, 2, 0]])), (1.0, 1.0, 1.0))
    given = scene([floor(), floor(y=2.0), lamp], eye=(0.5, 1.6, -6.0), target=(0.0, 1.0, 0.0))
    for name in ("mis", "solid-angle", "cosine"):
        pruned, full = (render(given, estimator=name, spp=8, prune=prune).image for prune in (True, False))
        np.testing.assert_array_equal(pruned, full)


def test_several_lights_of_one_direction_are_all_counted():
    """Two unequal point lights and a rectangle, under the estimators that meet lights by chance: E of both
    points, exactly.
    """
    at = np.array([[0.4, 1.5, -0.3], [-1.0, 2.0, 0.5]])
    given = replace(
        scene([floor()]), lights=(PointLight(at[0], np.ones(3)), PointLight(at[1], np.full(3, 5.0)))
    )
    truth = sum(i * a[1] / np.dot(a, a) ** 1.5 for i, a in zip((1.0, 5.0), at, strict=True)) * 0.5 / np.pi
    for name in ("cosine", "hemisphere", "bsdf", "mis", "solid-angle"):
        mean, se = reflect(build(given), np.zeros((1, 3)), UP, 0, name, 20_000)
        assert np.all(np.abs(mean - truth) < 4.5 * se) and np.all(se < 0.01 * truth), name


def test_no_sky_shines_through_a_light_s_dark_side():
    """A lamp that faces up, above a floor under a bright sky: the floor sees its dark side, and no sky there,
    by any estimator.
    """
    lamp = patch([-2.0, 0.5, -2.0], [0, 0, 4], [4, 0, 0], [9.0, 9, 9])
    given = replace(scene([floor(), lamp]), lights=(Environment(np.ones(3)),))
    means = {}
    for name in names(given):
        if ESTIMATORS[name].ratio:
            continue
        means[name] = reflect(build(given), np.array([[0.0, 0, 0], [1.0, 0, 1.0]]), UP, 0, name, 20_000)
    quiet, se = means["cosine"]
    assert np.all(quiet < 0.2)  # of 0.5 under the open sky
    for name, (mean, error) in means.items():
        assert np.all(np.abs(mean - quiet) < 4.5 * np.hypot(se, error)), name


def test_an_image_on_a_light_that_is_no_rectangle_is_refused():
    from scenes.errors import SceneError

    mesh = TriangleMesh(TILTED, np.array([[0, 1, 2]]))
    lamp = ShapeDescription(mesh, HALF, Emission(np.ones(3), image=np.ones((2, 2, 3))))
    with pytest.raises(SceneError, match="must be a rectangle"):
        build(scene([floor(), lamp]))
