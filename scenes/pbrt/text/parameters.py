"""pbrt's parameter lists, `"float radius" [ 0.5 ]`: typed access, and a report of unread parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from scenes.errors import Location, Report, SceneError
from scenes.pbrt.text.lexer import Token
from scenes.pbrt.text.numbers import Values
from scenes.pbrt.text.template import Bindings

Array = NDArray[np.float64]

TYPES = (
    "bool", "float", "integer", "string", "rgb", "point2", "point3",
    "vector2", "vector3", "normal", "spectrum", "blackbody", "texture",
)  # fmt: skip
VERSION_3 = "is of pbrt-v3; `pbrt --upgrade` of pbrt-v4 rewrites such a file"
TYPES_OF_VERSION_3 = ("color", "xyz")
SPELLINGS = {"point": "point3", "vector": "vector3", "normal3": "normal"}  # of older files
INT32_MAX = 2**31 - 1
SRGB = "srgb"
SPACES = (SRGB, "rec2020", "dci-p3", "aces2065-1")
TEXTURED = (
    "float",
    "rgb",
    "spectrum",
)  # in whose place pbrt takes a texture, and its mean is a stand-in here
# What pbrt-v4 reads and nothing here simulates. Given by an `Attribute`, where most that nobody reads is
# meant for other kinds, it is
# reported all the same wherever it would have an effect.
EFFECTIVE = ("normalmap", "displacement")

T = TypeVar("T")
Resolve = Callable[[str], Path]
Mean = Callable[[str, str], Array | None]


@dataclass(frozen=True, eq=False)
class Parameter:
    """One declared parameter and the tokens of its values. space: the `ColorSpace` where it stands."""

    type: str
    name: str
    values: Values
    where: Location
    space: str = SRGB

    def __str__(self) -> str:
        return f'"{self.type} {self.name}"'


class Parameters:
    """The parameter list of a directive. Read everything that is supported, then call `finish`.

    resolve: the path of a file that the scene names. defaults: parameters that `Attribute` gave for
    directives of this kind, one of each type and name; the directive's own override them.
    """

    def __init__(
        self, owner: str, where: Location, items: Sequence[Parameter], bindings: Bindings, report: Report,
        resolve: Resolve, defaults: Sequence[Parameter] = (),
    ) -> None:  # fmt: skip
        self.owner = owner
        self.where = where
        self.resolve = resolve
        self._bindings = bindings
        self._report = report
        self.mean: Mean | None = None  # of a texture by its type and name, (3,), None where it is not known
        self._supported: list[tuple[tuple[str, ...], str]] = []
        self._given: dict[str, Parameter] = {}
        for item in items:
            if item.name in self._given:
                report.remark(
                    f'"{item.name}" is given twice to {owner}: the last one holds, as in pbrt', item.where
                )
            self._given[item.name] = item
        self._unread = dict(self._given)
        self._defaults = [item for item in defaults if item.name not in self._given]
        self._unread |= {item.name: item for item in self._defaults if item.name in EFFECTIVE}

    @property
    def supported(self) -> tuple[tuple[tuple[str, ...], str], ...]:
        """Type and name of each parameter asked for so far."""
        return tuple(self._supported)

    def located(self, name: str) -> Location:
        """The place of `name`, or of the directive if it is not given."""
        found = next((item for item in self._items(name)), None)
        return self.where if found is None else found.where

    def given(self, name: str) -> bool:
        """Whether the file gives a parameter of this name."""
        return any(True for _ in self._items(name))

    def _items(self, name: str) -> Iterator[Parameter]:
        """The directive's own parameter of this name, or else those of `Attribute`, the last first."""
        if name in self._given:
            yield self._given[name]
        yield from (item for item in reversed(self._defaults) if item.name == name)

    def fail(self, name: str, message: str) -> SceneError:
        """A SceneError about `name`, at its place, for the caller to raise."""
        return SceneError(message, self.located(name))

    def unsupported(self, name: str, message: str) -> None:
        """Report that `name` asks for something that is not simulated, and go on."""
        self._report.add(message, self.located(name))

    def note(self, name: str, message: str) -> None:
        """Note that `name` makes the image differ from pbrt's."""
        self._report.note(message, self.located(name))

    def substitute(self, name: str, what: str, nearest: str) -> None:
        """Render the nearest thing that is simulated in place of `name`, or refuse it if that is
        not allowed.
        """
        self._report.substitute(what, nearest, self.located(name))

    def remark(self, name: str, message: str) -> None:
        """Note a likely mistake that changes no image."""
        self._report.remark(message, self.located(name))

    def number(self, name: str, default: float) -> float:
        """One `float`. A negative zero becomes zero here and below: no image tells them apart, but a hash
        would.
        """
        return self._one("float", name, default, self._bindings.number) + 0.0

    def integer(self, name: str, default: int) -> int:
        """One `integer`."""
        return self._one("integer", name, default, self._whole)

    def text(self, name: str, default: str) -> str:
        """One `string`."""
        return self._one("string", name, default, _string)

    def texts(self, name: str) -> list[str]:
        """All values of a `string` list; an empty list if not given."""
        parameter = self.take(name, "string")
        if parameter is None:
            return []
        return [_string(parameter.values.token(i)) for i in range(len(parameter.values))]

    def text_of(self, parameter: Parameter) -> str:
        """The one string of a parameter that `take` gave."""
        return _single(parameter, _string)

    def flag(self, name: str, default: bool) -> bool:
        """One `bool`: true or false, with or without quotes."""
        return self._one("bool", name, default, _bool)

    def point(self, name: str, default: tuple[float, float, float]) -> Array:
        """One `point3`: (3,) float64."""
        found = self.vectors("point3", name)
        if found is not None and len(found) != 1:
            raise self.fail(name, f'"point3 {name}" is one point, not {len(found)}')
        return np.array(default) if found is None else found[0] + 0.0

    def vectors(self, type_: str, name: str) -> Array | None:
        """All values of a `point3`, `point2` and the like as rows: (m, 3) or (m, 2) float64; None if not
        given.
        """
        parameter = self.take(name, type_)
        if parameter is None:
            return None
        size = 2 if type_.endswith("2") else 3
        if not len(parameter.values) or len(parameter.values) % size:
            count = len(parameter.values)
            raise SceneError(
                f"{parameter} takes groups of {size} numbers, not {count} numbers", parameter.where
            )
        return self.values(parameter).reshape(-1, size)

    def numbers(self, name: str) -> Array | None:
        """All values of a `float` list, (m,) float64; None if not given."""
        parameter = self.take(name, "float")
        return None if parameter is None else self.values(parameter)

    def integers(self, name: str) -> tuple[NDArray[np.int64], Values] | None:
        """All values of an `integer` list, (m,) int64, and their tokens for messages; None if not given."""
        parameter = self.take(name, "integer")
        if parameter is None:
            return None
        values = parameter.values
        array = values.integers()
        if array is not None and array.size and array.min() >= -INT32_MAX and array.max() <= INT32_MAX:
            return array, values
        return np.array([self._whole(token) for token in values], dtype=np.int64), values

    def values(self, parameter: Parameter) -> Array:
        """The numbers of a parameter that `take` gave: (m,) float64."""
        found = parameter.values.array(self._bindings.number)
        found += 0.0  # -0 becomes 0, in place: a mesh may be most of the memory
        return found

    def take(self, name: str, *types: str) -> Parameter | None:
        """The parameter `name`, now read, or None if not given. SceneError if it has none of these types.

        A blackbody may stand in place of a spectrum. A texture that pbrt would accept is reported, and
        replaced by its mean; None if that is unknown. An `Attribute` of another type is meant for other
        directives.
        """
        if "spectrum" in types and "blackbody" not in types:
            types = (*types, "blackbody")
        self._supported.append((types, name))
        if name not in self._given and not self._defaults:
            return None
        self._unread.pop(name, None)
        for parameter in self._items(name):
            if parameter.type in types:
                return parameter
            allowed = " or ".join(f'"{type_} {name}"' for type_ in types)
            if parameter.type == "texture" and any(form in types for form in TEXTURED):
                return self._mean(parameter, types)
            if name in self._given:
                raise SceneError(
                    f"{parameter} of {self.owner} must be declared as {allowed}", parameter.where
                )
        return None

    def ignore(self) -> None:
        """Mark all remaining parameters as read: they change nothing, or the directive as a whole is not
        supported.
        """
        self._unread.clear()

    def textures(self) -> list[str]:
        """The names of the textures that parameters name."""
        named = (item for item in self._given.values() if item.type == "texture")
        return [token.text for item in named for token in item.values]

    def _mean(self, parameter: Parameter, types: Sequence[str]) -> Parameter | None:
        """The mean of a texture in its place, a number or a colour; None if it is not known yet."""
        single = "float" in types
        mean = None
        if self.mean is not None and len(parameter.values) == 1:
            mean = self.mean("float" if single else "spectrum", parameter.values.token(0).text)
        nearest = "as its default" if mean is None else "as its mean"
        self._report.substitute(f"{parameter} of {self.owner}", nearest, parameter.where)
        if mean is None:
            return None
        token = parameter.values.token(0)
        numbers = mean[:1] if single else mean
        words = [replace(token, kind="word", text=repr(float(number))) for number in numbers]
        return replace(parameter, type="float" if single else "rgb", values=Values(words), space=SRGB)

    def finish(self) -> None:
        """Report each unread parameter, with the names that are supported."""
        for parameter in self._unread.values():
            if parameter.name in EFFECTIVE:
                self._report.substitute(f"{parameter} of {self.owner}", "without it", parameter.where)
                continue
            named = [f'"{type_} {name}"' for types, name in self._supported for type_ in types]
            supported = ", ".join(dict.fromkeys(named)) or "none"
            self._report.add(
                f"{parameter} is not supported by {self.owner}; supported parameters: {supported}",
                parameter.where,
            )

    def _one(self, type_: str, name: str, default: T, convert: Callable[[Token], T]) -> T:
        parameter = self.take(name, type_)
        if parameter is None:
            return default
        return _single(parameter, convert)

    def _whole(self, token: Token) -> int:
        value = self._bindings.number(token)
        decimal = not token.text.startswith("$") and not token.text.lstrip("+-").isdigit()
        if decimal or value != int(value) or abs(value) > INT32_MAX:
            raise SceneError(f"{_shown(token, value)} is not a whole number of 32 bits", token.where)
        return int(value)


def _single(parameter: Parameter, convert: Callable[[Token], T]) -> T:
    if len(parameter.values) != 1:
        raise SceneError(f"{parameter} takes one value, not {len(parameter.values)}", parameter.where)
    return convert(parameter.values.token(0))


def _shown(token: Token, value: float) -> str:
    return f"{token} = {value:g}" if token.text.startswith("$") else token.text


def _string(token: Token) -> str:
    if token.kind != "string":
        raise SceneError(f"{token} is not a quoted string", token.where)
    return token.text


def _bool(token: Token) -> bool:
    if token.text not in ("true", "false"):
        raise SceneError(f"{token} is not a bool: write true or false", token.where)
    return token.text == "true"
