"""Whatever is in a file, the parser answers with a scene or with one clear error, and soon."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenes.catalog import LIBRARY
from scenes.errors import KINDS, PenumbraError
from scenes.pbrt.parser import parse, parse_source
from scenes.pbrt.text.lexer import Source
from scenes.pbrt.write.scene import to_pbrt
from scenes.ply.mesh import read_ply
from tests.kit.scene_texts import HEAD, PATCH, TRIANGLE
from tests.scenes.pbrt.test_pbrt_files import FOLDER as REFERENCES
from tests.scenes.ply.test_meshes import QUADS, TRIANGLES, ascii_ply, binary_quads

pytestmark = pytest.mark.usefixtures("thorough")

WORDS = [
    *("LookAt", "Camera", "Film", "PixelFilter", "Sampler", "Integrator", "WorldBegin", "AttributeBegin", "AttributeEnd"),  # noqa: E501
    *("Translate", "Scale", "Rotate", "Transform", "ConcatTransform", "Identity", "ReverseOrientation", "Material"),  # noqa: E501
    *("CoordinateSystem", "CoordSysTransform", "NamedMaterial", "MakeNamedMaterial", "AreaLightSource", "Shape", "Include"),  # noqa: E501
    *('"perspective"', '"rgb"', '"box"', '"path"', '"diffuse"', '"sphere"', '"disk"', '"trianglemesh"', '"bilinearmesh"'),  # noqa: E501
    *('"plymesh"', '"float radius"', '"float fov"', '"point3 P"', '"integer indices"', '"rgb L"', '"rgb reflectance"'),  # noqa: E501
    *('"string filename"', '"integer maxdepth"', '"float height"', '"bool twosided"', '"world"', '"camera"', '"', "[", "]"),  # noqa: E501
    *("0", "1", "-1", "2", "0.5", "1e-300", "1e300", "nan", "inf", "1e999", "99999999999", "$x", "#", "#$ x 1 \"y\"", "true"),  # noqa: E501
    *("TransformBegin", "TransformEnd", "ObjectBegin", "ObjectEnd", "ObjectInstance", "Attribute", "Option", "ColorSpace"),  # noqa: E501
    *("Texture", "LightSource", "Import", "MediumInterface", "MakeNamedMedium", "ActiveTransform", "TransformTimes", "Accelerator"),  # noqa: E501
    *('"float"', '"spectrum"', '"constant"', '"checkerboard"', '"mix"', '"scale"', '"imagemap"', '"conductor"', '"infinite"'),  # noqa: E501
    *('"distant"', '"point"', '"spot"', '"texture reflectance"', '"rgb value"', '"float roughness"', '"float power"', '"point3 from"'),  # noqa: E501
    *('"point3 to"', '"texture tex1"', '"float illuminance"', '"bool hemisphere"', '"string mapping"', '"float alpha"', '"shape"'),  # noqa: E501
    *(("[ 1 0 0 0  0 1 0 0  0 0 1 0  "
"0 0 0 1 ]"), "[ 0 0 0 1 0 0 0 1 0 ]", "[ .5 .5 .5 ]", TRIANGLE, PATCH, "\n", "\t"),
]  # fmt: skip
# The same examples each time, and no deadline of the clock: the machine may be busy. Time is bounded in the
# last test.
QUIET = {
    "deadline": None,
    "derandomize": True,
    "database": None,
    "suppress_health_check": [HealthCheck.too_slow],
}

soup = st.lists(st.sampled_from(WORDS), max_size=40).map(" ".join)
numbers = st.sampled_from(
    ["0", "-0", "1", "-1", "1e-18", "1e-200", "1e17", "1e18", "1e200", "3", "1e-9", ".1"]
)


def answers(text: str | bytes) -> None:
    """Parse; a scene or a PenumbraError of one line is fine. A scene must survive its export."""
    with contextlib.suppress(PenumbraError):
        try:
            scene = parse(text)
        except PenumbraError as error:
            assert all(line.isprintable() for line in str(error).splitlines())
            raise
        assert parse(to_pbrt(scene)).content_hash() == scene.content_hash()


@settings(max_examples=100, **QUIET)
@given(st.binary(max_size=200))
def test_random_bytes(data: bytes) -> None:
    answers(data)
    answers(HEAD.encode() + data)


@settings(max_examples=100, **QUIET)
@given(soup)
def test_token_soup(text: str) -> None:
    answers(text)
    answers(HEAD + text)


@settings(max_examples=80, **QUIET)
@given(st.text(max_size=100), st.integers(0, len(HEAD)))
def test_random_text_inside_a_scene(text: str, place: int) -> None:
    answers(HEAD[:place] + text + HEAD[place:] + TRIANGLE)


@settings(max_examples=80, **QUIET)
@given(
    st.lists(st.sampled_from(["Translate", "Scale", "Rotate"]), max_size=4),
    st.lists(numbers, min_size=60, max_size=60),
    st.sampled_from(
        [
            TRIANGLE,
            PATCH,
            'Shape "sphere" "float radius" {}',
            'Shape "disk" "float height" {} "float radius" {}',
        ]
    ),
    st.booleans(),
)
def test_extreme_numbers(directives: list[str], values: list[str], shape: str, light: bool) -> None:
    left = iter(values)
    lines = [
        " ".join([name, *(next(left) for _ in range(4 if name == "Rotate" else 3))]) for name in directives
    ]
    emission = 'AreaLightSource "diffuse" "rgb L" [ {} {} {} ] "float scale" {}\n' if light else ""
    body = "\n".join(lines) + "\n" + emission + shape
    while "{}" in body:
        body = body.replace("{}", next(left), 1)
    answers(HEAD + body)


FILES = sorted([*LIBRARY.glob("**/*.pbrt"), *REFERENCES.glob("*.pbrt")])
# What a text editor, a wrong export or a bad disk does to a file, at a place and with a length.
MUTATIONS = {
    "cut": lambda text, at, size: text[:at] + text[at + size :],
    "stop": lambda text, at, _: text[:at],
    "double": lambda text, at, size: text[: at + size] + text[at:],
    "move": lambda text, at, size: text[:at] + text[at + size :] + text[at : at + size],
    "quote": lambda text, at, _: text[:at] + '"' + text[at:],
    "open": lambda text, at, _: text[:at] + " [ " + text[at:],
    "close": lambda text, at, _: text[:at] + " ] " + text[at:],
    "number": lambda text, at, _: text[:at] + " -1e300 " + text[at:],
    "word": lambda text, at, _: text[:at] + " AttributeBegin " + text[at:],
    "hash": lambda text, at, _: text[:at] + "#" + text[at:],
    "swap case": lambda text, at, size: text[:at] + text[at : at + size].swapcase() + text[at + size :],
    "bytes": lambda text, at, size: text[:at] + "\x00\ud800\u2028" + text[at + size :],
}  # fmt: skip


@settings(max_examples=150, **QUIET)
@given(
    st.sampled_from(FILES),
    st.lists(
        st.tuples(st.sampled_from(sorted(MUTATIONS)), st.floats(0, 1), st.integers(1, 60)),
        min_size=1,
        max_size=4,
    ),
)
def test_damaged_scene_files(path: Path, mutations: list[tuple[str, float, int]]) -> None:
    text = path.read_text()
    for name, place, size in mutations:
        text = MUTATIONS[name](text, int(place * len(text)), size)
    source = Source(str(path), text, path.parent)
    with contextlib.suppress(PenumbraError):
        scene = parse_source(source, {}, path.stem)
        assert scene.content_hash()


@settings(max_examples=100, **QUIET)
@given(
    st.sampled_from([ascii_ply(TRIANGLES), ascii_ply(QUADS), binary_quads()]),
    st.integers(0, 400),
    st.binary(max_size=8),
)
def test_damaged_mesh_files(
    tmp_path_factory: pytest.TempPathFactory, data: bytes, place: int, patch: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.ply"
    path.write_bytes(data[:place] + patch + data[place + len(patch) :])
    with contextlib.suppress(PenumbraError):
        read_ply(path)


@pytest.mark.parametrize(
    "text",
    [
        '"' + "\\\\" * 200_000,
        "[" * 200_000,
        HEAD + "AttributeBegin " * 200_000,
        HEAD + "Translate 1 1 1 " * 2_000 + "x",
        HEAD + 'Shape "sphere" "float radius" ' + "1" * 1_000_000,
        HEAD + 'Shape "sphere" "float radius" .' + "0" * 1_000_000 + "e",
        "# " * 500_000 + "\n" * 500_000 + "x",
        "#$ a 1 \"" + "b" * 1_000_000,
        HEAD + 'Film "rgb" "integer xresolution" ' + "9" * 100_000,
        HEAD + 'Shape "' + "x\\n" * 10_000 + '"',
        HEAD + 'Include "' + "../" * 20_000 + '"',
        HEAD + "".join(f'ObjectBegin "{i}" ' for i in range(5_000)),
        HEAD + 'ObjectInstance "o" ' * 3_000,
        HEAD + 'Shape "trianglemesh" "point3 P" [ ' + "1 " * 1_000_000 + "x",
        HEAD + ('Shape "trianglemesh" "point3 P" [ ' + "1 2 3 " * 20 + "x ] ") * 200,
        HEAD + 'Attribute "shape" "float radius" 1 ' * 3_000 + "x",
        HEAD + 'LightSource "infinite" ' * 1_000 + "x",
        HEAD + 'Shape "cone" ' * 5_000,
        HEAD + 'Shape "sphere" "float x" [ ' + "#" * 1_000_000,
        HEAD + 'Shape "sphere" "float x" [ ' + "1e999 " * 100_000,
        HEAD + 'Shape "sphere" "float x" [ ' + ("1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 "
"1 1 1-1 ") * 5_000,
    ],
    ids=range(21),
)  # fmt: skip
def test_long_nonsense_is_refused_in_time(text: str) -> None:
    start = time.process_time()
    with pytest.raises(PenumbraError) as caught:
        parse(text)
    # Linear work takes a few seconds at most, nine tenths of them the run-time checks of types; a quadratic
    # step would take minutes.
    assert time.process_time() - start < 20
    assert all(len(line) < 1000 and line.isprintable() for line in str(caught.value).splitlines())
    assert len(str(caught.value).splitlines()) <= KINDS + 2
