"""Intervals in a template's declarations: what they allow, how they are refused, and that they are
optional.
"""

from __future__ import annotations

import pytest

from scenes.errors import PenumbraError, SceneError
from scenes.pbrt.parser import parse
from scenes.pbrt.text.lexer import Source
from scenes.pbrt.text.template import ANY, read_header
from tests.kit.scene_texts import HEAD


def text(declaration: str) -> str:
    return f"#$ size {declaration}\n{HEAD.replace('WorldBegin', 'WorldBegin Scale $size 1 1')}"


@pytest.mark.parametrize(
    ("interval", "inside", "outside"),
    [
        ("in (0, 10]", (1e-300, 10), (0, -1, 10.0000001)),
        ("in [0, 10)", (0, 9.9999), (-1e-9, 10)),
        ("in [ -2.5,1e3 ]", (-2.5, 1000), (-2.6, 1001)),
        ("", (-1e30, 1e30), ()),
    ],
)
def test_values_are_held_against_the_interval(
    interval: str, inside: tuple[float, ...], outside: tuple[float, ...]
) -> None:
    (parameter,) = read_header(Source("f", f'#$ size 1 {interval} "scene units: the size"')).parameters
    assert all(value in parameter.interval for value in inside)
    assert not any(value in parameter.interval for value in outside)


def test_a_value_outside_is_refused_in_one_line() -> None:
    scene = text('1 in (0, 10] "scene units: the size"')
    assert dict(parse(scene, {"size": 2}).parameters) == {"size": 2.0}
    with pytest.raises(PenumbraError) as told:
        parse(scene, {"size": 0})
    assert str(told.value) == "parameter size = 0: it must be above 0 and at most 10 (scene units: the size)"
    with pytest.raises(PenumbraError, match="it must be 0 or more and below 1"):
        parse(text('0.5 in [0, 1) "factor"'), {"size": 1})


def test_a_declaration_without_an_interval_allows_any_number() -> None:
    (parameter,) = read_header(Source("f", '#$ size -3 "scene units: the size"')).parameters
    assert parameter.interval == ANY


@pytest.mark.parametrize(
    "declaration",
    [
        '1 in "x"', '1 in (0 10) "x"', '1 in 0, 10 "x"', '1 in (0, 10 "x"', '1 in (a, 10] "x"', '1 (0, 10] "x"', ('1 '  # noqa: E501
'in (0, 10] in (0, 1] "x"'),
    ],
)  # fmt: skip
def test_a_bad_interval_is_refused(declaration: str) -> None:
    with pytest.raises(SceneError, match="a template parameter is declared as"):
        parse(text(declaration))


@pytest.mark.parametrize("declaration", ['0 in (0, 10] "x"', '11 in [0, 10] "x"', '5 in [9, 1] "x"'])
def test_a_default_outside_its_interval_is_the_author_s_error(declaration: str) -> None:
    with pytest.raises(SceneError, match=r"the default of \$size is .*, and its values are"):
        parse(text(declaration))
