"""What the rasterised baseline is made of, before anything is drawn: lights, surroundings, triangles and mean
colours, in closed form.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.baseline.lights import ambient, of_shape
from pipeline.baseline.scene import convert
from pipeline.baseline.surfaces import View, mean_emission, surface, tessellate
from scenes.description.lights import Environment
from scenes.description.materials import Diffuse
from scenes.description.scene import Film, PerspectiveCamera, SceneDescription
from scenes.description.shapes import (
    Array,
    BilinearMesh,
    Disk,
    Emission,
    Geometry,
    ShapeDescription,
    TriangleMesh,
)
from scenes.description.textures import Mix

BLACK = Diffuse(np.zeros(3))
L = np.array([3.0, 2.0, 0.5])
CENTER, NORMAL, RADIUS = np.array([1.0, 2.0, -4.0]), np.array([0.28, -0.96, 0.0]), 0.7
VIEW = View(np.array([0.5, -1.0, 2.0]), np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), 0.25)
SQUARE = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [2.0, 2.0, 0.0]])  # normal +z, area 4
PATCH = BilinearMesh(SQUARE, np.array([[0, 1, 2, 3]]))
TRIANGLES = TriangleMesh(SQUARE, np.array([[0, 1, 3], [0, 3, 2]]))
HALF = np.array([[[0.1] * 3, [0.9] * 3], [[0.3] * 3, [0.7] * 3]])  # (2, 2, 3), mean 1/2
NORTH, SOUTH = np.array([0.25, 0.5, 1.0]), np.array([0.75, 0.1, 0.2])  # of the own +z and -z
TWO = np.stack([np.tile(NORTH, (2, 1)), np.tile(SOUTH, (2, 1))])  # (2, 2, 3) by latitude


@pytest.mark.parametrize("two_sided", [False, True])
def test_a_disk_is_a_flat_light_on_each_side_that_emits(two_sided: bool) -> None:
    """Both lights of a two-sided disk are at its middle, with all its power L A each: one shines along the
    normal, one against it.

    The area is that of a polygon of 512 sides, 2.5e-5 less. A back that is left out leaves half the scene
    dark.
    """
    shape = ShapeDescription(Disk(CENTER, NORMAL, RADIUS), BLACK, Emission(L, two_sided))
    lights = list(of_shape(shape, VIEW))
    assert [light.linear for light in lights] == [True] * (1 + two_sided)
    for light, side in zip(lights, (1.0, -1.0), strict=False):
        assert np.allclose(light.axis, side * VIEW.axes @ NORMAL, rtol=0, atol=1e-12)
        assert np.allclose(light.position, VIEW.axes @ (CENTER - VIEW.origin) * VIEW.scale, rtol=1e-12)
        assert np.allclose(light.power, L * np.pi * RADIUS**2 * VIEW.scale**2, rtol=1e-4)


@pytest.mark.parametrize("hemisphere", [False, True])
def test_the_surroundings_of_a_constant_environment_are_its_radiance(hemisphere: bool) -> None:
    """Over the directions that it comes from; a hemisphere's mean over the whole sphere would be half of
    it.
    """
    assert np.allclose(ambient(Environment(L, hemisphere=hemisphere)), L, rtol=1e-12)


def test_a_hemisphere_s_mean_is_that_of_its_own_half() -> None:
    """North and south are half the sphere each; of the northern half, the south is no part."""
    sky = Environment(L, TWO, "latitude-longitude")
    assert np.allclose(ambient(sky), L * (NORTH + SOUTH) / 2, rtol=1e-12)
    assert np.allclose(ambient(replace(sky, hemisphere=True)), L * NORTH, rtol=1e-12)


@pytest.mark.parametrize("hemisphere", [False, True])
def test_the_background_turns_with_the_environment_s_frame(hemisphere: bool) -> None:
    """Own +z is the world's +x, the camera's right: the right half is north. With the frame left out all is
    north, ahead
    of the camera; with its transpose the upper half is."""
    frame = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    sky = Environment(L, TWO, "latitude-longitude", frame, hemisphere)
    seen = convert(
        SceneDescription("sky", PerspectiveCamera(np.eye(4), 70.0), Film(12, 8), (), (sky,))
    ).background
    left = np.zeros(3) if hemisphere else L * SOUTH
    assert np.allclose(seen[:, :6], left, rtol=1e-12) and np.allclose(seen[:, 6:], L * NORTH, rtol=1e-12)


@pytest.mark.parametrize("mesh", [PATCH, TRIANGLES])
def test_a_reversed_mesh_has_its_normals_turned(mesh: BilinearMesh | TriangleMesh) -> None:
    for reverse, z in ((False, 1.0), (True, -1.0)):
        corners, normals = tessellate(replace(mesh, reverse=reverse))
        area = (
            np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        )
        assert area.sum() == pytest.approx(4.0, rel=1e-12)
        assert np.array_equal(normals, np.broadcast_to([0.0, 0.0, z], corners.shape))


@pytest.mark.parametrize("mesh", [PATCH, TRIANGLES])
def test_a_reversed_light_shines_the_other_way(mesh: BilinearMesh | TriangleMesh) -> None:
    for reverse, z in ((False, 1.0), (True, -1.0)):
        (light,) = of_shape(ShapeDescription(replace(mesh, reverse=reverse), BLACK, Emission(L)), VIEW)
        assert np.allclose(light.axis, VIEW.axes @ np.array([0.0, 0.0, z]), rtol=0, atol=1e-12)


def test_an_image_on_a_light_counts_by_its_mean() -> None:
    """In the mean itself, in what the light is drawn with, and in its lamp's power."""
    shape = ShapeDescription(PATCH, BLACK, Emission(L, image=HALF))
    assert shape.emission is not None
    (light,) = of_shape(shape, VIEW)
    assert np.allclose(mean_emission(shape.emission), L / 2, rtol=1e-12)
    assert np.allclose(surface(shape, VIEW).emission, L / 2, rtol=1e-12)
    assert np.allclose(light.power, L / 2 * 4.0 * VIEW.scale**2, rtol=1e-12)


def _albedo(geometry: Geometry, first: Array, second: Array, amount: Array) -> Array:
    return surface(ShapeDescription(geometry, Diffuse(Mix(first, second, amount))), VIEW).color


def test_a_mix_takes_its_amount_of_the_second() -> None:
    """A quarter, in pbrt's order (1 - amount) first + amount second; swapped it would be three quarters."""
    assert np.allclose(_albedo(PATCH, np.zeros(3), np.ones(3), np.full(3, 0.25)), 0.25, rtol=1e-12)
    first, second, amount = np.array([0.2, 0.4, 0.6]), np.array([0.8, 0.1, 0.5]), np.array([0.0, 1.0, 0.1])
    assert np.allclose(_albedo(PATCH, first, second, amount), [0.2, 0.1, 0.59], rtol=1e-12)
