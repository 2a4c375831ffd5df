"""Parameters of Mitsuba's plug-ins: numbers, colours and transformations."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scenes.arrays import Array
from scenes.color import sampled
from scenes.errors import Location, SceneError
from scenes.images.encodings import decoded
from scenes.pbrt.transforms import look_at, rotate

_APART = re.compile(r"[\s,]+")
_HEX = re.compile(r"#([0-9a-fA-F]{6})")


@dataclass(eq=False)
class Node:
    """One XML element, with its place in its file."""

    tag: str
    attributes: dict[str, str]
    where: Location
    children: list[Node]

    def attribute(self, name: str) -> str:
        """An attribute; SceneError if it is missing."""
        if name not in self.attributes:
            raise SceneError(f"<{self.tag}> needs the attribute {name!r}", self.where)
        return self.attributes[name]


def floats(node: Node, count: int, name: str = "value", default: float | None = None) -> list[float]:
    """The `count` finite numbers of an attribute; `[default]` if it is missing and there is a default."""
    if default is not None and name not in node.attributes:
        return [default]
    words = [word for word in _APART.split(node.attribute(name).strip()) if word]
    try:
        values = [float(word) for word in words]
    except ValueError:
        raise SceneError(f"{node.attributes[name]!r} is no list of numbers", node.where) from None
    if len(values) != count or not np.isfinite(values).all():
        raise SceneError(
            f"<{node.tag}> takes {count} finite numbers, not {node.attributes[name]!r}", node.where
        )
    return values


def color_of(node: Node) -> Array:
    """The linear RGB (3,) of <rgb>, <spectrum> or <float>, as Mitsuba's RGB variants have it.

    A spectrum of several wavelengths is projected to RGB as pbrt's are.
    """
    text = node.attribute("value").strip()
    if (match := _HEX.fullmatch(text)) is not None:
        return decoded(np.frombuffer(bytes.fromhex(match[1]), dtype=np.uint8) / 255.0, "sRGB")
    if node.tag == "spectrum" and ":" in text:
        return _sampled(node, text)
    words = [word for word in _APART.split(text) if word]
    if node.tag not in ("rgb", "spectrum", "float") or len(words) not in (1, 3):
        raise SceneError(f"<{node.tag}> of {text!r} is no colour: give one number or three", node.where)
    values = np.array(floats(node, len(words)))
    return np.broadcast_to(values, 3).copy()


def _sampled(node: Node, text: str) -> Array:
    try:
        pairs = np.array([[float(part) for part in word.split(":")] for word in _APART.split(text) if word])
    except ValueError:
        pairs = np.zeros((0, 3))
    if pairs.ndim != 2 or pairs.shape[1] != 2 or len(pairs) < 2 or (np.diff(pairs[:, 0]) <= 0).any():
        raise SceneError("a spectrum is wavelength:value pairs, the wavelengths ascending", node.where)
    return sampled(pairs[:, 0], pairs[:, 1], "unbounded")


def transform_of(node: Node) -> Array:
    """The transformation (4, 4) of an element, whose operations are applied from top to bottom."""
    matrix = np.eye(4)
    for child in node.children:
        if child.tag not in _OPERATIONS:
            raise SceneError(
                f"<{child.tag}> is no transformation; there are: {', '.join(_OPERATIONS)}", child.where
            )
        try:
            matrix = np.asarray(_OPERATIONS[child.tag](child) @ matrix, dtype=np.float64)
        except ValueError as error:
            raise SceneError(f"<{child.tag}>: {error}", child.where) from None
    return matrix


def _translate(node: Node) -> Array:
    out = np.eye(4)
    out[:3, 3] = _xyz(node, 0.0)
    return out


def _scale(node: Node) -> Array:
    return np.diag([*_xyz(node, 1.0), 1.0])


def _rotate(node: Node) -> Array:
    return rotate(floats(node, 1, "angle")[0], *_xyz(node, 0.0)).matrix


def _look_at(node: Node) -> Array:
    """The same matrix as pbrt's: x is up cross z, which Mitsuba's cameras show to the left."""
    origin, target = (np.array(floats(node, 3, name)) for name in ("origin", "target"))
    up = np.array(floats(node, 3, "up")) if "up" in node.attributes else _any_up(target - origin)
    return look_at(origin, target, up).inverse


def _any_up(forward: Array) -> Array:
    return np.eye(3)[int(np.argmin(np.abs(forward)))]


def _matrix(node: Node) -> Array:
    words = _APART.split(node.attribute("value").strip())
    if len(words) == 9:
        out = np.eye(4)
        out[:3, :3] = np.array(floats(node, 9)).reshape(3, 3)
        return out
    out = np.array(floats(node, 16)).reshape(4, 4)
    if out[3].tolist() != [0, 0, 0, 1]:
        raise SceneError(
            "the last row of a matrix must be 0 0 0 1: projections are not converted", node.where
        )
    return out


def _xyz(node: Node, default: float) -> list[float]:
    if "value" in node.attributes:
        words = [word for word in _APART.split(node.attributes["value"].strip()) if word]
        values = floats(node, len(words) if len(words) in (1, 3) else 3)
        return values * (3 // len(values))
    return [floats(node, 1, axis, default)[0] for axis in "xyz"]


_OPERATIONS: dict[str, Callable[[Node], Array]] = {
    "translate": _translate,
    "scale": _scale,
    "rotate": _rotate,
    "lookat": _look_at,
    "look_at": _look_at,
    "matrix": _matrix,
}
