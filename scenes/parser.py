"""pbrt-v4 text to a frozen `SceneDescription`.

The part of the format that is read: LookAt, Translate, Scale, Rotate, Transform, ConcatTransform, Identity,
CoordinateSystem, CoordSysTransform; AttributeBegin/End, ReverseOrientation, Include; Camera "perspective",
Film "rgb", PixelFilter "box", Sampler, Integrator "path"; Material "diffuse", MakeNamedMaterial, NamedMaterial;
AreaLightSource "diffuse"; Shape trianglemesh, plymesh, bilinearmesh, sphere, disk. Whatever else stands in a file
is an error with its place, and so is a parameter that nothing would read.

Where a file says nothing of filter, integrator or sampler, ours hold: the box filter of one pixel, direct light,
independent samples (pbrt's would be a gaussian, five bounces, zsobol). `scenes.export` always writes them out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from scenes.description import Diffuse, SceneDescription, ShapeDescription
from scenes.directives import (
    DEFAULT_REFLECTANCE,
    OPTIONS,
    WORLD,
    Builder,
    GraphicsState,
    Handler,
    NamedMaterial,
    PlacedShape,
)
from scenes.errors import Location, SceneError
from scenes.parameters import TYPES, Parameter, Parameters
from scenes.stream import TokenStream
from scenes.template import Bindings, Header, Values, read_header
from scenes.tokens import Source, Token, decode, read_source
from scenes.transforms import ARGUMENTS, apply_directive, identity

NESTING_LIMIT = 256
# Directives of pbrt-v4 that are known and not supported, so that the message can tell them from misspellings.
NOT_YET = (
    *("Accelerator", "ActiveTransform", "Attribute", "Import", "LightSource", "MakeNamedMedium", "MediumInterface"),
    *("ObjectBegin", "ObjectEnd", "ObjectInstance", "Option", "Texture"),
    *("TransformBegin", "TransformEnd", "TransformTimes"),
)


def parse_file(path: Path, parameters: Values | None = None, name: str | None = None) -> SceneDescription:
    """Read a .pbrt file; SceneError or PenumbraError in one line for whatever is wrong with it.

    parameters: values for the template's `$name`s. name: of the scene, by default the file's without extension.
    """
    return parse_source(read_source(path), parameters, name or path.stem)


def parse(text: str | bytes, parameters: Values | None = None, file: str = "<text>") -> SceneDescription:
    """Parse scene text; the files that it names are relative to the working directory."""
    source = Source(file, decode(text, file) if isinstance(text, bytes) else text)
    return parse_source(source, parameters, Path(file).stem)


def parse_source(source: Source, parameters: Values | None, name: str) -> SceneDescription:
    """Parse a text that has been read."""
    header = read_header(source)
    reader = _Reader(source, header, parameters or {})
    reader.run()
    return reader.description(name)


class _Reader:
    """One pass over a scene: reads a directive, hands it to its meaning, until the text ends."""

    def __init__(self, source: Source, header: Header, parameters: Values) -> None:
        self._tokens = TokenStream(source, header.end)
        self._bindings = Bindings(header, parameters)
        self._builder = Builder()
        self._saved: list[tuple[GraphicsState, Token]] = []
        self._words: dict[str, Callable[[Token], None]] = {
            "WorldBegin": self._world_begin,
            "AttributeBegin": self._attribute_begin,
            "AttributeEnd": self._attribute_end,
            "ReverseOrientation": self._reverse_orientation,
            "NamedMaterial": self._named_material,
            "CoordinateSystem": self._coordinate_system,
            "CoordSysTransform": self._coord_sys_transform,
            "ColorSpace": self._color_space,
            "Include": self._include,
        }

    def run(self) -> None:
        while (token := self._tokens.next()) is not None:
            if token.kind != "word":
                raise SceneError(f"{token} stands where a directive should", token.where)
            self._directive(token)
        if self._saved:
            raise SceneError("AttributeBegin without AttributeEnd", self._saved[-1][1].where)
        self._bindings.check_used()

    def _directive(self, token: Token) -> None:
        name = token.text
        if name in ARGUMENTS:
            self._transform(token)
        elif name in self._words:
            self._words[name](token)
        elif name in OPTIONS:
            self._option(token)
        elif name in WORLD:
            self._need_world(token)
            self._run(WORLD[name], token)
        else:
            raise self._unknown(token)

    def _unknown(self, token: Token) -> SceneError:
        if token.text in NOT_YET:
            kind = self._tokens.peek()
            shown = f"{token.text} {kind}" if kind is not None and kind.kind == "string" else token.text
            return SceneError(f"{shown} is not supported yet; supported: {self._supported()}", token.where)
        return SceneError(f"unknown directive {_short(token.text)!r}; supported: {self._supported()}", token.where)

    def _supported(self) -> str:
        return ", ".join(sorted([*ARGUMENTS, *self._words, *OPTIONS, *WORLD]))

    def _option(self, token: Token) -> None:
        if self._builder.in_world:
            raise SceneError(f"{token.text} must come before WorldBegin", token.where)
        if token.text in self._builder.seen:
            raise SceneError(f"{token.text} is given twice", token.where)
        self._builder.seen.add(token.text)
        self._run(OPTIONS[token.text], token)

    def _need_world(self, token: Token) -> None:
        if not self._builder.in_world:
            raise SceneError(f"{token.text} must come after WorldBegin", token.where)

    def _run(self, handler: Handler, token: Token) -> None:
        """Read the kind and the parameter list of a directive and hand them to its meaning."""
        kind = self._string(token)
        items: list[Parameter] = []
        while (head := self._tokens.peek()) is not None and head.kind == "string":
            self._tokens.next()
            items.append(self._parameter(head))
        parameters = Parameters(token.text, token.where, items, self._bindings)
        handler(self._builder, kind, parameters, lambda name: self._tokens.resolve(name, token))
        parameters.finish()

    def _parameter(self, head: Token) -> Parameter:
        words = head.text.split()
        if len(words) != 2:
            raise SceneError(f'{head} is no parameter: write "type name" and its values', head.where)
        if words[0] not in TYPES:
            raise SceneError(f"unknown parameter type {words[0]!r}; there are: {', '.join(TYPES)}", head.where)
        first = self._tokens.required(head, "a value")
        if first.kind != "[":
            return Parameter(words[0], words[1], (first,), head.where)
        return Parameter(words[0], words[1], self._bracketed(first), head.where)

    def _bracketed(self, opening: Token) -> list[Token]:
        values: list[Token] = []
        while (token := self._tokens.required(opening, "a closing ]")).kind != "]":
            if token.kind == "[":
                raise SceneError("a [ inside a list of values", token.where)
            values.append(token)
        return values

    def _string(self, owner: Token) -> str:
        token = self._tokens.required(owner, "a quoted string")
        if token.kind != "string":
            raise SceneError(f"{owner} needs a quoted string, not {token}", token.where)
        return token.text

    def _transform(self, token: Token) -> None:
        count = ARGUMENTS[token.text]
        if count == 16:
            values = self._bracketed(self._opening(token))
        else:
            values = [self._tokens.required(token, f"{count} numbers") for _ in range(count)]
        if len(values) != count:
            raise SceneError(f"{token.text} takes {count} numbers, not {len(values)}", token.where)
        numbers = [self._bindings.number(value) for value in values]
        current = apply_directive(token.text, numbers, self._builder.state.transform, token.where)
        self._builder.state = replace(self._builder.state, transform=current)

    def _opening(self, owner: Token) -> Token:
        token = self._tokens.required(owner, "numbers in brackets")
        if token.kind != "[":
            raise SceneError(f"{owner} needs its numbers in brackets", token.where)
        return token

    def _world_begin(self, token: Token) -> None:
        if self._builder.in_world:
            raise SceneError("WorldBegin is given twice", token.where)
        self._builder.in_world = True
        self._builder.state = replace(self._builder.state, transform=identity())
        self._builder.systems["world"] = identity()

    def _attribute_begin(self, token: Token) -> None:
        self._need_world(token)
        if len(self._saved) >= NESTING_LIMIT:
            raise SceneError(f"AttributeBegin inside more than {NESTING_LIMIT} others", token.where)
        self._saved.append((self._builder.state, token))

    def _attribute_end(self, token: Token) -> None:
        if not self._saved:
            raise SceneError("AttributeEnd without AttributeBegin", token.where)
        self._builder.state = self._saved.pop()[0]

    def _reverse_orientation(self, token: Token) -> None:
        self._need_world(token)
        self._builder.state = replace(self._builder.state, reverse=not self._builder.state.reverse)

    def _named_material(self, token: Token) -> None:
        self._need_world(token)
        material = NamedMaterial(self._string(token), token.where)
        self._builder.state = replace(self._builder.state, material=material)

    def _coordinate_system(self, token: Token) -> None:
        self._builder.systems[self._string(token)] = self._builder.state.transform

    def _coord_sys_transform(self, token: Token) -> None:
        name = self._string(token)
        if name not in self._builder.systems:
            known = ", ".join(self._builder.systems) or "none"
            raise SceneError(f"no coordinate system is called {name!r}; there are: {known}", token.where)
        self._builder.state = replace(self._builder.state, transform=self._builder.systems[name])

    def _color_space(self, token: Token) -> None:
        name = self._string(token)
        if name != "srgb":
            raise SceneError(f'ColorSpace "{name}" is not supported; supported: "srgb"', token.where)

    def _include(self, token: Token) -> None:
        self._tokens.include(self._string(token), token)

    def description(self, name: str) -> SceneDescription:
        builder, end = self._builder, self._tokens.end()
        if not builder.in_world:
            raise SceneError("the scene has no WorldBegin", end)
        if builder.camera is None:
            raise SceneError("the scene has no Camera", end)
        shapes = tuple(_with_material(shape, builder.materials) for shape in builder.shapes)
        parameters = tuple(self._bindings.values.items())
        return SceneDescription(name, builder.camera, builder.film, shapes, builder.defaults, parameters)


def _with_material(shape: PlacedShape, materials: Mapping[str, Diffuse]) -> ShapeDescription:
    material = shape.material
    if material is None:
        material = Diffuse(np.full(3, DEFAULT_REFLECTANCE))
    elif isinstance(material, NamedMaterial):
        material = _named(material.name, material.where, materials)
    return ShapeDescription(shape.geometry, material, shape.emission, shape.where)


def _named(name: str, where: Location, materials: Mapping[str, Diffuse]) -> Diffuse:
    if name not in materials:
        raise SceneError(f"no material is called {name!r}; there are: {', '.join(materials) or 'none'}", where)
    return materials[name]


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."
