"""Textures and their coordinates, against values worked out by hand from pbrt-v4's definitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from renderer import build
from renderer.interfaces.estimator import ESTIMATORS
from renderer.render import render
from renderer.textures import brightest, evaluate
from scenes.description.lights import Environment
from scenes.description.materials import Diffuse
from scenes.description.shapes import BilinearMesh, Disk, Emission, ShapeDescription, Sphere, TriangleMesh
from scenes.description.textures import Checkerboard, ImageTexture, Mix, Product, UVMapping
from tests.kit.scenes import floor, light, places, scene

RED, GREEN = np.array([0.8, 0.1, 0.1]), np.array([0.1, 0.6, 0.1])
QUAD = np.array([[-1.0, 0, -1], [1, 0, -1], [-1, 0, 1], [1, 0, 1]])  # p00 p10 p01 p11: u along x, v along z
# Four colours: the first row is at v = 1.
FOUR = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 0.0]]]) * 0.5


def at(texture, *uv):
    return evaluate(texture, places(np.array(uv, dtype=float).T)).T


def test_images_have_their_first_row_at_v_1():
    texture = ImageTexture(FOUR, filter="point")
    np.testing.assert_array_equal(
        at(texture, (0.2, 0.9), (0.8, 0.9), (0.2, 0.1), (0.8, 0.1)), FOUR.reshape(4, 3)
    )


def test_bilinear_images_are_the_texels_at_their_centres_and_their_mean_in_the_middle():
    texture = ImageTexture(FOUR)
    np.testing.assert_allclose(at(texture, (0.25, 0.75), (0.75, 0.25)), [FOUR[0, 0], FOUR[1, 1]])
    np.testing.assert_allclose(at(texture, (0.5, 0.5)), [FOUR.mean(axis=(0, 1))])
    np.testing.assert_allclose(at(texture, (0.5, 0.75)), [FOUR[0].mean(axis=0)])


def test_wrapping():
    point = {"filter": "point"}
    np.testing.assert_array_equal(at(ImageTexture(FOUR, wrap="repeat", **point), (1.2, -0.1)), [FOUR[0, 0]])
    np.testing.assert_array_equal(at(ImageTexture(FOUR, wrap="clamp", **point), (1.2, -0.1)), [FOUR[1, 1]])
    np.testing.assert_array_equal(at(ImageTexture(FOUR, wrap="black", **point), (1.2, -0.1)), [[0, 0, 0]])
    # at the rim a bilinear look-up takes half of what lies beyond
    np.testing.assert_allclose(at(ImageTexture(FOUR, wrap="black"), (0.0, 0.75)), [FOUR[0, 0] / 2])
    np.testing.assert_allclose(at(ImageTexture(FOUR, wrap="repeat"), (0.0, 0.75)), [FOUR[0].mean(axis=0)])


def test_scale_and_inversion_come_after_the_look_up_and_the_bounds_last():
    """As pbrt orders them; bounded before, the middle of the first row would be 0.5 and not 0.75."""
    bright = ImageTexture(FOUR, scale=3.0)  # its first row: red 1.5, 0
    np.testing.assert_allclose(at(bright, (0.25, 0.75), (0.5, 0.75)), [[1, 0, 0], [0.75, 0.75, 0]])
    np.testing.assert_allclose(at(ImageTexture(FOUR, scale=3.0, clamped=False), (0.25, 0.75)), [[1.5, 0, 0]])
    np.testing.assert_allclose(at(ImageTexture(FOUR, scale=3.0, invert=True), (0.5, 0.75)), [[0.25, 0.25, 1]])
    np.testing.assert_allclose(brightest(bright), [1, 1, 1])


def test_what_is_inverted_is_white_outside_black():
    point = ImageTexture(FOUR, wrap="black", filter="point", invert=True)
    np.testing.assert_array_equal(at(point, (1.2, 0.5), (0.2, 0.9)), [[1, 1, 1], [0.5, 1, 1]])
    np.testing.assert_array_equal(brightest(ImageTexture(FOUR * 2, wrap="black", invert=True)), [1, 1, 1])


@pytest.mark.parametrize("wrap", ["repeat", "black", "clamp"])
@pytest.mark.parametrize("look", ["point", "bilinear"])
@pytest.mark.parametrize("scale", [0.5, 1.5, 3.0])
@pytest.mark.parametrize(("invert", "clamped"), [(False, False), (False, True), (True, True)])
def test_plain_texels_are_the_same_texture(wrap, look, scale, invert, clamped):
    texture = ImageTexture(FOUR, UVMapping(0.7, 0.7, 0.1, 0.1), wrap, look, scale, invert, clamped)
    plain = texture.plain()
    bounded = scale == 3.0 and (invert or clamped) and look == "bilinear"
    assert (plain is None) == (bounded or (invert and wrap == "black"))
    if plain is not None:
        uv = np.random.default_rng(1).uniform(-2, 3, (50, 2))
        np.testing.assert_allclose(at(plain, *uv), at(texture, *uv), atol=1e-15)


def test_mappings_scale_and_shift():
    texture = ImageTexture(FOUR, UVMapping(2.0, 0.5, 0.25, 0.5), filter="point")
    np.testing.assert_array_equal(at(texture, (0.1, 0.1)), [FOUR[0, 0]])  # (0.45, 0.55)
    np.testing.assert_array_equal(at(texture, (0.2, 0.1)), [FOUR[0, 1]])  # (0.65, 0.55)


def test_checkerboards_mixes_and_products():
    board = Checkerboard(RED, GREEN, UVMapping(4.0, 4.0))
    np.testing.assert_array_equal(
        at(board, (0.1, 0.1), (0.3, 0.1), (0.3, 0.3), (-0.1, 0.1)), [RED, GREEN, RED, GREEN]
    )
    np.testing.assert_allclose(at(Mix(RED, GREEN, np.full(3, 0.25)), (0, 0)), [0.75 * RED + 0.25 * GREEN])
    np.testing.assert_allclose(at(Product(board, np.full(3, 0.5)), (0.3, 0.1)), [GREEN / 2])
    np.testing.assert_allclose(brightest(Product(board, np.full(3, 0.5))), [0.4, 0.3, 0.05])


def coordinates(geometry, points, **more):
    """uv (m, 2) of points (m, 3) on the only shape of a scene, through the hits that the renderer finds."""
    board = Checkerboard(RED, GREEN)
    built = build(
        scene(
            [ShapeDescription(geometry, Diffuse(board), **more), light(Sphere(np.array([0.0, 50, 0]), 1.0))]
        )
    )
    assert built.coordinates is not None
    p = np.array(points, dtype=float).T
    which = np.zeros(p.shape[1], dtype=np.int64)
    if isinstance(geometry, Sphere | Disk) or "emission" in more:
        return built.coordinates.at(p, which - 1, which).T
    centre = p[:, None] - built.triangles.v0[:, :, None]  # (3, t, m)
    triangle = np.abs((centre * built.triangles.normal[:, :, None]).sum(axis=0)).argmin(axis=0)
    return built.coordinates.at(p, triangle, which - 1).T


def test_triangles_without_coordinates_have_pbrts():
    mesh = TriangleMesh(np.array([[0.0, 0, 0], [2, 0, 0], [0, 0, 2]]), np.array([[0, 1, 2]]))
    np.testing.assert_allclose(
        coordinates(mesh, [[0, 0, 0], [2, 0, 0], [0, 0, 2], [0.5, 0, 0.5]]),
        [[0, 0], [1, 0], [1, 1], [0.5, 0.25]],
        atol=1e-15,
    )


def test_given_coordinates_are_interpolated():
    uv = np.array([[0.1, 0.2], [0.9, 0.3], [0.4, 0.8]])
    mesh = TriangleMesh(np.array([[0.0, 0, 0], [2, 0, 0], [0, 0, 2]]), np.array([[0, 1, 2]]), uv=uv)
    np.testing.assert_allclose(coordinates(mesh, [[2 / 3, 0, 2 / 3]]), [uv.mean(axis=0)])


@pytest.mark.parametrize("emission", [{}, {"emission": Emission(np.ones(3))}])
def test_patches_have_their_parameters(emission):
    points = [[-1, 0, -1], [1, 0, -1], [-1, 0, 1], [0.5, 0, 0.5]]
    found = coordinates(BilinearMesh(QUAD, np.array([[0, 1, 2, 3]])), points, **emission)
    np.testing.assert_allclose(found, [[0, 0], [1, 0], [0, 1], [0.75, 0.75]], atol=1e-15)


def test_spheres_and_disks_have_angles_about_their_own_axes():
    turned = np.array(
        [[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]
    )  # own x is world y, own y is world z, own z is world x
    ball = Sphere(np.zeros(3), 2.0, frame=turned)
    # towards own +x, own +y, own -y; the pole has v = 1 and any u
    np.testing.assert_allclose(
        coordinates(ball, [[0, 2, 0], [0, 0, 2], [0, 0, -2]]), [[0, 0.5], [0.25, 0.5], [0.75, 0.5]]
    )
    assert coordinates(ball, [[2, 0, 0]])[0, 1] == 1.0
    plate = Disk(np.zeros(3), np.array([1.0, 0, 0]), 2.0, frame=turned)
    np.testing.assert_allclose(
        coordinates(plate, [[0, 0, 1.0], [0, -2, 0]]), [[0.25, 0.5], [0.5, 0.0]], atol=1e-15
    )


def test_a_textured_floor_under_a_constant_sky_shows_its_texture():
    """Radiance rho everywhere: a white-furnace floor seen head on is its own texture, row for row."""
    shape = ShapeDescription(
        BilinearMesh(QUAD, np.array([[0, 1, 2, 3]])), Diffuse(ImageTexture(FOUR, filter="point"))
    )
    given = replace(
        scene(
            [shape],
            eye=(0.0, 5.0, -1e-9),
            target=(0.0, 0.0, 0.0),
            width=4,
            height=4,
            fov=2 * np.degrees(np.arctan(0.2)),
        ),
        lights=(Environment(np.ones(3)),),
    )
    image = render(given, estimator="cosine", spp=4).image
    # Looking down with up = +z: right is world +x, so u grows to the right, v upwards: the picture as it is
    # stored.
    expected = FOUR.repeat(2, axis=0).repeat(2, axis=1)
    np.testing.assert_allclose(image, expected, rtol=1e-9)


def test_a_light_with_a_picture_is_seen_and_sheds_it():
    """Seen from below as it is laid; its light on a floor is that of four lights of one colour each."""
    mesh = BilinearMesh(
        QUAD + np.array([0, 2.0, 0]), np.array([[0, 1, 2, 3]])
    )  # normal u x v = x x z = -y: down
    whole = ShapeDescription(
        mesh, Diffuse(np.zeros(3)), Emission(np.full(3, 4.0), image=FOUR.repeat(64, 0).repeat(64, 1))
    )
    quarters = []
    for row, column in np.ndindex(2, 2):
        corner = np.array([column - 1.0, 2.0, -row])  # v = 1 is the first row: z from 0 to 1
        p = corner + np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [1.0, 0, 1]])
        quarters.append(light(BilinearMesh(p, np.array([[0, 1, 2, 3]])), 4.0 * FOUR[row, column]))
    view = {"eye": (0.3, 1.0, -5.0), "target": (0.0, 1.0, 0.0), "width": 24, "height": 18, "fov": 50.0}
    one, four = scene([floor(), whole], **view), scene([floor(), *quarters], **view)
    for name in ("area", "solid-angle", "mis", "cosine", "projected-solid-angle"):
        a, b = (render(s, estimator=name, spp=256, seed=k) for k, s in enumerate((one, four)))
        se = np.sqrt((a.variance + b.variance).sum(axis=(0, 1)))
        assert np.all(
            np.abs((a.image - b.image).sum(axis=(0, 1))) < 4 * se + 0.004 * b.image.sum(axis=(0, 1))
        ), name
        assert not np.allclose(b.image.mean(axis=(0, 1)), b.image.mean(axis=(0, 1))[::-1])
    assert "closed form" in str(ESTIMATORS["analytic-visibility"].refuses(one))
