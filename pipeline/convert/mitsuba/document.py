"""Mitsuba's XML as plug-ins with their parameters, each with its place in its file.

As in Mitsuba, `<default>` sets the value of `$name` unless the caller did, `<include>` is replaced by the
content of another file, and `<ref>` by the plug-in with its id, wherever that is. A document type declaration
is refused, so that no entity expands; nothing is fetched.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.parsers import expat

import numpy as np

from pipeline.convert.mitsuba.values import Array, Node, color_of, floats, transform_of
from scenes.errors import Location, PenumbraError, SceneError
from scenes.files import Files, read_bytes

DEPTH = 100  # of elements inside each other, and of files that include each other
PLUGINS = (
    "scene", "shape", "bsdf", "emitter", "sensor", "film", "rfilter", "sampler", "integrator", "texture",
    "medium", "phase", "volume",
)  # fmt: skip
_NAME = re.compile(r"\$\{?([A-Za-z_][A-Za-z0-9_]*)\}?")


@dataclass(eq=False)
class Plugin:
    """One plug-in of a scene. name: as its parent calls it. values: its parameters. parts: plug-ins
    inside it.
    """

    tag: str
    type: str
    name: str
    where: Location
    values: dict[str, Node] = field(default_factory=dict[str, Node])
    parts: list[Plugin] = field(default_factory=list["Plugin"])
    reference: str | None = None
    read: set[str] = field(default_factory=set[str])  # the parameters that were asked for

    def _get(self, name: str) -> Node | None:
        self.read.add(name)
        return self.values.get(name)

    def part(self, tag: str, name: str | None = None) -> Plugin | None:
        """The first plug-in of a kind, with that name if one is given."""
        return next((p for p in self.parts if p.tag == tag and name in (None, p.name)), None)

    def all(self, tag: str) -> list[Plugin]:
        """All plug-ins of a kind."""
        return [part for part in self.parts if part.tag == tag]

    def given(self, name: str) -> bool:
        """Whether there is a parameter of this name."""
        return self._get(name) is not None

    def number(self, name: str, default: float) -> float:
        node = self._get(name)
        return default if node is None else floats(node, 1)[0]

    def count(self, name: str, default: int) -> int:
        """A whole number of at least 1."""
        value = self.number(name, float(default))
        if value != int(value) or value < 1:
            raise SceneError(f"{name} must be a whole number above 0, not {value:g}", self.values[name].where)
        return int(value)

    def text(self, name: str, default: str) -> str:
        node = self._get(name)
        return default if node is None else node.attributes.get("value", default)

    def flag(self, name: str, default: bool) -> bool:
        text = self.text(name, str(default).lower()).lower()
        if text not in ("true", "false"):
            raise SceneError(f"{name} must be true or false, not {text!r}", self.values[name].where)
        return text == "true"

    def vector(self, name: str, default: tuple[float, float, float]) -> Array:
        """A point or a vector, (3,)."""
        node = self._get(name)
        if node is None:
            return np.array(default)
        if "value" in node.attributes:
            return np.array(floats(node, 3))
        return np.array([floats(node, 1, axis, 0.0)[0] for axis in "xyz"])

    def color(self, name: str, default: float) -> Array:
        """A colour in linear RGB, (3,)."""
        node = self._get(name)
        return np.full(3, default) if node is None else color_of(node)

    def transform(self, name: str = "to_world") -> Array:
        """A transformation (4, 4), the identity if none is given."""
        node = self._get(name)
        return np.eye(4) if node is None else transform_of(node)


def read_document(path: Path, given: Mapping[str, str], files: Files) -> Plugin:
    """Read the scene of an XML file. given: a value for each `$name`.

    SceneError at the place of malformed text, PenumbraError for a name that the file does not use.
    """
    reader = _Reader(dict(given), files)
    root = _parse(path)
    if root.tag != "scene":
        raise SceneError(
            f"the root element is <{root.tag}>, not <scene>: this is no Mitsuba scene", root.where
        )
    scene = Plugin("scene", "scene", "", root.where)
    reader.fill(scene, root, (path.resolve(),))
    unused = sorted(set(given) - reader.used)
    if unused:
        raise PenumbraError(f"{path}: nothing stands for ${unused[0]}")
    reader.resolve(scene, ())
    return scene


@dataclass(eq=False)
class _Reader:
    defaults: dict[str, str]
    files: Files
    used: set[str] = field(default_factory=set[str])
    named: dict[str, Plugin] = field(default_factory=dict[str, Plugin])

    def __post_init__(self) -> None:
        self._given = frozenset(self.defaults)

    def fill(self, owner: Plugin, node: Node, files: tuple[Path, ...]) -> None:
        """Read the children of an element into a plug-in. files: the files that include each other so far."""
        for raw in node.children:
            child = self._substituted(raw)
            if child.tag == "default":
                name = child.attribute("name")
                self.used.add(name)
                self.defaults.setdefault(name, child.attribute("value"))
            elif child.tag == "include":
                self._include(owner, child, files)
            elif child.tag == "ref":
                name = child.attributes.get("name", "")
                owner.parts.append(Plugin("ref", "", name, child.where, reference=child.attribute("id")))
            elif child.tag == "alias":
                alias = Plugin("ref", "", "", child.where, reference=child.attribute("id"))
                self._name(child.attribute("as"), alias, child.where)
            elif child.tag in PLUGINS:
                self._plugin(owner, child, files)
            elif child.tag != "path":
                owner.values[child.attribute("name")] = self._deep(child)

    def _plugin(self, owner: Plugin, child: Node, files: tuple[Path, ...]) -> None:
        if child.tag == "scene":
            raise SceneError("a <scene> inside another", child.where)
        made = Plugin(child.tag, child.attribute("type"), child.attributes.get("name", ""), child.where)
        if "id" in child.attributes:
            self._name(child.attributes["id"], made, child.where)
        owner.parts.append(made)
        self.fill(made, child, files)

    def _name(self, name: str, plugin: Plugin, where: Location) -> None:
        if name in self.named:
            raise SceneError(f"the id {name!r} is given twice", where)
        self.named[name] = plugin

    def _include(self, owner: Plugin, child: Node, files: tuple[Path, ...]) -> None:
        path = self.files.find(child.attribute("filename"), files[-1].parent, child.where)
        if path.resolve() in files or len(files) >= DEPTH:
            raise SceneError(
                f"{path.name!r} includes itself, or too many files include each other", child.where
            )
        try:
            root = _parse(path)
        except SceneError:
            raise
        except PenumbraError as error:
            raise SceneError(str(error), child.where) from None
        wrapper = root if root.tag == "scene" else Node("scene", {}, root.where, [root])
        self.fill(owner, wrapper, (*files, path.resolve()))

    def _substituted(self, node: Node) -> Node:
        def value(match: re.Match[str]) -> str:
            name = match.group(1)
            if name not in self.defaults:
                raise SceneError(f"nothing is given for ${name}: set it with -D {name}=VALUE", node.where)
            self.used.add(name)
            return self.defaults[name]

        if not any("$" in text for text in node.attributes.values()):
            return node
        return replace(
            node, attributes={key: _NAME.sub(value, text) for key, text in node.attributes.items()}
        )

    def _deep(self, node: Node) -> Node:
        return replace(node, children=[self._deep(self._substituted(child)) for child in node.children])

    def resolve(self, plugin: Plugin, inside: tuple[Plugin, ...]) -> None:
        """Replace references by the plug-ins with their ids; SceneError for an unknown id, and for a
        cycle.
        """
        if plugin in inside:
            raise SceneError("a plug-in refers to itself", plugin.where)
        plugin.parts = [self._target(part, 0) for part in plugin.parts]
        for part in plugin.parts:
            self.resolve(part, (*inside, plugin))

    def _target(self, part: Plugin, depth: int) -> Plugin:
        if part.reference is None:
            return part
        if part.reference not in self.named or depth > DEPTH:
            raise SceneError(f"no plug-in has the id {part.reference!r}", part.where)
        found = self._target(self.named[part.reference], depth + 1)
        return found if not part.name else replace(found, name=part.name)


def _parse(path: Path) -> Node:
    """The root element of an XML file; SceneError at the place of malformed XML."""
    data = read_bytes(path)
    parser = expat.ParserCreate()
    root = Node("", {}, Location(str(path), 1, 1), [])
    stack = [root]

    def where() -> Location:
        return Location(str(path), parser.CurrentLineNumber, parser.CurrentColumnNumber + 1)

    def refuse(*_: object) -> None:
        raise SceneError(
            "a document type declaration is not read: its entities may grow without end", where()
        )

    def begin(tag: str, attributes: dict[str, str]) -> None:
        if len(stack) > DEPTH:
            raise SceneError(f"elements more than {DEPTH} deep", where())
        node = Node(tag, attributes, where(), [])
        stack[-1].children.append(node)
        stack.append(node)

    def end(_: str) -> None:
        stack.pop()

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        place = Location(str(path), error.lineno, error.offset + 1)
        raise SceneError(f"no XML that can be read: {expat.ErrorString(error.code)}", place) from None
    return root.children[0]
