"""Directives, the attribute stack, materials, lights, includes; and errors at the exact place."""

from __future__ import annotations

from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

from scenes.description.shapes import Emission, Sphere
from scenes.errors import SceneError
from scenes.pbrt.blocks import NESTING_LIMIT
from scenes.pbrt.parser import parse, parse_file
from scenes.pbrt.text import stream
from scenes.pbrt.text.stream import INCLUDE_DEPTH
from tests.kit.scene_texts import HEAD, TRIANGLE, fails, world, world_fails

BALL = 'Shape "sphere"\n'
LIGHT = 'AreaLightSource "diffuse" "rgb L" [ 1 2 3 ]\n'


def reflectances(body: str) -> list[list[float]]:
    return [shape.material.reflectance.tolist() for shape in world(body).shapes]


def test_a_scene_without_lights_or_shapes_is_legal() -> None:
    scene = parse(HEAD, file="some/where/empty.pbrt")
    assert scene.shapes == ()
    assert scene.name == "empty"
    assert (scene.film.width, scene.film.height, scene.camera.fov) == (8, 6, 40.0)


def test_defaults_where_the_file_says_nothing() -> None:
    scene = parse('Camera "perspective"\nWorldBegin\n' + BALL)
    assert (scene.camera.fov, scene.film.width, scene.film.height) == (90.0, 1280, 720)
    assert astuple(scene.defaults) == ("independent", 16, 0, None)
    np.testing.assert_array_equal(scene.camera.camera_to_world, np.eye(4))
    (shape,) = scene.shapes
    assert shape.material.reflectance.tolist() == [0.5, 0.5, 0.5]
    assert shape.emission is None
    assert isinstance(shape.geometry, Sphere)
    assert shape.geometry.radius == 1.0


def test_attributes_are_saved_and_restored() -> None:
    scene = world(
        'Material "diffuse" "rgb reflectance" [ .1 .1 .1 ] Translate 1 0 0\n'
        "AttributeBegin\n"
        + LIGHT
        + 'Material "diffuse" "rgb reflectance" [ .2 .2 .2 ] Translate 0 1 0 ReverseOrientation\n'
        + BALL
        + f"AttributeBegin ReverseOrientation {BALL} AttributeEnd\n"
        + f"AttributeEnd {BALL}"
    )
    inner, nested, outer = scene.shapes
    centers = [shape.geometry.center.tolist() for shape in scene.shapes if isinstance(shape.geometry, Sphere)]
    assert centers == [[1, 1, 0], [1, 1, 0], [1, 0, 0]]
    assert [s.geometry.reverse for s in scene.shapes if isinstance(s.geometry, Sphere)] == [
        True,
        False,
        False,
    ]
    assert [s.material.reflectance[0] for s in scene.shapes] == [0.2, 0.2, 0.1]
    assert isinstance(inner.emission, Emission)
    assert inner.emission.radiance.tolist() == [1, 2, 3]
    assert nested.emission is not None
    assert outer.emission is None


def test_area_light_holds_for_all_shapes_that_follow() -> None:
    first, second, third = world(BALL + LIGHT + BALL + BALL).shapes
    assert first.emission is None
    assert second.emission is third.emission is not None


def test_scale_and_sides_of_a_light() -> None:
    body = 'AreaLightSource "diffuse" "rgb L" [ 1 2 3 ] "float scale" 2 "bool twosided" true ' + BALL
    emission = world(body).shapes[0].emission
    assert emission is not None
    assert emission.radiance.tolist() == [2, 4, 6]
    assert emission.two_sided
    default = world('AreaLightSource "diffuse" ' + BALL).shapes[0].emission
    assert default is not None
    assert default.radiance.tolist() == [1, 1, 1]
    assert not default.two_sided


def test_named_materials_are_found_by_name_also_when_made_later() -> None:
    make = 'MakeNamedMaterial "{}" "string type" "diffuse" "rgb reflectance" [ {} {} {} ]\n'
    body = make.format("a", 0.1, 0.2, 0.3) + 'NamedMaterial "b" ' + BALL + 'NamedMaterial "a" ' + BALL
    assert reflectances(body + make.format("b", 0.4, 0.5, 0.6)) == [[0.4, 0.5, 0.6], [0.1, 0.2, 0.3]]


def test_a_parameter_may_stand_on_many_lines() -> None:
    body = 'Material "diffuse"\n  "rgb reflectance" [\n .1 # red\n .2\n 3e-1 ]\n' + BALL
    assert reflectances(body) == [[0.1, 0.2, 0.3]]


