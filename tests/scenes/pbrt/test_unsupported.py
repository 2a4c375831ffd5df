"""One message that lists every place of a scene that asks for what is not simulated."""

from __future__ import annotations

import pickle
import time
from pathlib import Path

import numpy as np
import pytest

from scenes.errors import KINDS, Location, Report, SceneError
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse, parse_file
from tests.kit.scene_texts import HEAD, TRIANGLE

SCENE = """\
Camera "realistic" "string lensfile" "wide.dat"
Film "rgb" "float iso" 200 "string sensor" "canon_eos_5d_mkiv"
PixelFilter "mitchell"
Integrator "volpath" "integer maxdepth" 0
MakeNamedMedium "fog" "string type" "homogeneous"
WorldBegin
LightSource "laser" "string filename" "gone.png"
MakeNamedMaterial "glass" "string type" "subsurface" "float eta" 1.5
NamedMaterial "glass"
Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 ] "float wobble" 3
Shape "nurbs" "integer levels" 3 "point3 P" [ 0 0 0 1 0 0 0 1 0 ] "integer indices" [ 0 1 2 ]
Texture "rust" "spectrum" "clouds"
Material "diffuse" "texture reflectance" "rust"
Shape "paraboloid"
MediumInterface "fog" ""
Shape "sphere" "float zmax" 0.5 "float phimax" 90
"""
PLY = """\
ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""
PLACES_OF_SCENE = [
    *[
        (1, 1),
        (3, 1),
        (4, 22),
        (7, 1),
        (8, 1),
        (10, 55),
        (11, 1),
        (12, 1),
        (14, 1),
    ],
    (15, 1),
]


def refused(text: str) -> SceneError:
    with pytest.raises(SceneError) as caught:
        parse(text)
    return caught.value


def test_every_place_is_listed_a_line_each_and_the_first_is_the_error_s_own() -> None:
    error = refused(SCENE)
    lines = str(error).splitlines()
    assert [tuple(map(int, line.split(":")[1:3])) for line in lines] == PLACES_OF_SCENE
    assert error.location == Location("<text>", 1, 1)
    assert 'Camera "realistic" is not supported' in error.message
    for word in (
        "mitchell",
        "maxdepth is 0",
        "laser",
        "subsurface",
        "wobble",
        "'nurbs'",
    ):
        assert sum(word in line for line in lines) == 1, word


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("Shape\n", "<text>:17:1: the file ends after Shape, which needs a quoted string"),
        ('Shape "sphere" "float radius" -1\n', "<text>:17:16: the radius must be positive, not -1"),
        ('Texture "a" "float" "constant"\n' * 2, '<text>:18:1: float texture "a" is made twice'),
    ],
)
def test_what_is_malformed_comes_first_and_hides_nothing_before_it(line: str, problem: str) -> None:
    lines = str(refused(SCENE + line)).splitlines()
    assert lines == [problem, *str(refused(SCENE)).splitlines()]


@pytest.mark.parametrize(
    "line",
    [
        'Material "conductor" "texture eta" "r" "float roughness" .1',
        'Material "conductor" "texture reflectance" "r" "float roughness" .1',
        'AreaLightSource "diffuse" "string filename" "sky.exr" ' + TRIANGLE,
    ],
)
def test_what_pbrt_would_take_is_listed_with_the_rest(line: str, tmp_path: Path) -> None:
    write_exr(tmp_path / "sky.exr", {name: np.ones((2, 2)) for name in "RGB"})
    text = HEAD + "Scale 1 2 1\n" + f'Shape "paraboloid"\n{line}\nShape "nurbs"'
    (tmp_path / "main.pbrt").write_text(text)
    with pytest.raises(SceneError) as caught:
        parse_file(tmp_path / "main.pbrt")
    lines = [
        line.removeprefix(f"{tmp_path}/main.pbrt:").split(":")[0] for line in str(caught.value).splitlines()
    ]
    assert lines == ["8", "9", "10"]


def test_notes_are_refusals_where_the_reader_is_strict() -> None:
    lens = 'Camera "realistic"\n'
    text = lens + 'Integrator "path" "integer maxdepth" 2\nWorldBegin\nShape "paraboloid"'
    with pytest.raises(SceneError) as caught:
        parse(text, strict=True)
    assert [line.split(":")[1] for line in str(caught.value).splitlines()] == ["1", "2", "4"]


def test_long_nonsense_is_cut_before_it_is_looked_at() -> None:
    start = time.process_time()
    error = refused(HEAD + f'Shape "{"A" * 20_000_000}"')
    assert len(str(error)) < 1000
    assert time.process_time() - start < 3  # a second or less; 7 when each letter was looked at


def test_a_bad_value_hides_nothing_behind_it() -> None:
    error = refused(HEAD + 'Shape "sphere" "float radius" -1\nShape "sphere" "float radius" -2\nShape "cone"')
    assert error.location == Location("<text>", 7, 16)
    assert [line.split(": ")[0] for line in str(error).splitlines()] == ["<text>:7:16", "<text>:9:1"]


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ('Attribute "shape" "texture displacement" "t" Shape "plymesh" "string filename" "m.ply"', 19),
        ('Attribute "material" "texture eta" "r" Material "conductor"', 22),
    ],
)
def test_what_an_attribute_asks_for_is_named_where_it_says_so(text: str, column: int, tmp_path: Path) -> None:
    (tmp_path / "m.ply").write_text(PLY)
    (tmp_path / "main.pbrt").write_text(HEAD + text)
    with pytest.raises(SceneError) as caught:
        parse_file(tmp_path / "main.pbrt")
    assert caught.value.location == Location(str(tmp_path / "main.pbrt"), 7, column)
    assert "support" in str(caught.value)


def test_what_an_attribute_says_to_others_is_let_pass() -> None:
    plain = parse(HEAD + TRIANGLE)
    said = parse(
        HEAD + 'Attribute "shape" "float radius" 2 Attribute "material" "float roughness" .5 ' + TRIANGLE
    )
    assert said.content_hash() == plain.content_hash()


def test_a_template_parameter_of_what_is_not_supported_does_not_hide_it() -> None:
    error = refused(f'#$ n 3 "count"\n{HEAD}Shape "nurbs" "integer levels" $n')
    assert "'nurbs'" in str(error)


def test_places_in_included_files_are_listed_with_their_files(tmp_path: Path) -> None:
    (tmp_path / "a.pbrt").write_text('Shape "cone"')
    (tmp_path / "main.pbrt").write_text(HEAD + 'Include "a.pbrt" Import "a.pbrt"\nShape "nurbs"')
    with pytest.raises(SceneError) as caught:
        parse_file(tmp_path / "main.pbrt")
    first, second = str(caught.value).splitlines()  # the file that is read twice is named once
    assert first.startswith(f"{tmp_path / 'a.pbrt'}:1:1: shape 'cone'")
    assert second.startswith(f"{tmp_path / 'main.pbrt'}:8:1: shape 'nurbs'")


def test_a_kind_is_one_line_with_its_first_place_and_how_many_more_there_are() -> None:
    lines = str(refused(HEAD + 'Shape "cone"\n' * 99 + 'Shape "nurbs"\n' + 'Shape "cone"\n')).splitlines()
    assert len(lines) == 2
    assert lines[0].startswith("<text>:7:1: shape 'cone'") and lines[0].endswith(" and 99 more")
    assert lines[1].startswith("<text>:106:1: shape 'nurbs'") and not lines[1].endswith("more")


def test_the_list_is_bounded() -> None:
    text = HEAD + "".join(f'Shape "cone{i}"\n' for i in range(KINDS + 7))
    lines = str(refused(text)).splitlines()
    assert len(lines) == KINDS + 2  # the first is the error's own
    assert lines[-1] == "and 6 more kinds of what is not supported"


def test_the_lines_survive_the_way_from_a_worker() -> None:
    error = refused(SCENE)
    copy = pickle.loads(pickle.dumps(error))
    assert (str(copy), copy.location, copy.message) == (str(error), error.location, error.message)


@pytest.mark.parametrize(
    ("line", "column"),
    [
        ('Material "matte" "rgb Kd" [ .5 .5 .5 ]', 1),
        ('MakeNamedMaterial "m" "string type" "uber"', 1),
        ('Material "diffuse" "color reflectance" [ .5 .5 .5 ]', 20),
        ('LightSource "point" "xyz I" [ 1 1 1 ]', 21),
    ],
)
def test_a_file_of_version_3_is_told_so_at_once(line: str, column: int) -> None:
    error = refused(HEAD + line + '\nShape "sphere"')
    assert error.location == Location("<text>", 7, column)
    assert "pbrt-v3" in str(error) and "pbrt --upgrade" in str(error)


def test_an_empty_report_says_nothing() -> None:
    Report().check()


@pytest.mark.parametrize(
    "line",
    [
        'Accelerator "bvh" "string splitmethod" "sah"',
        'Accelerator "anything" "rgb nonsense" [ 1 2 3 ]',
        'Option "disablewavelengthjitter" true',
        'Option "string rendercoordsys" "world"',
        'Option "disable-texture-filtering" true',
        'Option "seed" 7',
        'Option "forcediffuse" false',
        'ColorSpace "sRGB"',
        "TransformTimes 0 1",
        "ActiveTransform All",
        'MediumInterface "" ""',
        'MediumInterface ""',
    ],
)
def test_what_changes_no_image_is_accepted(line: str) -> None:
    assert parse(line + "\n" + HEAD + TRIANGLE).content_hash() == parse(HEAD + TRIANGLE).content_hash()
