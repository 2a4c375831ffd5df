"""One pass over a scene file: each directive is read whole, then carried out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from scenes.description.textures import Array, mean
from scenes.errors import Report, SceneError, Unsupported
from scenes.files import Files
from scenes.pbrt.blocks import Blocks
from scenes.pbrt.directives.camera import framed
from scenes.pbrt.directives.integrator import option
from scenes.pbrt.directives.media import report_media
from scenes.pbrt.directives.shapes import mesh_run
from scenes.pbrt.directives.table import ANYWHERE, ATTRIBUTE_TARGETS, OPTIONS, WORLD
from scenes.pbrt.directives.textures import declare, texture
from scenes.pbrt.state import Builder, MediumInterface, NamedMaterial, check_room
from scenes.pbrt.text.lexer import Source, Token, odd_space
from scenes.pbrt.text.parameters import SPACES, VERSION_3, Parameters
from scenes.pbrt.text.stream import TokenStream
from scenes.pbrt.text.syntax import PARAMETERS, Syntax
from scenes.pbrt.text.template import Bindings, Header
from scenes.pbrt.transforms import ARGUMENTS, Transform, apply_directive, identity

NO_INTEGRATOR = (
    "the file has no Integrator: this is its direct light; pbrt would follow paths for five bounces"
)

OFTEN = 512  # directives, after which is looked at the clock
PATIENCE = 1.0  # seconds


class Reader:
    """Fills a `Builder` from the text. Unsupported things go to the builder's report, and reading goes on.
    progress: called with the share of the main file that is read, after PATIENCE seconds.
    """

    def __init__(
        self,
        source: Source,
        header: Header,
        bindings: Bindings,
        files: Files,
        report: Report,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        self.builder = Builder(report=report)
        self._progress = progress
        self._problem: SceneError | None = (
            None  # the first one of values; reading goes on for what else is not supported
        )
        self._tokens = TokenStream(source, header.end, files)
        self._syntax = Syntax(self._tokens, bindings, self.builder.report, lambda: self.builder.state.space)
        self._options: dict[str, Callable[[], None]] = {}
        # Textures that are made at the end, or earlier where their mean is asked for; by type and name.
        self._late: dict[tuple[str, str], tuple[Parameters, Callable[[], None]]] = {}
        self._blocks = Blocks(self.builder)
        # What only the world holds, and what may stand on both sides of WorldBegin.
        self._world_words: dict[str, Callable[[Token], None]] = {
            "AttributeBegin": self._blocks.begin,
            "AttributeEnd": self._blocks.end,
            "TransformBegin": self._blocks.begin,
            "TransformEnd": self._blocks.end,
            "ObjectBegin": lambda token: self._blocks.begin_object(self._syntax.string(token), token),
            "ObjectEnd": self._blocks.end_object,
            "ObjectInstance": lambda token: self._blocks.instance(self._syntax.string(token), token),
            "ReverseOrientation": self._reverse_orientation,
            "NamedMaterial": self._named_material,
            "Texture": self._texture,
            "Import": self._import,
        }
        self._words: dict[str, Callable[[Token], None]] = {
            "WorldBegin": self._world_begin,
            "CoordinateSystem": self._coordinate_system,
            "CoordSysTransform": self._coord_sys_transform,
            "ColorSpace": self._color_space,
            "Attribute": self._attribute,
            "Option": self._option,
            "MediumInterface": self._medium_interface,
            "ActiveTransform": self._active_transform,
            "TransformTimes": self._transform_times,
            "Include": lambda token: self._tokens.include(self._syntax.string(token), token),
        }

    def run(self) -> None:
        """Read to the end. SceneError for malformed text."""
        try:
            with np.errstate(all="ignore"):  # what leaves the range of numbers is refused where it is checked
                self._all()
        finally:  # also of a text that breaks off, so that what is not supported is known
            self._set_options()
            self._make_textures()
            report_media(self.builder)
        if self._problem is not None:
            raise self._problem
        self._blocks.check_closed()
        if not self.builder.in_world:
            raise SceneError("the scene has no WorldBegin", self._tokens.end())

    def _all(self) -> None:
        """Carry out every directive, and report progress if it takes long."""
        started, count = time.monotonic(), 0
        while (token := self._tokens.next()) is not None:
            self._one(token)
            count += 1
            if self._progress is not None and count % OFTEN == 0 and time.monotonic() - started > PATIENCE:
                self._progress(self._tokens.share())

    def _one(self, token: Token) -> None:
        if token.kind == "end":
            self._blocks.end_import(token)
        elif token.kind != "word":
            raise SceneError(f"{token} stands where a directive should", token.where)
        else:
            self._attempt(token, lambda: self._directive(token))

    def _attempt(self, token: Token, read: Callable[[], None]) -> None:
        try:
            read()
        except Unsupported as problem:
            self.builder.report.add(problem.message, problem.location or token.where)

    def _directive(self, token: Token) -> None:
        name = token.text
        if name in ARGUMENTS:
            numbers = self._syntax.numbers(token, ARGUMENTS[name])
            self._transform(lambda one: apply_directive(name, numbers, one, lambda: token.where))
        elif name in self._words:
            self._words[name](token)
        elif name in OPTIONS:
            self._one_option(token)
        elif name in self._world_words:
            self._need_world(token)
            self._world_words[name](token)
        elif name in WORLD or name in ANYWHERE:
            self._parametrised(token)
        else:
            if name == "WorldEnd":
                raise SceneError(f"WorldEnd {VERSION_3}", token.where)
            known = [*ARGUMENTS, *self._words, *self._world_words, *OPTIONS, *WORLD, *ANYWHERE]
            if hint := odd_space(name):
                raise SceneError(f"unknown directive {_short(name)!r}{hint}", token.where)
            raise SceneError(
                f"unknown directive {_short(name)!r}; there are: {', '.join(sorted(known))}", token.where
            )

    def _transform(self, change: Callable[[Transform], Transform]) -> None:
        """Change the active transformations. One object stands for both if they are equal."""
        state = self.builder.state
        start = change(state.transform) if state.active != "EndTime" else state.transform
        if state.end is state.transform and state.active == "All":
            end = start
        else:
            end = change(state.end) if state.active != "StartTime" else state.end
        self.builder.state = state.under(start, end)

    def _parametrised(self, token: Token) -> None:
        if token.text in WORLD:
            self._need_world(token)
        handler, target = WORLD[token.text] if token.text in WORLD else ANYWHERE[token.text]
        plain = token.text == "Shape" and self.builder.state.light is None
        state = self.builder.state
        if plain and state.media is None and not state.attributes.get(target):
            run = self._tokens.meshes()
            if run is not None:
                mesh_run(self.builder, run, token.where)
                return
        kind = self._syntax.string(token)
        parameters = self._syntax.parameters(token, self.builder.state.attributes.get(target, ()))
        parameters.mean = self._mean_texture
        self._mean(parameters, lambda: handler(self.builder, kind, parameters))

    def _mean(self, parameters: Parameters, handle: Callable[[], None]) -> None:
        """Carry out a directive with parameters, once it is read whole."""
        try:
            handle()
            parameters.finish()
        except Unsupported:
            raise
        except SceneError as problem:
            self._problem = self._problem or problem

    def _one_option(self, token: Token) -> None:
        if self.builder.in_world:
            raise SceneError(f"{token.text} must come before WorldBegin", token.where)
        kind = self._syntax.string(token)
        parameters, state = self._syntax.parameters(token), self.builder.state
        if token.text == "Camera":
            self.builder.systems["camera"] = state.transform.inverted(), state.end.inverted()

        def mean() -> None:
            now, self.builder.state = self.builder.state, state
            try:
                self._mean(parameters, lambda: OPTIONS[token.text](self.builder, kind, parameters))
            finally:
                self.builder.state = now

        if self._options.pop(token.text, None) is not None:
            problem = f"{token.text} is given twice: the last one holds, as in pbrt"
            self.builder.report.remark(problem, token.where)
        self._options[token.text] = partial(self._attempt, token, mean)

    def _set_options(self) -> None:
        """Carry out each option once, the last of its name. The camera's may depend on the film."""
        options, self._options = self._options, {}
        camera = options.pop("Camera", None)
        for set_option in (*options.values(), *([] if camera is None else [camera])):
            set_option()

    def _need_world(self, token: Token) -> None:
        if not self.builder.in_world:
            raise SceneError(f"{token.text} must come after WorldBegin", token.where)

    def _world_begin(self, token: Token) -> None:
        if self.builder.in_world:
            raise SceneError("WorldBegin is given twice", token.where)
        self._set_options()
        if self.builder.integrator is None:
            self.builder.report.note(NO_INTEGRATOR, token.where)
        self.builder.camera = framed(self.builder)
        self.builder.in_world = True
        world = identity()
        self.builder.state = replace(self.builder.state, transform=world, end=world, active="All")
        self.builder.systems["world"] = world, world

    def _reverse_orientation(self, token: Token) -> None:
        self.builder.state = replace(self.builder.state, reverse=not self.builder.state.reverse)

    def _named_material(self, token: Token) -> None:
        material = NamedMaterial(self._syntax.string(token), token.where)
        self.builder.state = replace(self.builder.state, material=material)

    def _texture(self, token: Token) -> None:
        name, type_, kind = (self._syntax.string(token) for _ in range(3))
        parameters: Parameters = self._syntax.parameters(
            token, self.builder.state.attributes.get("texture", ())
        )
        try:
            declare(self.builder, name, type_, token.where)
        except SceneError as problem:
            self._problem = self._problem or problem
            return
        transform = self.builder.state.transform

        def one() -> None:
            texture(self.builder, name, type_, kind, parameters, transform)

        make = partial(self._mean, parameters, one)
        if kind == "imagemap":
            make()
        # pbrt makes images first, then numbers, then colours, so that a texture may name one that comes
        # behind it
        else:
            self._late[type_, name] = parameters, partial(self._attempt, token, make)

    def _make_textures(self) -> None:
        for type_ in ("float", "spectrum"):
            for key in [key for key in self._late if key[0] == type_]:
                if key in self._late:
                    self._late.pop(key)[1]()

    def _mean_texture(self, type_: str, name: str) -> Array | None:
        """The mean of a texture, (3,), made now if it can be; else None."""
        self._make_now(type_, name)
        made = self.builder.textures.get((type_, name))
        return None if made is None or made.value is None else mean(made.value)

    def _make_now(self, type_: str, name: str) -> None:
        """Make a texture that has been read, unless one of its parts has not been read so far."""
        parameters, make = self._late.get((type_, name), (None, None))
        if parameters is None or make is None:
            return
        for part in parameters.textures():
            for of in ("float", "spectrum"):
                self._make_now(of, part)
        made = {known for _, known in self.builder.textures}
        if all(part in made for part in parameters.textures()):
            del self._late[type_, name]
            make()

    def _import(self, token: Token) -> None:
        name = self._syntax.string(token)
        end = Token("end", token.text, token.source, token.offset)
        self._blocks.begin(end)
        self._tokens.include(name, token, end)

    def _coordinate_system(self, token: Token) -> None:
        check_room(self.builder.systems, "coordinate systems", token.where)
        self.builder.systems[self._syntax.string(token)] = (
            self.builder.state.transform,
            self.builder.state.end,
        )

    def _coord_sys_transform(self, token: Token) -> None:
        name = self._syntax.string(token)
        if name not in self.builder.systems:
            known = ", ".join(self.builder.systems) or "none"
            problem = (
                f"no coordinate system is called {name!r}: it is ignored, as in pbrt; there are: {known}"
            )
            self.builder.report.remark(problem, token.where)
            return
        start, end = self.builder.systems[name]
        self.builder.state = replace(self.builder.state, transform=start, end=end)

    def _color_space(self, token: Token) -> None:
        name = self._syntax.string(token)
        if name.lower() not in SPACES:
            there = f"it is ignored, as in pbrt; there are: {', '.join(SPACES)}"
            self.builder.report.remark(f"no colour space is called {name!r}: {there}", token.where)
            return
        self.builder.state = replace(self.builder.state, space=name.lower())

    def _attribute(self, token: Token) -> None:
        target = self._syntax.string(token)
        if target not in ATTRIBUTE_TARGETS:
            raise SceneError(f'Attribute "{target}": there are {", ".join(ATTRIBUTE_TARGETS)}', token.where)
        state = self.builder.state
        items = (*state.attributes.get(target, ()), *self._syntax.items())
        by_name = {(item.type, item.name): item for item in items}  # the last one holds
        if len(by_name) > PARAMETERS:
            raise SceneError(f'more than {PARAMETERS} parameters of Attribute "{target}"', token.where)
        self.builder.state = replace(state, attributes={**state.attributes, target: tuple(by_name.values())})

    def _option(self, token: Token) -> None:
        name = self._syntax.string(token)
        value = self._syntax.word(token, "a value")
        option(self.builder, name, value, token.where)

    def _medium_interface(self, token: Token) -> None:
        inside = outside = self._syntax.string(token)
        following = self._tokens.peek()
        if following is not None and following.kind == "string":
            outside = self._syntax.string(token)
        media = MediumInterface(inside, outside, token.where) if inside or outside else None
        self.builder.state = replace(self.builder.state, media=media)

    def _active_transform(self, token: Token) -> None:
        which = self._syntax.word(token, "All, StartTime or EndTime")
        if which not in ("All", "StartTime", "EndTime"):
            raise SceneError(
                f"ActiveTransform is All, StartTime or EndTime, not {_short(which)!r}", token.where
            )
        self.builder.state = replace(self.builder.state, active=which)

    def _transform_times(self, token: Token) -> None:
        self._syntax.numbers(token, 2)  # of no effect: what moves is rendered as it stands at the start


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."
