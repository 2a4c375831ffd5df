"""Scenes with parameters: header lines declare them, `$name` uses them, `-D name=value` sets them.

A declaration is a comment to pbrt:  #$ gap 0.01 in [0, 100] "scene units: lower edge of the light above the
floor" `$gap` then stands wherever a number may stand. There is no arithmetic: transforms do what little is
needed. `in` and the interval may be left out; a round bracket leaves the bound itself out: (0, 20] is above 0
and at most 20.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from scenes.errors import Location, PenumbraError, SceneError
from scenes.pbrt.text.lexer import Source, Token, odd_space

_HEADER_LINE = re.compile(r"[ \t\r]*(?:(#)(\$(?![^ \t\r\n]))?([^\r\n]*))?\r?(?:\n|\Z)")
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_INTERVAL = rf"in[ \t]*([\[(])[ \t]*({_NUMBER})[ \t]*,[ \t]*({_NUMBER})[ \t]*([\])])"
_DECLARATION = re.compile(
    rf'[ \t]+([A-Za-z_][A-Za-z0-9_]*)[ \t]+({_NUMBER})(?:[ \t]+{_INTERVAL})?[ \t]+"([^"]*)"[ \t]*'
)
NUMBER = re.compile(_NUMBER)

Values = Mapping[str, float | int]  # both: run-time checks of types do not take an int for a float


@dataclass(frozen=True)
class Interval:
    """The range of a parameter, from `low` to `high`. above, below: whether `low` or `high` itself is
    excluded.
    """

    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    below: bool = False

    def __contains__(self, value: float | int) -> bool:
        over = value > self.low if self.above else value >= self.low
        under = value < self.high if self.below else value <= self.high
        return over and under

    def brackets(self) -> str:
        """The range as a header declares it: (0, 20] is above 0 and at most 20."""
        return f"{'(' if self.above else '['}{self.low:g}, {self.high:g}{')' if self.below else ']'}"

    def __str__(self) -> str:
        low = f"above {self.low:g}" if self.above else f"{self.low:g} or more"
        high = f"below {self.high:g}" if self.below else f"at most {self.high:g}"
        return f"{low} and {high}"


ANY = Interval()


@dataclass(frozen=True)
class TemplateParameter:
    """One `$name` of a template: default, range, and meaning with its unit."""

    name: str
    default: float
    meaning: str
    interval: Interval
    where: Location = field(compare=False, repr=False)


@dataclass(frozen=True, eq=False)
class Header:
    """The comment that opens a scene file. title: its first line. end: the offset after it."""

    title: str
    doc: str
    parameters: tuple[TemplateParameter, ...]
    end: int


def read_header(source: Source) -> Header:
    """Read the comment lines before the first directive. SceneError for a bad or repeated declaration."""
    lines: list[str] = []
    parameters: dict[str, TemplateParameter] = {}
    offset = 0
    while offset < len(source.text) and (match := _HEADER_LINE.match(source.text, offset)):
        if match.group(2):
            parameter = _declaration(match.group(3), source.location(match.start(1)))
            if parameter.name in parameters:
                raise SceneError(f"${parameter.name} is declared twice", parameter.where)
            parameters[parameter.name] = parameter
        elif match.group(1):
            lines.append(match.group(3).strip())
        offset = match.end()
    return Header(lines[0] if lines else "", "\n".join(lines), tuple(parameters.values()), offset)


def _declaration(text: str, where: Location) -> TemplateParameter:
    match = _DECLARATION.fullmatch(text)
    if match is None:
        raise SceneError(
            (
                'a template parameter is declared as: #$ name 0.01 "unit: meaning", or #$ name 0.01 in (0, 10] '  # noqa: E501
                '"unit: meaning"'
            ),
            where,
        )
    name, number, left, low, high, right, meaning = match.groups()
    default = float(number)
    if not math.isfinite(default):
        raise SceneError(f"the default of ${name} is beyond the range of a number", where)
    interval = ANY if left is None else Interval(float(low), float(high), left == "(", right == ")")
    if default not in interval:
        raise SceneError(f"the default of ${name} is {default:g}, and its values are {interval}", where)
    return TemplateParameter(name, default, meaning, interval, where)


class Bindings:
    """Values of a template's parameters while its text is read, with a record of those in use."""

    def __init__(self, header: Header, given: Values) -> None:
        self._declared = header.parameters
        self.values = {parameter.name: parameter.default for parameter in header.parameters}
        self._used: set[str] = set()
        for name, value in given.items():
            self._set(name, value)

    def _set(self, name: str, value: float | int) -> None:
        if name not in self.values:
            names = ", ".join(self.values) or "none at all"
            raise PenumbraError(f"the scene has no parameter {name!r}; it has: {names}")
        if not math.isfinite(value):
            raise PenumbraError(f"parameter {name} = {value}: a finite number is needed")
        declared = next(parameter for parameter in self._declared if parameter.name == name)
        if value not in declared.interval:
            raise PenumbraError(
                f"parameter {name} = {value:g}: it must be {declared.interval} ({declared.meaning})"
            )
        self.values[name] = float(value)

    def number(self, token: Token) -> float:
        """The finite number of a word, which is a number or `$name`. SceneError at any other word."""
        if token.kind == "word" and token.text.startswith("$"):
            return self._substitute(token)
        if token.kind != "word" or NUMBER.fullmatch(token.text) is None:
            raise SceneError(f"{token} is not a number{odd_space(token.text)}", token.where)
        value = float(token.text)
        if not math.isfinite(value):
            raise SceneError(f"{_short(token.text)} is beyond the range of a number", token.where)
        return value

    def _substitute(self, token: Token) -> float:
        name = token.text[1:]
        if name not in self.values:
            names = ", ".join(f"${known}" for known in self.values) or "none"
            raise SceneError(
                f"{token.text} is not declared in the header of the scene file; declared: {names}",
                token.where,
            )
        self._used.add(name)
        return self.values[name]

    def check_used(self) -> None:
        """Raise SceneError if a declared parameter is never used, since setting it would change nothing."""
        for parameter in self._declared:
            if parameter.name not in self._used:
                raise SceneError(f"${parameter.name} is declared but never used", parameter.where)


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."
