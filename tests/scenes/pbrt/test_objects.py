"""Blocks, objects and their instances, imported files, `Attribute`: what of the state reaches what."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from scenes.description.materials import Diffuse
from scenes.description.scene import SceneDescription
from scenes.description.shapes import BilinearMesh, Disk, Sphere, TriangleMesh
from scenes.errors import SceneError
from scenes.pbrt import instances
from scenes.pbrt import state as builder
from scenes.pbrt.parser import parse_file
from scenes.pbrt.text import syntax
from tests.kit.scene_texts import HEAD, PATCH, TRIANGLE, face_normals, world, world_fails

RED = 'Material "diffuse" "rgb reflectance" [ 1 0 0 ] '
BALL = 'Shape "sphere" "float radius" .5 '


def color(scene: SceneDescription, index: int = 0) -> list[float]:
    material = scene.shapes[index].material
    assert isinstance(material, Diffuse)
    assert isinstance(material.reflectance, np.ndarray)
    return material.reflectance.tolist()


def mesh(scene: SceneDescription, index: int = 0) -> TriangleMesh:
    geometry = scene.shapes[index].geometry
    assert isinstance(geometry, TriangleMesh)
    return geometry


def test_transform_blocks_are_attribute_blocks() -> None:
    """As in pbrt-v4, which warns: the material does not outlive the block either."""
    scene = world(f"TransformBegin Translate 1 0 0 {RED} TransformEnd {TRIANGLE}")
    assert color(scene) == [0.5, 0.5, 0.5]
    assert mesh(scene).vertices[0].tolist() == [0, 0, 0]
    assert world(f"TransformBegin AttributeEnd {TRIANGLE}").shapes


def test_an_object_alone_is_nothing() -> None:
    assert world(f'ObjectBegin "o" {TRIANGLE} ObjectEnd').shapes == ()


def test_an_instance_stands_where_its_transformation_and_the_object_s_put_it() -> None:
    scene = world(
        f'Translate 0 0 1 ObjectBegin "o" {RED} Scale 2 2 2 {TRIANGLE} ObjectEnd Translate 3 0 0 '
        'ObjectInstance "o"'
    )
    assert mesh(scene).vertices.tolist() == [[3, 0, 2], [5, 0, 2], [3, 2, 2]]
    assert color(scene) == [1, 0, 0]


def test_an_object_may_be_made_after_its_instance() -> None:
    assert len(world(f'ObjectInstance "o" ObjectBegin "o" {TRIANGLE} ObjectEnd').shapes) == 1


def test_the_state_in_an_object_does_not_reach_outside() -> None:
    scene = world(f'ObjectBegin "o" {RED} ReverseOrientation Translate 1 1 1 ObjectEnd {TRIANGLE}')
    assert color(scene) == [0.5, 0.5, 0.5]
    assert (mesh(scene).reverse, mesh(scene).vertices[0].tolist()) == (False, [0, 0, 0])


def test_instances_of_one_material_are_one_mesh() -> None:
    both = f'ObjectBegin "o" {TRIANGLE} {RED} {TRIANGLE} {PATCH} ObjectEnd '
    scene = world(both + "".join(f'Translate {i} 0 0 ObjectInstance "o" ' for i in range(3)))
    gray, red, patches = scene.shapes
    assert isinstance(gray.geometry, TriangleMesh)
    assert isinstance(red.geometry, TriangleMesh)
    assert isinstance(patches.geometry, BilinearMesh)
    assert gray.geometry.vertices[:, 0].tolist() == [0, 1, 0, 1, 2, 1, 3, 4, 3]
    assert gray.geometry.faces.tolist() == [[0, 1, 2], [3, 4, 5], [6, 7, 8]]
    assert patches.geometry.faces.tolist() == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]]
    assert color(scene, 1) == [1, 0, 0]
    assert str(gray.where).startswith("<text>:7:")


@pytest.mark.parametrize("state", ["", "ReverseOrientation "])
@pytest.mark.parametrize("mirror", ["", "Scale -1 1 1 ", "Scale 1 1 -1 "])
def test_a_mirrored_instance_faces_where_its_mirrored_shape_would(state: str, mirror: str) -> None:
    instance = mesh(world(f'ObjectBegin "o" {state}{TRIANGLE} ObjectEnd {mirror}ObjectInstance "o"'))
    shape = mesh(world(f"{mirror}{state}{TRIANGLE}"))
    normals = [face_normals(m.vertices, m.faces, m.reverse).tolist() for m in (instance, shape)]
    assert normals[0] == normals[1]


def test_instances_that_face_either_way_are_two_meshes() -> None:
    scene = world(
        f'ObjectBegin "o" {TRIANGLE} ObjectEnd ObjectInstance "o" Scale -1 1 1 ObjectInstance "o" '
        'ObjectInstance "o"'
    )
    assert [mesh(scene, i).reverse for i in range(len(scene.shapes))] == [False, True]


def test_instances_of_quadrics() -> None:
    scene = world(
        f'ObjectBegin "o" Translate 0 1 0 {BALL} Shape "disk" ObjectEnd Scale 2 -2 2 ObjectInstance "o"'
    )
    ball, disk = (shape.geometry for shape in scene.shapes)
    assert isinstance(ball, Sphere)
    assert isinstance(disk, Disk)
    assert (ball.center.tolist(), ball.radius, ball.reverse) == ([0, -2, 0], 1, True)
    assert (disk.center.tolist(), disk.radius, disk.normal.tolist()) == ([0, -2, 0], 2, [0, 0, -1])


def test_a_million_triangles_by_instances_take_seconds(tmp_path: Path) -> None:
    """0.3 s on the machine where this was written; one shape at a time, with its own checks, would take ten
    times as long.
    """
    rng = np.random.default_rng(3)
    points = " ".join(f"{x:.4f}" for x in rng.normal(size=1500))
    faces = " ".join(str(i) for i in rng.integers(0, 500, 3000))
    tree = (
        f'ObjectBegin "tree" Shape "trianglemesh" "point3 P" [ {points} ] "integer indices" [ {faces} ] '
        "ObjectEnd\n"
    )
    uses = "".join(
        f'AttributeBegin Translate {i} 0 0 Rotate {i} 0 1 0 ObjectInstance "tree" AttributeEnd\n'
        for i in range(1000)
    )
    (tmp_path / "s.pbrt").write_text(HEAD + tree + uses)
    start = time.process_time()
    (forest,) = parse_file(tmp_path / "s.pbrt").shapes
    assert time.process_time() - start < 5
    assert isinstance(forest.geometry, TriangleMesh)
    assert forest.geometry.faces.shape == (1_000_000, 3)
    assert forest.geometry.vertices.shape == (500_000, 3)


def test_too_many_instances_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(instances, "FACES", 5)
    objects = f'ObjectBegin "o" {TRIANGLE} {TRIANGLE} ObjectEnd\n'
    assert world(objects + 'ObjectInstance "o"\n' * 2).shapes
    world_fails(objects + 'ObjectInstance "o"\n' * 3, 4, 1, "more than 5 faces")
    monkeypatch.setattr(instances, "SINGLES", 1)
    world_fails(
        f'ObjectBegin "o" {BALL} ObjectEnd\nObjectInstance "o"\nObjectInstance "o"',
        3,
        1,
        "1 spheres and disks",
    )


def test_a_file_that_makes_too_much_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(builder, "COUNT_LIMIT", 3)
    monkeypatch.setattr(syntax, "PARAMETERS", 3)
    for line, what in (
        ('Shape "sphere"', "shapes"),
        ('LightSource "distant"', "lights"),
        ('MakeNamedMaterial "{}" "string type" "diffuse"', "materials"),
        ('Texture "{}" "float" "constant"', "textures"),
        ('ObjectBegin "{}" ObjectEnd', "objects"),
    ):
        text = "\n".join(line.format(i) for i in range(4))
        world_fails(text, 4, 1, f"more than 3 {what}")
    many = " ".join(f'"float p{i}" 1' for i in range(4))
    world_fails(f'Shape "sphere" {many}', 1, 16 + 3 * len('"float p0" 1 '), "more than 3 parameters")


@pytest.mark.parametrize(
    ("body", "column", "words"),
    [
        ('ObjectInstance "gone"', 1, ("'gone'", "none")),
        ('ObjectBegin "o" ObjectInstance "o" ObjectEnd', 17, ("do not nest",)),
        ('ObjectBegin "o" ObjectBegin "p" ObjectEnd ObjectEnd', 17, ("inside another object",)),
        ('ObjectBegin "o" ObjectEnd ObjectBegin "o" ObjectEnd', 27, ("made twice",)),
        ('ObjectBegin "o"', 1, ("ObjectBegin without ObjectEnd",)),
        ("ObjectEnd", 1, ("without ObjectBegin",)),
        ('ObjectBegin "o" AttributeEnd', 17, ("ObjectBegin is open",)),
        ('ObjectBegin "o" AttributeBegin ObjectEnd', 32, ("AttributeBegin is open",)),
        ("TransformBegin", 1, ("TransformBegin without TransformEnd",)),
        ((f'ObjectBegin "o" Scale 100 1 1 {TRIANGLE} ObjectEnd Scale 1e17 1 1 '
'ObjectInstance "o"'), 112, ("1e+18",)),
    ],
)  # fmt: skip
def test_objects_that_cannot_be_are_refused_where_they_stand(
    body: str, column: int, words: tuple[str, ...]
) -> None:
    world_fails(body, 1, column, *words)


def test_attributes_are_defaults_that_may_stay_unused() -> None:
    body = 'Attribute "shape" "float radius" 2 "float height" 1 "point3 nonsense" [ 0 0 0 ]\n'
    disk, sphere, own = (
        shape.geometry for shape in world(body + 'Shape "disk" Shape "sphere" ' + BALL).shapes
    )
    assert isinstance(disk, Disk)
    assert isinstance(sphere, Sphere)
    assert isinstance(own, Sphere)
    assert (disk.radius, disk.center.tolist(), sphere.radius, own.radius) == (2, [0, 0, 1], 2, 0.5)


def test_the_last_attribute_holds_until_its_block_ends() -> None:
    body = (
        'Attribute "shape" "float radius" 2\nAttributeBegin Attribute "shape" "float radius" 3 Shape '
        '"sphere" AttributeEnd '
    )
    inner, outer = (shape.geometry for shape in world(body + 'Shape "sphere"').shapes)
    assert isinstance(inner, Sphere)
    assert isinstance(outer, Sphere)
    assert (inner.radius, outer.radius) == (3, 2)


def test_attributes_of_lights_and_materials() -> None:
    body = 'Attribute "light" "float scale" 3 Attribute "material" "rgb reflectance" [ 1 0 0 ] '
    scene = world(body + f'LightSource "distant" Material "diffuse" AreaLightSource "diffuse" {BALL}')
    assert color(scene) == [1, 0, 0]
    (shape,) = scene.shapes
    assert shape.emission is not None
    assert shape.emission.radiance.tolist() == [3, 3, 3]
    (light,) = scene.lights
    assert light.irradiance.tolist() == [3, 3, 3]  # pyright: ignore[reportAttributeAccessIssue]


def import_scene(folder: Path, part: str, main: str = 'Import "part.pbrt"\n') -> Path:
    (folder / "part.pbrt").write_text(part)
    (folder / "main.pbrt").write_text(HEAD + main)
    return folder / "main.pbrt"


def test_an_imported_file_does_not_change_the_state(tmp_path: Path) -> None:
    part = (
        f'{RED} Translate 1 0 0 ReverseOrientation MakeNamedMaterial "m" "string type" "diffuse" {TRIANGLE}'
    )
    scene = parse_file(
        import_scene(
            tmp_path, part, f'Translate 0 1 0 Import "part.pbrt" {TRIANGLE} NamedMaterial "m" {BALL}'
        )
    )
    assert [color(scene, i) for i in range(3)] == [[1, 0, 0], [0.5, 0.5, 0.5], [0.5, 0.5, 0.5]]
    assert [mesh(scene, i).vertices[0].tolist() for i in range(2)] == [[1, 1, 0], [0, 1, 0]]
    assert [mesh(scene, i).reverse for i in range(2)] == [True, False]


def test_an_included_file_does(tmp_path: Path) -> None:
    scene = parse_file(import_scene(tmp_path, RED, f'Include "part.pbrt" {TRIANGLE}'))
    assert color(scene) == [1, 0, 0]


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ("\n AttributeBegin", r"part\.pbrt:2:2: AttributeBegin without AttributeEnd"),
        ("ObjectEnd", r"part\.pbrt:1:1: ObjectEnd without ObjectBegin"),
        ("Translate 1 2", r"part\.pbrt:1:1: the file ends after Translate"),
        ('Import "main.pbrt"', r"part\.pbrt:1:1: .*includes itself"),
    ],
)
def test_imported_files_are_whole(tmp_path: Path, part: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        parse_file(import_scene(tmp_path, part, 'AttributeBegin Import "part.pbrt" AttributeEnd 3'))
