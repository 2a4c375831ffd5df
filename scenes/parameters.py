"""pbrt's parameter lists, `"float radius" [ 0.5 ]`: typed access, and an error for what nobody reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from scenes.errors import Location, SceneError
from scenes.template import Bindings
from scenes.tokens import Token

TYPES = (
    "bool", "float", "integer", "string", "rgb", "point2", "point3",
    "vector2", "vector3", "normal", "spectrum", "blackbody", "texture",
)  # fmt: skip
INT32_MAX = 2**31 - 1

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Parameter:
    """One declared parameter and the tokens of its values."""

    type: str
    name: str
    values: Sequence[Token]
    where: Location

    def __str__(self) -> str:
        return f'"{self.type} {self.name}"'


class Parameters:
    """The parameter list of one directive. Read everything that is supported, then call `finish`."""

    def __init__(self, owner: str, where: Location, items: Sequence[Parameter], bindings: Bindings) -> None:
        self.owner = owner
        self.where = where
        self._bindings = bindings
        self._unread: dict[str, Parameter] = {}
        self._supported: list[str] = []
        self._given: dict[str, Parameter] = {}
        for item in items:
            if item.name in self._given:
                raise SceneError(f"{item} is given twice to {owner}", item.where)
            self._given[item.name] = item
        self._unread = dict(self._given)

    def located(self, name: str) -> Location:
        """Where `name` was given; where the directive stands if it was not."""
        return self._given[name].where if name in self._given else self.where

    def given(self, name: str) -> bool:
        """Whether the file gives a parameter of this name."""
        return name in self._given

    def fail(self, name: str, message: str) -> SceneError:
        """A SceneError about `name`, located at it, to be raised by the caller."""
        return SceneError(message, self.located(name))

    def number(self, name: str, default: float) -> float:
        """One `float`."""
        return self._one("float", name, default, self._bindings.number)

    def integer(self, name: str, default: int) -> int:
        """One `integer`."""
        return self._one("integer", name, default, self._whole)

    def text(self, name: str, default: str) -> str:
        """One `string`."""
        return self._one("string", name, default, _string)

    def flag(self, name: str, default: bool) -> bool:
        """One `bool`, written true or false without quotes."""
        return self._one("bool", name, default, _bool)

    def rgb(self, name: str, default: float) -> NDArray[np.float64]:
        """One `rgb`, three numbers none of which is negative: (3,) float64."""
        parameter = self._take("rgb", name)
        if parameter is None:
            return np.full(3, default)
        if len(parameter.values) != 3:
            raise SceneError(f"{parameter} takes three numbers, not {len(parameter.values)}", parameter.where)
        values = [self._bindings.number(token) for token in parameter.values]
        for token, value in zip(parameter.values, values, strict=True):
            if value < 0:
                raise SceneError(f"{parameter} is negative: {value:g}", token.where)
        return np.array(values) + 0.0

    def vectors(self, type_: str, name: str) -> NDArray[np.float64] | None:
        """All values of a `point3`, `point2` and the like as rows: (m, 3) or (m, 2) float64; None if not given."""
        parameter = self._take(type_, name)
        if parameter is None:
            return None
        size = 2 if type_.endswith("2") else 3
        if not parameter.values or len(parameter.values) % size:
            count = len(parameter.values)
            raise SceneError(f"{parameter} takes groups of {size} numbers, not {count} numbers", parameter.where)
        return np.array([self._bindings.number(token) for token in parameter.values]).reshape(-1, size)

    def integers(self, name: str) -> tuple[NDArray[np.int64], Sequence[Token]] | None:
        """All values of an `integer` list, (m,) int64, and their tokens for messages; None if not given."""
        parameter = self._take("integer", name)
        if parameter is None:
            return None
        return np.array([self._whole(token) for token in parameter.values], dtype=np.int64), parameter.values

    def finish(self) -> None:
        """SceneError about the first parameter that nobody has read, saying what is supported."""
        for parameter in self._unread.values():
            supported = ", ".join(f'"{name}"' for name in self._supported) or "none"
            raise SceneError(
                f"{parameter} is not supported by {self.owner}; supported parameters: {supported}", parameter.where
            )

    def _take(self, type_: str, name: str) -> Parameter | None:
        self._supported.append(f"{type_} {name}")
        parameter = self._unread.pop(name, None)
        if parameter is not None and parameter.type != type_:
            raise SceneError(f'{parameter} of {self.owner} must be declared as "{type_} {name}"', parameter.where)
        return parameter

    def _one(self, type_: str, name: str, default: T, convert: Callable[[Token], T]) -> T:
        parameter = self._take(type_, name)
        if parameter is None:
            return default
        if len(parameter.values) != 1:
            raise SceneError(f"{parameter} takes one value, not {len(parameter.values)}", parameter.where)
        return convert(parameter.values[0])

    def _whole(self, token: Token) -> int:
        value = self._bindings.number(token)
        decimal = not token.text.startswith("$") and not token.text.lstrip("+-").isdigit()
        if decimal or value != int(value) or abs(value) > INT32_MAX:
            raise SceneError(f"{_shown(token, value)} is not a whole number of 32 bits", token.where)
        return int(value)


def _shown(token: Token, value: float) -> str:
    return f"{token} = {value:g}" if token.text.startswith("$") else token.text


def _string(token: Token) -> str:
    if token.kind != "string":
        raise SceneError(f"{token} is not a quoted string", token.where)
    return token.text


def _bool(token: Token) -> bool:
    if token.kind != "word" or token.text not in ("true", "false"):
        raise SceneError(f"{token} is not a bool: write true or false, without quotes", token.where)
    return token.text == "true"
