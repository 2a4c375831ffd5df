"""Images on rectangles, however a file gives these: where each corner of the image comes to lie, and on which
side it shines.
"""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from scenes.description.shapes import BilinearMesh, ShapeDescription
from scenes.errors import SceneError
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse_file
from tests.kit.scene_texts import HEAD, face_normals

P = np.array([[0.0, 0, 0], [3, 0, 0], [0, 2, 0], [3, 2, 0]])  # p00 p10 p01 p11
UV = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
# The corners of a rectangle, in a patch's order, by the symmetries of the square: those that leave opposite
# corners opposite.
SYMMETRIES = [order for order in permutations(range(4)) if order[0] + order[3] == 3]
assert len(SYMMETRIES) == 8


def light(folder: Path, shape: str, power: str = "") -> ShapeDescription:
    write_exr(folder / "a.exr", {name: np.array([[1.0, 2, 3], [4, 5, 6]]) for name in "RGB"})
    text = f'{HEAD}AreaLightSource "diffuse" "string filename" "a.exr" {power}\n{shape}'
    (folder / "s.pbrt").write_text(text)
    (shape_,) = parse_file(folder / "s.pbrt").shapes
    return shape_


def numbers(values: np.ndarray) -> str:
    return " ".join(map(str, values.ravel().tolist()))


def corners(shape: ShapeDescription) -> np.ndarray:
    """The corners of the one rectangle in the order of the image's, to be looked up by its own parameters."""
    assert isinstance(shape.geometry, BilinearMesh)
    assert shape.geometry.uv is None
    return shape.geometry.vertices[shape.geometry.faces][0]


def normal(shape: ShapeDescription) -> list[float]:
    assert isinstance(shape.geometry, BilinearMesh)
    mesh = shape.geometry
    return face_normals(mesh.vertices, mesh.faces[:, :3], mesh.reverse)[0].tolist()


@pytest.mark.parametrize("reverse", ["", "ReverseOrientation "])
@pytest.mark.parametrize("order", SYMMETRIES)
def test_a_patch_with_any_corners_of_the_image(order: tuple[int, ...], reverse: str, tmp_path: Path) -> None:
    uv = UV[list(order)]
    shape = light(
        tmp_path, f'{reverse}Shape "bilinearmesh" "point3 P" [ {numbers(P)} ] "point2 uv" [ {numbers(uv)} ]'
    )
    for point, at in zip(P, uv, strict=True):
        assert corners(shape)[int(at[0] + 2 * at[1])].tolist() == point.tolist()
    assert normal(shape) == [0, 0, -1 if reverse else 1]


@pytest.mark.parametrize("faces", ["0 1 3 0 3 2", "3 2 0 1 3 0", "0 1 2 3 2 1", "2 0 1 1 3 2"])
@pytest.mark.parametrize("order", SYMMETRIES)
def test_two_triangles(order: tuple[int, ...], faces: str, tmp_path: Path) -> None:
    uv = UV[list(order)]
    mesh = f'"point3 P" [ {numbers(P)} ] "point2 uv" [ {numbers(uv)} ] "integer indices" [ {faces} ]'
    shape = light(tmp_path, f'Shape "trianglemesh" {mesh}')
    for point, at in zip(P, uv, strict=True):
        assert corners(shape)[int(at[0] + 2 * at[1])].tolist() == point.tolist()
    assert normal(shape) == [0, 0, 1]


def test_a_power_is_that_of_each_triangle_as_in_pbrt(tmp_path: Path) -> None:
    """The mean of the image is 3.5 and a triangle has half of the area, 6."""
    mesh = f'"point3 P" [ {numbers(P)} ] "point2 uv" [ {numbers(UV)} ] "integer indices" [ 0 1 3 0 3 2 ]'
    halves = light(tmp_path, f'Shape "trianglemesh" {mesh}', '"float power" 7').emission
    whole = light(tmp_path, f'Shape "bilinearmesh" "point3 P" [ {numbers(P)} ]', '"float power" 7').emission
    assert halves is not None
    assert whole is not None
    np.testing.assert_allclose(whole.radiance, 7 / (3.5 * np.pi * 6), rtol=1e-14)
    np.testing.assert_allclose(halves.radiance, 7 / (3.5 * np.pi * 3), rtol=1e-14)


@pytest.mark.parametrize(
    ("faces", "uv"),
    [
        ("0 1 3 0 2 3", UV),  # one of them faces the other way
        ("0 1 3 0 1 3", UV),  # the same half twice
        ("0 1 3 0 1 2", UV),  # halves by different diagonals, which overlap
        ("0 1 3", UV),
        ("0 1 3 0 3 2", UV * 2),  # four times the image
        ("0 1 3 0 3 2", UV * [1, 0.5]),
        ("0 1 3 0 3 2", UV[[0, 1, 3, 2]]),  # no rectangle in the image
    ],
)
def test_what_does_not_show_the_whole_image_once_is_refused(
    faces: str, uv: np.ndarray, tmp_path: Path
) -> None:
    mesh = f'"point3 P" [ {numbers(P)} ] "point2 uv" [ {numbers(uv)} ] "integer indices" [ {faces} ]'
    with pytest.raises(SceneError, match="rectangles only"):
        light(tmp_path, f'Shape "trianglemesh" {mesh}')
