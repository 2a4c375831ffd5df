"""Shapes in world space: what pbrt-v4's source makes of them, their orientation, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.description.patches import curved, patch_problem
from scenes.description.shapes import BilinearMesh, Disk, Quadric, Sphere, TriangleMesh
from tests.kit.scene_texts import PATCH, TRIANGLE, face_normals, world, world_fails

LIGHT = 'AreaLightSource "diffuse"\n'


def sphere_of(body: str) -> Sphere:
    geometry = world(body).shapes[0].geometry
    assert isinstance(geometry, Sphere)
    return geometry


def disk_of(body: str) -> Disk:
    geometry = world(body).shapes[0].geometry
    assert isinstance(geometry, Disk)
    return geometry


def normals_of(body: str) -> list[list[float]]:
    geometry = world(body).shapes[0].geometry
    assert isinstance(geometry, TriangleMesh | BilinearMesh)
    return face_normals(geometry.vertices, geometry.faces, geometry.reverse).tolist()


# pbrt-v4: the normal of a triangle and of a patch is turned by ReverseOrientation xor a mirroring
# transformation.
# A mirrored mesh keeps the normal that the mirrored surface would have (the mirror image of the old one).
@pytest.mark.parametrize(
    ("state", "normal"),
    [
        ("", [0, 0, 1]),
        ("ReverseOrientation\n", [0, 0, -1]),
        ("Scale -1 1 1\n", [0, 0, 1]),
        ("Scale 1 1 -1\n", [0, 0, -1]),
        ("Scale -1 1 1 ReverseOrientation\n", [0, 0, -1]),
        ("Scale -1 -1 1\n", [0, 0, 1]),
        ("ReverseOrientation ReverseOrientation\n", [0, 0, 1]),
        ("Rotate 180 1 0 0\n", [0, 0, -1]),
    ],
)
@pytest.mark.parametrize("shape", [TRIANGLE, PATCH])
def test_orientation_of_flat_shapes(shape: str, state: str, normal: list[float]) -> None:
    assert normals_of(state + shape) == [normal]


def test_a_triangle_mesh_is_taken_as_it_stands() -> None:
    body = (
        'Shape "trianglemesh" "point3 P" [ 0 0 0  1 0 0  0 1 0  9 9 9 ] "integer indices" [ 2 0 1  0 0 '
        '0 ] "point2 uv" '
    )
    geometry = world(body + "[ 0 0 0 0 0 0 0 0 ]").shapes[0].geometry
    assert isinstance(geometry, TriangleMesh)
    assert geometry.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9]]
    assert geometry.faces.tolist() == [[2, 0, 1], [0, 0, 0]]  # pbrt never hits a triangle without area
    assert (geometry.vertices.dtype, geometry.faces.dtype) == (np.float64, np.int64)


def test_negative_zero_is_written_as_zero() -> None:
    geometry = world('Shape "trianglemesh" "point3 P" [ -0 -0.0 0  1 0 0  0 1 0 ]').shapes[0].geometry
    assert isinstance(geometry, TriangleMesh)
    assert not np.signbit(geometry.vertices).any()


@pytest.mark.parametrize(
    ("body", "center", "radius", "reverse"),
    [
        ('Shape "sphere"', [0, 0, 0], 1, False),
        ('Translate 1 2 3 Scale 2 2 2 Shape "sphere" "float radius" 0.25', [1, 2, 3], 0.5, False),
        ('Scale 3 -3 3 Translate 0 1 0 Shape "sphere"', [0, -3, 0], 3, True),
        ('Scale 3 -3 3 ReverseOrientation Shape "sphere"', [0, 0, 0], 3, False),
        (
            'ReverseOrientation Shape "sphere" "float zmin" -1 "float zmax" 1 "float phimax" 360',
            [0, 0, 0],
            1,
            True,
        ),
    ],
)
def test_spheres(body: str, center: list[float], radius: float, reverse: bool) -> None:
    sphere = sphere_of(body)
    assert (sphere.center.tolist(), sphere.radius, sphere.reverse) == (center, radius, reverse)


def test_a_rotated_sphere_keeps_its_radius_to_the_bit() -> None:
    assert sphere_of('Rotate 37 1 2 3 Rotate 81 3 -2 1 Shape "sphere" "float radius" 0.7').radius == 0.7


@pytest.mark.parametrize(
    ("body", "center", "normal", "radius"),
    [
        ('Shape "disk"', [0, 0, 0], [0, 0, 1], 1),
        ('Shape "disk" "float height" 2 "float radius" 3', [0, 0, 2], [0, 0, 1], 3),
        ('Translate 1 2 3 Rotate 90 1 0 0 Shape "disk" "float height" 2', [1, 0, 3], [0, -1, 0], 1),
        ('ReverseOrientation Shape "disk"', [0, 0, 0], [0, 0, -1], 1),
        # z to -z, and turned for mirroring
        ('Scale 1 1 -2 Shape "disk" "float height" 1', [0, 0, -2], [0, 0, 1], 1),
        ('Scale -2 2 5 Shape "disk"', [0, 0, 0], [0, 0, -1], 2),
        # sheared along the disk's plane: still that disk, and the normal is no image of a vector
        (('ConcatTransform [ 1 0 0 0  0 1 0 0  1 0 1 0  0 0 0 1 ] Shape "disk" "float '
'height" 1'), [1, 0, 1], [0, 0, 1], 1),
    ],
)  # fmt: skip
def test_disks(body: str, center: list[float], normal: list[float], radius: float) -> None:
    disk = disk_of(body)
    assert (disk.center.tolist(), disk.normal.tolist(), disk.radius) == (center, normal, radius)


def test_a_light_on_a_disk_shines_along_its_normal() -> None:
    assert disk_of(LIGHT + 'Rotate 90 1 0 0 Shape "disk"').normal.tolist() == [0, -1, 0]
    assert disk_of(LIGHT + 'ReverseOrientation Rotate 90 1 0 0 Shape "disk"').normal.tolist() == [0, 1, 0]


@pytest.mark.parametrize("shape", ["sphere", "disk"])
def test_a_mirrored_one_sided_light_is_refused_where_pbrt_contradicts_itself(shape: str) -> None:
    world_fails(LIGHT + f'Scale -1 1 1\nShape "{shape}"', 3, 1, "mirroring", "ReverseOrientation")
    assert (
        world(f'AreaLightSource "diffuse" "bool twosided" true Scale -1 1 1 Shape "{shape}"')
        .shapes[0]
        .emission
    )
    assert world(LIGHT + f'Scale -1 -1 1 Shape "{shape}"').shapes[0].emission


def test_a_mirrored_patch_that_emits_is_as_clear_as_any() -> None:
    assert normals_of(LIGHT + "Scale 1 1 -1\n" + PATCH) == [[0, 0, -1]]


def test_a_patch_without_indices_is_one_patch() -> None:
    geometry = world(PATCH).shapes[0].geometry
    assert isinstance(geometry, BilinearMesh)
    assert geometry.faces.tolist() == [[0, 1, 2, 3]]


CORNERS = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0], [2, 1, 0]])
ONE = np.array([[0, 1, 2, 3]])


@pytest.mark.parametrize("lift", [1e-3, 1e-5])
def test_a_warped_patch_is_curved(lift: float) -> None:
    warped = CORNERS + np.array([[0, 0, lift], [0, 0, 0], [0, 0, 0], [0, 0, 0]])
    assert curved(warped, ONE).tolist() == [True]


def test_a_patch_may_be_off_its_plane_by_rounding() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        frame, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turned = CORNERS @ frame.T + rng.normal(size=3) * 100
        assert not curved(turned, ONE).any()
        assert not curved(turned.astype(np.float32).astype(np.float64), ONE).any()


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_planarity_is_judged_at_the_patch_s_own_size(size: float) -> None:
    assert not curved(CORNERS * size, ONE).any()
    assert curved((CORNERS + np.diag([0.001, 0, 0, 0])[:, [1, 2, 0]]) * size, ONE).all()


def test_order_and_shape_of_a_patch() -> None:
    assert "p00 p10 p01 p11" in (
        patch_problem(CORNERS, np.array([[0, 1, 3, 2]])) or ""
    )  # corners round the face
    dart = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0.4, 0.4, 0]])
    assert "not convex" in (patch_problem(dart, ONE) or "")
    assert (
        patch_problem(np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [1.5, 1.2, 0]]), ONE) is None
    )  # a trapezium is fine
    assert "no area" in (patch_problem(CORNERS * [1, 0, 1], ONE) or "")
    assert (
        patch_problem(CORNERS[[0, 0, 2, 3]], ONE) is None
    )  # two corners in one: pbrt takes it for a triangle


def test_bounds_beyond_a_whole_shape_cut_nothing_off() -> None:
    plain = world('Shape "sphere" Shape "disk"').content_hash()
    cut = 'Shape "sphere" "float zmin" -10 "float zmax" 10 "float phimax" 400 Shape "disk" "float phimax" 361'
    assert world(cut).content_hash() == plain
    for some in ('"float zmin" -0.9', '"float zmax" 0.9', '"float phimax" 359'):
        (part,) = world(f'Shape "sphere" {some}').shapes
        assert isinstance(part.geometry, Quadric)


def test_faces_without_area_shed_no_light() -> None:
    points = '"point3 P" [ 0 0 0  1 0 0  0 1 0  2 0 0 ]'
    (shape,) = world(f'{LIGHT}Shape "trianglemesh" {points} "integer indices" [ 0 1 3 0 1 2 ]').shapes
    assert isinstance(shape.geometry, TriangleMesh)
    assert shape.geometry.faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("body", "column", "words"),
    [
        ('Shape "trianglemesh"', 1, ('needs "point3 P"',)),
        ('Shape "trianglemesh" "point3 P" [ 0 0 0  1 0 ]', 22, ("groups of 3",)),
        ('Shape "trianglemesh" "point3 P" [ ]', 22, ("groups of 3",)),
        ('Shape "trianglemesh" "point3 P" [ 0 0 0 1 1 1 2 2 2 3 3 3 ]', 1, ("integer indices",)),
        (TRIANGLE + ' "integer indices" [ 0 1 ]', len(TRIANGLE) + 2, ("groups of 3",)),
        (TRIANGLE + ' "integer indices" [ ]', len(TRIANGLE) + 2, ("groups of 3",)),
        (TRIANGLE + (' "integer indices" '
'[ 0 1 3 ]'), len(TRIANGLE) + 26, ("index 3 is out of range", "3 points")),
        (TRIANGLE + ' "integer indices" [ 0 -1 2 ]', len(TRIANGLE) + 24, ("index -1",)),
        (TRIANGLE + ' "integer indices" [ 0 1.5 2 ]', len(TRIANGLE) + 24, ("whole number",)),
        (
            'AreaLightSource "diffuse" ' + TRIANGLE + ' "normal N" [ 0 0 1 0 0 -1 0 0 1 ]',
            len(TRIANGLE) + 28,
            ("both sides",),
        ),
        (TRIANGLE + ' "texture alpha" "holes"', len(TRIANGLE) + 2, ("no float texture is called 'holes'",)),
        ('Shape "trianglemesh" "point3 P" [ 0 0 0  1 0 0  0 1 nan ]', 53, ("nan",)),
        ('Shape "trianglemesh" "point3 P" [ 0 0 0  1 0 0  0 1 1e19 ]', 1, ("1e+18",)),
        ("Scale 1e17 1 1 " + TRIANGLE.replace("1 0 0", "100 0 0"), 16, ("1e+18",)),
        ('Shape "bilinearmesh" "point3 P" [ 0 0 0  1 0 0  1 1 0  0 1 0 ]', 1, ("p00 p10 p01 p11",)),
        ('Shape "sphere" "float radius" 0', 16, ("positive", "0")),
        ('Shape "sphere" "float radius" -2', 16, ("positive", "-2")),
        ('Shape "sphere" "float radius" 1e-30', 1, ("too small",)),
        ('Shape "sphere" "float radius" 1e30', 1, ("1e+18",)),
        ('Shape "cylinder" "float radius" -2', 18, ("positive", "-2")),
        (LIGHT.strip() + ' Shape "cylinder" "float zmin" 1', 27, ("no area",)),
        (LIGHT.strip() + ' Shape "disk" "float innerradius" 2', 27, ("no area",)),
        (LIGHT.strip() + ' Shape "trianglemesh" "point3 P" [ 0 0 0  1 0 0  2 0 0 ]', 27, ("no area",)),
        ('Shape "plymesh"', 1, ('"string filename"',)),
        ('Shape "plymesh" "string filename" "a.obj"', 17, (".ply",)),
        ('Shape "plymesh" "string filename" "gone.ply"', 17, ("gone.ply", "No such file")),
    ],
)  # fmt: skip
def test_shapes_that_cannot_be_are_refused_where_they_stand(
    body: str, column: int, words: tuple[str, ...]
) -> None:
    world_fails(body, 1, column, *words)
