"""The lexical level and templates: places to the character, strings, comments, parameters."""

from __future__ import annotations

import pytest

from scenes.errors import Location, PenumbraError, SceneError
from scenes.pbrt.parser import parse
from scenes.pbrt.text.lexer import Source, decode, tokenize
from scenes.pbrt.text.template import read_header
from tests.kit.scene_texts import HEAD, fails


def test_every_token_knows_its_line_and_column() -> None:
    source = Source("f.pbrt", 'One "two" [ 3\n\t4.5e-1]# comment\r\nFive#not-a-comment "s\\"q"')
    places = [(str(t), t.kind, t.where.line, t.where.column) for t in tokenize(source)]
    assert places == [
        ("One", "word", 1, 1),
        ('"two"', "string", 1, 5),
        ("[", "[", 1, 11),
        ("3", "word", 1, 13),
        ("4.5e-1", "word", 2, 2),
        ("]", "]", 2, 8),
        ("Five#not-a-comment", "word", 3, 1),  # as in pbrt, `#` opens a comment only between words
        ('"s"q"', "string", 3, 20),
    ]


def test_location_is_found_at_both_ends_of_a_file() -> None:
    source = Source("f", "ab\n\ncd")
    assert [source.location(i) for i in (0, 2, 3, 4, 6)] == [
        Location("f", 1, 1), Location("f", 1, 3), Location("f", 2, 1), Location("f", 3, 1), Location("f", 3, 3),  # noqa: E501
    ]  # fmt: skip


def test_strings_are_unescaped_as_pbrt_does() -> None:
    (token,) = tokenize(Source("f", r'"a\\b\"c\'d\n\t\r\b\fe"'))
    assert token.text == "a\\b\"c'd\n\t\r\b\fe"


@pytest.mark.parametrize(
    ("text", "column", "word"),
    [
        ('X "never closed', 3, "unterminated"),
        ('X "closed on the next\nline"', 3, "unterminated"),
        ('X "ends in an escape\\"', 3, "unterminated"),
        ('X "bad \\q escape"', 8, "\\q"),
        ('"', 1, "unterminated"),
    ],
)
def test_bad_strings_are_refused_where_they_are(text: str, column: int, word: str) -> None:
    with pytest.raises(SceneError, match="f:1:") as caught:
        list(tokenize(Source("f", text)))
    assert caught.value.location == Location("f", 1, column)
    assert word in str(caught.value)


def test_bytes_that_are_no_text_are_refused_at_the_byte() -> None:
    with pytest.raises(SceneError, match="0xff") as caught:
        decode("Look\nä".encode() + b"\xff", "f")
    assert caught.value.location == Location("f", 2, 2)
    with pytest.raises(SceneError, match="0xfc"):
        decode(b'Shape "k\xfcgel"', "f")


def test_bytes_that_are_no_text_are_let_pass_in_comments() -> None:
    """Latin-1 of old files."""
    assert decode(b"# \xfc\nLook #\xff\n", "f") == "# ?\nLook #?\n"


def test_a_byte_order_mark_is_dropped() -> None:
    assert decode("\ufeffWorldBegin".encode(), "f") == "WorldBegin"


HEADER = """\
# A title
#
# More of it.
#$ gap 0.01 "scene units: the gap"
#$ n -2e1 "a count"

# still the header
LookAt 0 0 0
# no header any more
"""


def test_header_gives_title_text_and_parameters() -> None:
    header = read_header(Source("f", HEADER))
    assert header.title == "A title"
    assert header.doc == "A title\n\nMore of it.\nstill the header"
    assert [(p.name, p.default, p.meaning) for p in header.parameters] == [
        ("gap", 0.01, "scene units: the gap"),
        ("n", -20.0, "a count"),
    ]
    assert HEADER[header.end :].startswith("LookAt")


def test_a_file_of_comments_only_is_all_header() -> None:
    assert read_header(Source("f", "# one\n  # two")).doc == "one\ntwo"
    assert read_header(Source("f", "")).parameters == ()


@pytest.mark.parametrize(
    "line",
    [
        "#$", "#$ gap", '#$ gap "no default"', '#$ gap x "meaning"', "#$ gap 1", '#$ 1gap 1 "x"', '#$ a b 1 "x"',  # noqa: E501
        '#$ gap nan "x"', '#$ gap 1e999 "x"', '#$ gap 1_000 "x"', '#$ gap 1 "x" y',
    ],
)  # fmt: skip
def test_bad_declarations_are_refused(line: str) -> None:
    fails(f"# title\n{line}\n{HEAD}", 2, 1)


def test_a_repeated_declaration_is_refused() -> None:
    fails(f'#$ a 1 "x"\n#$ a 2 "y"\n{HEAD}', 2, 1, "twice")


def test_a_declaration_after_the_header_is_refused() -> None:
    fails(f'{HEAD}  #$ late 1 "x"\n', HEAD.count("\n") + 1, 3, "header")


TEMPLATE = f"""\
#$ radius 0.5 "scene units: radius"
#$ up 3 "scene units: height"
#$ width 8 "pixels"
{HEAD.replace("[ 8 ]", "[ $width ]")}
Translate 0 $up 0
Shape "sphere" "float radius" $radius
"""


def test_defaults_hold_until_they_are_set() -> None:
    scene, other = parse(TEMPLATE), parse(TEMPLATE, {"radius": 2.0, "width": 16.0})
    assert scene.parameters == (("radius", 0.5), ("up", 3.0), ("width", 8.0))
    assert other.parameters == (("radius", 2.0), ("up", 3.0), ("width", 16.0))
    assert (scene.film.width, other.film.width) == (8, 16)
    (a,), (b,) = scene.shapes, other.shapes
    assert (a.geometry.radius, b.geometry.radius) == (0.5, 2.0)  # type: ignore[union-attr]
    assert a.geometry.center.tolist() == [0, 3, 0]  # type: ignore[union-attr]


def test_setting_a_default_by_hand_changes_nothing() -> None:
    assert parse(TEMPLATE).content_hash() == parse(TEMPLATE, {"radius": 0.5}).content_hash()
    assert parse(TEMPLATE).content_hash() != parse(TEMPLATE, {"radius": 0.5000000000000001}).content_hash()


def test_an_undeclared_name_is_refused_where_it_stands() -> None:
    fails(
        TEMPLATE.replace("$up", "$gap"),
        TEMPLATE[: TEMPLATE.index("$up")].count("\n") + 1,
        13,
        "$gap",
        "$radius, $up",
    )


def test_a_declared_and_unused_name_is_refused() -> None:
    fails(f'#$ idle 1 "x"\n{HEAD}', 1, 1, "$idle", "never used")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_only_finite_values_can_be_given(value: float) -> None:
    with pytest.raises(PenumbraError, match="radius"):
        parse(TEMPLATE, {"radius": value})


def test_an_unknown_name_is_refused_and_the_known_ones_are_listed() -> None:
    with pytest.raises(PenumbraError, match=r"'gap'.*radius, up, width"):
        parse(TEMPLATE, {"gap": 1.0})
    with pytest.raises(PenumbraError, match=r"'gap'.*none"):
        parse(HEAD, {"gap": 1.0})


def test_a_fraction_is_refused_where_a_whole_number_belongs() -> None:
    with pytest.raises(SceneError, match=r"\$width = 8.5 is not a whole number") as caught:
        parse(TEMPLATE, {"width": 8.5})
    assert caught.value.location is not None
    assert caught.value.location.line == 6
