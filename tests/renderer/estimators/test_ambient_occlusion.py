"""Ambient occlusion against closed forms: the open share of the cosine-weighted hemisphere is 1 less a form
factor.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from renderer import build
from renderer.render import render
from scenes.description.materials import Diffuse
from scenes.description.shapes import ShapeDescription, Sphere, TriangleMesh
from tests.kit.scenes import BLACK, GRAY, floor, light, patch, reflect, scene

UP = np.array([0.0, 1.0, 0.0])


def wall(height: float, half: float = 1e4) -> ShapeDescription:
    """At x = 0, from the floor up, practically without end in z."""
    p = np.array([[0, 0, -half], [0, 0, half], [0, height, half], [0, height, -half]], dtype=float)
    return ShapeDescription(TriangleMesh(p, np.array([[0, 1, 2], [0, 2, 3]])), GRAY)


@pytest.mark.parametrize("sampler", ["independent", "sobol"])
def test_beside_a_wall(sampler):
    """An endless wall of height H at distance d hides (1 - d / sqrt(d^2 + H^2)) / 2 of the floor's
    hemisphere.
    """
    built = build(scene([floor(20.0), wall(2.0)]))
    d = np.array([0.1, 1.0, 5.0])
    points = np.stack([d, 0 * d, 0 * d], axis=1)
    mean, se = reflect(built, points, UP, 0, "ambient-occlusion", 60_000, sampler)
    truth = 1 - (1 - d / np.sqrt(d * d + 4.0)) / 2
    assert np.all(np.abs(mean - truth[:, None]) < 4.5 * se) and se.max() < 0.003


def test_below_a_sphere_and_not_beyond_the_distance():
    """A sphere of radius r at height h hides (r/h)^2; nothing if it is farther than `maxdistance`.

    Lights hide like all else.
    """
    for ball in (
        ShapeDescription(Sphere(np.array([0.0, 2.0, 0.0]), 0.8), BLACK),
        light(Sphere(np.array([0.0, 2.0, 0.0]), 0.8)),
    ):
        given = scene([floor(), ball])
        mean, se = reflect(build(given), np.zeros((1, 3)), UP, 0, "ambient-occlusion", 60_000)
        assert np.all(np.abs(mean - (1 - 0.16)) < 4.5 * se)
        near = replace(given, occlusion_distance=1.1)
        assert np.all(reflect(build(near), np.zeros((1, 3)), UP, 0, "ambient-occlusion", 1000)[0] == 1.0)


def test_to_a_distance_within_a_plane_overhead():
    """An endless ceiling at height h is met within D where cos > h/D: that hides 1 - (h/D)^2."""
    overhead = ShapeDescription(
        TriangleMesh(
            np.array([[-1e3, 2, -1e3], [1e3, 2, -1e3], [1e3, 2, 1e3], [-1e3, 2, 1e3]], dtype=float),
            np.array([[0, 1, 2], [0, 2, 3]]),
        ),
        GRAY,
    )
    given = replace(scene([floor(), overhead]), occlusion_distance=3.0)
    mean, se = reflect(build(given), np.zeros((1, 3)), UP, 0, "ambient-occlusion", 60_000)
    assert np.all(np.abs(mean - (2 / 3) ** 2) < 4.5 * se)


def test_it_needs_no_light_and_shows_none():
    """A scene without lights; with one in view, which is shaded like all else; rays that miss are black, as
    pbrt has it.
    """
    dark = scene([floor(1.0)], eye=(0.0, 2.0, -5.0), fov=30.0)
    image = render(dark, estimator="ambient-occlusion", spp=4).image
    assert set(np.unique(image)) <= {0.0, 0.25, 0.5, 0.75, 1.0} and 0 < image.mean() < 1
    lamp = patch([-1.0, 0.0, -1.0], [2, 0, 0], [0, 0, 2], [9.0, 9, 9], two_sided=True)
    shown = render(scene([lamp], eye=(0.0, 2.0, -5.0), fov=30.0), estimator="ambient-occlusion", spp=4).image
    np.testing.assert_array_equal(image, shown)
    black = scene([floor(1.0, material=Diffuse(np.zeros(3)))], eye=(0.0, 2.0, -5.0), fov=30.0)
    np.testing.assert_array_equal(image, render(black, estimator="ambient-occlusion", spp=4).image)