def test_shapes_know_where_they_stand() -> None:
    where = world("\n  " + TRIANGLE).shapes[0].where
    assert str(where) == f"<text>:{HEAD.count(chr(10)) + 2}:3"


@pytest.mark.parametrize(
    ("body", "line", "column", "words"),
    [
        (
            '  LightSource "laser" "rgb I" [ 1 1 1 ]',
            1,
            3,
            ('LightSource "laser"', '"infinite", "distant"'),
        ),
        ('\nTexture "t" "float" "clouds"', 2, 1, ("not supported", '"imagemap"')),
        ('Attribute "camera" "float fov" 1', 1, 1, ('"camera"', "shape, light")),
        ("Shapes", 1, 1, ("unknown directive 'Shapes'", "Shape")),
        ("worldend", 1, 1, ("unknown directive",)),
        ("12", 1, 1, ("unknown directive '12'",)),
        ('"loose"', 1, 1, ("loose",)),
        ("]", 1, 1, ("]",)),
        ("WorldBegin", 1, 1, ("twice",)),
        ('Camera "perspective"', 1, 1, ("before WorldBegin",)),
        ("AttributeBegin AttributeBegin AttributeEnd\n", 1, 1, ("without AttributeEnd",)),
        ('Shape "cube"', 1, 1, ("'cube'", "trianglemesh, plymesh, bilinearmesh, loopsubdiv, sphere, disk")),
        ("Shape", 1, 1, ("quoted string",)),
        ("Shape sphere", 1, 7, ("quoted string",)),
        ('Shape "sphere" "float radius"', 1, 16, ("a value",)),
        ('Shape "sphere" "float radius" [ 1', 1, 31, ("closing ]",)),
        ('Shape "sphere" "float radius" [ 1 [ 2 ] ]', 1, 35, ("[ inside",)),
        ('Shape "sphere" "float radius" [ 1 2 ]', 1, 16, ("one value, not 2",)),
        ('Shape "sphere" "float radius" [ ]', 1, 16, ("one value, not 0",)),
        ('Shape "sphere" "float radius" "1"', 1, 31, ("not a number",)),
        ('Shape "sphere" "double radius" 1', 1, 16, ("'double'", "float, integer")),
        ('Shape "sphere" "radius" 1', 1, 16, ("type name",)),
        ('Shape "sphere" "integer radius" 1', 1, 16, ('"float radius"',)),
        ('Shape "sphere" "float size" 1', 1, 16, ('"float size"', '"float radius"')),
        ('Shape "sphere" "rgb color" [ 1 1 1 ]', 1, 16, ('"rgb color"', "supported parameters")),
        ('Material "hair"', 1, 1, ('"hair"', "--substitute renders it as diffuse of its colour")),
        ('Material "diffuse" "rgb reflectance" [ .5 .5 ]', 1, 20, ("three numbers, not 2",)),
        ('Material "diffuse" "rgb reflectance" [ .5 -.5 .5 ]', 1, 43, ("negative",)),
        ('Material "diffuse" "rgb reflectance" [ .5 1.5 .5 ]', 1, 20, ("at most 1",)),
        ('Material "diffuse" "spectrum reflectance" "metal"', 1, 20, ("unknown spectrum 'metal'",)),
        ('Material "diffuse" "float reflectance" 0.5', 1, 20, ('"rgb reflectance"', '"texture reflectance"')),
        ('Material "diffuse" "float roughness" .1', 1, 20, ("roughness", "reflectance")),
        ('NamedMaterial "gone" Shape "sphere"', 1, 1, ("'gone'", "none")),
        ('MakeNamedMaterial "m" "rgb reflectance" [ 1 1 1 ]', 1, 1, ("string type",)),
        ('MakeNamedMaterial "m" "string type" "mixed"', 1, 1, ('"mixed"', '"diffuse"')),
        ('AreaLightSource "spot"', 1, 1, ('"spot"', '"diffuse"')),
        ('AreaLightSource "diffuse" "rgb L" [ 1 -2 1 ]', 1, 39, ("negative: -2",)),
        ('AreaLightSource "diffuse" "float scale" -1', 1, 27, ("negative",)),
        ('AreaLightSource "diffuse" "rgb L" [ 1e30 0 0 ] "float scale" 10', 1, 27, ("1e30",)),
        ('AreaLightSource "diffuse" "string filename" "a.exr"', 1, 27, ("a.exr", "no such image")),
        (
            'AreaLightSource "diffuse" "string filename" "a.exr" "rgb L" [ 1 1 1 ]',
            1,
            27,
            ("either L or filename",),
        ),
        ('AreaLightSource "diffuse" "bool twosided" "yes"', 1, 43, ("bool",)),
        ('AreaLightSource "diffuse" "float L" 3000', 1, 27, ('"rgb L"', '"blackbody L"')),
    ],
)
def test_errors_in_the_world(body: str, line: int, column: int, words: tuple[str, ...]) -> None:
    world_fails(body, line, column, *words)


