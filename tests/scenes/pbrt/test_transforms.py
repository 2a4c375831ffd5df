"""Transformations: pbrt's conventions, exact inverses, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.description.shapes import TriangleMesh
from scenes.pbrt.parser import parse
from scenes.pbrt.transforms import (
    Transform,
    from_matrix,
    look_at,
    rotate,
    scale,
    translate,
    uniform_scale,
    unit,
)
from tests.kit.scene_texts import HEAD, TRIANGLE, world, world_fails


def points_of(body: str) -> np.ndarray:
    geometry = world(body + TRIANGLE).shapes[0].geometry
    assert isinstance(geometry, TriangleMesh)
    return geometry.vertices


X, Y = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("", [[0, 0, 0], [1, 0, 0], [0, 1, 0]]),
        ("Translate 1 2 3\n", [[1, 2, 3], [2, 2, 3], [1, 3, 3]]),
        ("Scale 2 3 4\n", [[0, 0, 0], [2, 0, 0], [0, 3, 0]]),
        ("Rotate 90 0 0 1\n", [[0, 0, 0], [0, 1, 0], [-1, 0, 0]]),
        ("Rotate 90 1 0 0\n", [[0, 0, 0], [1, 0, 0], [0, 0, 1]]),
        ("Rotate -90 0 -7 0\n", [[0, 0, 0], [0, 0, -1], [0, 1, 0]]),
        ("Translate 1 2 3 Scale 2 2 2\n", [[1, 2, 3], [3, 2, 3], [1, 4, 3]]),
        ("Scale 2 2 2 Translate 1 2 3\n", [[2, 4, 6], [4, 4, 6], [2, 6, 6]]),
        ("Translate 5 5 5 Identity\n", [[0, 0, 0], [1, 0, 0], [0, 1, 0]]),
        # column after column: the images of x, y, z, then of the origin
        ("Transform [ 0 1 0 0  0 0 1 0  1 0 0 0  4 5 6 1 ]\n", [[4, 5, 6], [4, 6, 6], [4, 5, 7]]),
        (("Translate 9 9 9 Transform [ 1 0 0 0  0 1 0 0  0 0 1 0  4 "
"5 6 1 ]\n"), [[4, 5, 6], [5, 5, 6], [4, 6, 6]]),
        (("Scale 2 2 2 ConcatTransform [ 1 0 0 0  0 1 0 0  0 0 1 0  4 "
"5 6 1 ]\n"), [[8, 10, 12], [10, 10, 12], [8, 12, 12]]),
        (('Translate 1 0 0 CoordinateSystem "a" Identity Scale 3 3 3 '
'CoordSysTransform "a"\n'), [[1, 0, 0], [2, 0, 0], [1, 1, 0]]),
        ('Translate 1 0 0 CoordSysTransform "world"\n', [[0, 0, 0], [1, 0, 0], [0, 1, 0]]),
    ],
)  # fmt: skip
def test_directives_move_points_as_pbrt_does(body: str, expected: list[list[float]]) -> None:
    assert points_of(body).tolist() == expected  # exact: quarter turns and small integers leave no rounding


def test_camera_coordinate_system_is_camera_to_world() -> None:
    scene = parse(HEAD + 'CoordSysTransform "camera"\n' + TRIANGLE)
    geometry = scene.shapes[0].geometry
    assert isinstance(geometry, TriangleMesh)
    np.testing.assert_array_equal(geometry.vertices[0], [0, 1, -5])
    np.testing.assert_array_equal(scene.camera.camera_to_world[:3, 3], [0, 1, -5])


def test_look_at_is_left_handed_as_in_pbrt() -> None:
    to_world = look_at(np.array([0, 1.0, -5]), np.array([0, 1.0, 0]), Y).inverse
    np.testing.assert_array_equal(to_world, [[1, 0, 0, 0], [0, 1, 0, 1], [0, 0, 1, -5], [0, 0, 0, 1]])
    from_front = look_at(np.array([0, 0.0, 5]), np.zeros(3), Y).inverse[:3, :3]
    np.testing.assert_array_equal(from_front[:, 0], -X)  # from +z the picture's right is -x: mirrored
    assert np.linalg.det(from_front) == pytest.approx(1)


def test_look_at_agrees_with_its_definition_at_an_oblique_view() -> None:
    eye, target, up = np.array([1.0, 2, 3]), np.array([-2.0, 0.5, 1]), np.array([0.1, 2, 0.3])
    transform = look_at(eye, target, up)
    rotation = transform.inverse[:3, :3]
    forward = (target - eye) / np.linalg.norm(target - eye)
    np.testing.assert_allclose(rotation[:, 2], forward, atol=1e-15)
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-15)
    assert rotation[:, 1] @ up > 0
    assert abs(rotation[:, 0] @ up) < 1e-15
    np.testing.assert_array_equal(transform.inverse[:3, 3], eye)
    np.testing.assert_allclose(transform.points(eye[None]), np.zeros((1, 3)), atol=1e-14)


def random_transforms() -> list[Transform]:
    rng = np.random.default_rng(7)
    made = [translate(*rng.normal(size=3).tolist()), scale(*rng.uniform(0.3, 3, 3).tolist())]
    made += [rotate(float(rng.uniform(-400, 400)), *rng.normal(size=3).tolist()) for _ in range(3)]
    columns = np.vstack([rng.normal(size=(3, 3)), [1.0, 2, 3]])
    made.append(from_matrix(np.column_stack([columns, [0.0, 0, 0, 1]]).ravel().tolist()))
    return made


def test_inverses_undo() -> None:
    made = random_transforms()
    for first in made:
        for second in made:
            both = first @ second
            np.testing.assert_allclose(both.matrix @ both.inverse, np.eye(4), atol=1e-12)
            np.testing.assert_allclose(both.matrix, first.matrix @ second.matrix, atol=1e-13)


def test_rotation_agrees_with_rodrigues() -> None:
    v, axis, angle = np.array([0.3, -2, 0.7]), np.array([1.0, 2, -0.5]), 37.0
    k, theta = axis / np.linalg.norm(axis), np.radians(angle)
    expected = v * np.cos(theta) + np.cross(k, v) * np.sin(theta) + k * (k @ v) * (1 - np.cos(theta))
    np.testing.assert_allclose(rotate(angle, *axis.tolist()).points(v[None])[0], expected, atol=1e-15)


def test_handedness() -> None:
    assert scale(-1.0, 1.0, 1.0).swaps_handedness
    assert not scale(-1.0, -1.0, 1.0).swaps_handedness
    assert scale(-1e-9, 1e-9, 1e-9).swaps_handedness  # a determinant of -1e-27
    assert not rotate(123.0, 1.0, 2.0, 3.0).swaps_handedness


def test_unit_is_idempotent_to_the_bit() -> None:
    for v in np.random.default_rng(1).normal(size=(500, 3)):
        once = unit(v)
        assert unit(once).tobytes() == once.tobytes()
    np.testing.assert_allclose(unit(np.array([3e-200, 4e-200, 0])), [0.6, 0.8, 0], atol=1e-15)
    np.testing.assert_allclose(unit(np.array([3e200, 4e200, 0])), [0.6, 0.8, 0], atol=1e-15)


def test_uniform_scale_tells_similarities_from_stretching() -> None:
    turn = rotate(31.0, 1.0, 2.0, 3.0)
    assert uniform_scale((turn @ scale(2.5, 2.5, -2.5)).matrix[:3, :3]) == pytest.approx(2.5)
    assert uniform_scale((turn @ scale(2.5, 2.5, 2.4)).matrix[:3, :3]) is None
    assert uniform_scale((scale(1.0, 1.0, 1.001) @ turn).matrix[:3, :3]) is None
    assert uniform_scale(turn.matrix[:3, :3]) == 1.0


@pytest.mark.parametrize(
    ("body", "column", "words"),
    [
        ('Scale 1 0 1 Shape "sphere"', 13, ("flattens space",)),
        ("Rotate 30 0 0 0", 1, ("Rotate", "zero vector")),
        ("LookAt 1 2 3  1 2 3  0 1 0", 1, ("LookAt",)),
        ("LookAt 0 5 0  0 1 0  0 1 0", 1, ("LookAt", "up vector")),
        ("LookAt 0 5 0  0 1 0  0 0 0", 1, ("LookAt",)),
        ('Transform [ 1 0 0 0  2 0 0 0  0 0 1 0  0 0 0 1 ] Shape "disk"', 50, ("inverse",)),
        ('Transform [ 1 2 3 0  4 5 6 0  7 8 9 0  0 0 0 1 ] Shape "disk"', 50, ("inverse",)),
        ("Transform [ 1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 0 ]", 1, ("inverse",)),
        ('Transform [ 1 0 0 0  0 1 0 0  0 0 1 1  0 0 0 1 ] Shape "sphere"', 50, ("0 0 0 1",)),
        ("Transform [ 1 0 0 0 ]", 1, ("16 numbers, not 4",)),
        ("Transform 1 0 0 0", 11, ("brackets",)),
        ("Translate 1 2", 1, ("3 numbers",)),
        ("Translate 1 2 north", 15, ("north",)),
        ("Translate 1 2 nan", 15, ("nan",)),
        ("Translate 1 2 1e999", 15, ("range",)),
        ("Translate 1 2 1e30", 1, ("range",)),
        ("Scale 1e-30 1 1", 1, ("range",)),
        ("Translate 1 2 0x10", 15, ("0x10",)),
        ("Translate 1 2 1_0", 15, ("1_0",)),
        ('Translate 1 2 "3"', 15, ('"3"',)),
        ("Translate 1 2 ]", 15, ("]",)),
        ("CoordinateSystem name", 18, ("quoted string",)),
    ],
)  # fmt: skip
def test_what_is_no_transformation_is_refused(body: str, column: int, words: tuple[str, ...]) -> None:
    world_fails(body, 1, column, *words)


def test_a_chain_of_small_scales_stops_where_numbers_end() -> None:
    world_fails("\n".join(["Scale .001 .001 .001"] * 8), 7, 1, "range")


def test_camera_may_be_any_invertible_map() -> None:
    """A uniform scale stretches rays alone and is taken out; anything else is kept as the file has it."""
    plain, mirrored = parse(HEAD).camera, parse("Scale -1 1 1\n" + HEAD).camera
    np.testing.assert_array_equal(mirrored.camera_to_world, plain.camera_to_world * [[-1, 1, 1, 1]])
    large = parse("Scale 4 4 4\n" + HEAD).camera
    np.testing.assert_allclose(large.camera_to_world, plain.camera_to_world, atol=1e-15)
    tall = parse("Scale 1 2 1\n" + HEAD).camera.camera_to_world
    np.testing.assert_allclose(tall, plain.camera_to_world * [[1, 0.5, 1, 1]], atol=1e-15)


def test_many_turns_are_no_turn() -> None:
    np.testing.assert_array_equal(
        rotate(360.0 * 2**40 + 90, 1.0, 2.0, 3.0).matrix, rotate(90.0, 1.0, 2.0, 3.0).matrix
    )
    huge = rotate(1e200, 1.0, 2.0, 3.0).matrix[:3, :3]  # whatever it is, it is a rotation
    np.testing.assert_allclose(huge.T @ huge, np.eye(3), atol=1e-14)