def test_what_is_missing_is_named_at_the_end_of_the_file() -> None:
    fails("", 1, 1, "WorldBegin")
    fails('Camera "perspective"\n', 2, 1, "WorldBegin")


def test_nesting_is_bounded() -> None:
    deep = "AttributeBegin\n" * NESTING_LIMIT
    assert world(deep + "AttributeEnd\n" * NESTING_LIMIT).shapes == ()
    world_fails(deep + "AttributeBegin", NESTING_LIMIT + 1, 1, str(NESTING_LIMIT))


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def test_includes_are_relative_to_the_file_that_includes(tmp_path: Path) -> None:
    main = write(tmp_path, "main.pbrt", HEAD + 'Include "parts/a.pbrt"\n' + BALL)
    write(tmp_path, "parts/a.pbrt", 'Translate 1 0 0\nInclude "b.pbrt"')
    write(tmp_path, "parts/b.pbrt", "Translate 0 2 0\nInclude 'x'".replace("'x'", '"c.pbrt"'))
    write(tmp_path, "c.pbrt", "Translate 0 0 3")  # beside the main file, where pbrt looks
    geometry = parse_file(main).shapes[0].geometry
    assert isinstance(geometry, Sphere)
    assert geometry.center.tolist() == [1, 2, 3]


def test_errors_in_an_included_file_name_that_file(tmp_path: Path) -> None:
    main = write(tmp_path, "main.pbrt", HEAD + 'Include "part.pbrt"')
    part = write(tmp_path, "part.pbrt", '\n Shape "cube"')
    with pytest.raises(SceneError) as caught:
        parse_file(main)
    assert str(caught.value).startswith(f"{part}:2:2: ")


def test_a_template_reaches_into_what_it_includes(tmp_path: Path) -> None:
    main = write(tmp_path, "main.pbrt", f'#$ r 2 "units"\n{HEAD}Include "part.pbrt"')
    write(tmp_path, "part.pbrt", 'Shape "sphere" "float radius" $r')
    geometry = parse_file(main, {"r": 3}).shapes[0].geometry
    assert isinstance(geometry, Sphere)
    assert geometry.radius == 3.0


def test_cycles_depth_and_number_of_includes_are_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stream, "INCLUDE_COUNT", 1000)
    loop = write(tmp_path, "loop.pbrt", HEAD + 'Include "other.pbrt"')
    write(tmp_path, "other.pbrt", '\nInclude "loop.pbrt"')
    with pytest.raises(SceneError, match=r"other.pbrt:2:1: .*includes itself"):
        parse_file(loop)
    for i in range(INCLUDE_DEPTH + 1):
        write(tmp_path, f"deep{i}.pbrt", f'Include "deep{i + 1}.pbrt"')
    with pytest.raises(SceneError, match=f"at most {INCLUDE_DEPTH}"):
        parse_file(write(tmp_path, "deep.pbrt", HEAD + 'Include "deep0.pbrt"'))
    write(tmp_path, "wide12.pbrt", "")
    for i in range(12):  # 2^12 files, if each were read
        write(tmp_path, f"wide{i}.pbrt", f'Include "wide{i + 1}.pbrt"\n' * 2)
    with pytest.raises(SceneError, match="1000 in all"):
        parse_file(write(tmp_path, "wide.pbrt", HEAD + 'Include "wide0.pbrt"'))


@pytest.mark.parametrize("name", ["gone.pbrt", ".", "a\\\\b", "x" * 5000, "nul\\\\0"])
def test_an_include_that_cannot_be_read_is_refused_where_it_stands(tmp_path: Path, name: str) -> None:
    main = write(tmp_path, "main.pbrt", HEAD + f'Include "{name}"')
    with pytest.raises(SceneError) as caught:
        parse_file(main)
    assert caught.value.location is not None
    assert caught.value.location.line == HEAD.count("\n") + 1


def test_a_missing_file_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="No such file"):
        parse_file(tmp_path / "gone.pbrt")
