"""Nested blocks of a scene file: attributes, objects and imported files. The end of each restores
the state.
"""

from __future__ import annotations

from dataclasses import dataclass

from scenes.errors import SceneError
from scenes.pbrt.state import Builder, GraphicsState, InstanceUse, check_room
from scenes.pbrt.text.lexer import Token

NESTING_LIMIT = 10_000
INSTANCE_LIMIT = 10_000_000
OPENED_BY = {"AttributeEnd": "AttributeBegin", "TransformEnd": "TransformBegin", "ObjectEnd": "ObjectBegin"}
# pbrt-v4 takes TransformBegin for AttributeBegin, with a warning.
SAME = {"TransformBegin": "AttributeBegin", "TransformEnd": "AttributeEnd"}


@dataclass(frozen=True, eq=False)
class _Block:
    state: GraphicsState
    token: Token

    @property
    def name(self) -> str:
        return SAME.get(self.token.text, self.token.text)


class Blocks:
    """The blocks that are open."""

    def __init__(self, builder: Builder) -> None:
        self._builder = builder
        self._open: list[_Block] = []

    def begin(self, token: Token) -> None:
        """Save the state at `token`, the directive that opens a block."""
        if len(self._open) >= NESTING_LIMIT:
            raise SceneError(f"{token} inside more than {NESTING_LIMIT} others", token.where)
        self._open.append(_Block(self._builder.state, token))

    def end(self, token: Token) -> None:
        """Restore the state that the innermost block saved. SceneError if `token` closes another kind of
        block; a superfluous `AttributeEnd` is ignored, as by pbrt.
        """
        opener = OPENED_BY[token.text]
        if not self._open or self._open[-1].name == "Import":
            if SAME.get(token.text, token.text) == "AttributeEnd":
                self._builder.report.remark(f"{token} without {opener} is ignored, as in pbrt", token.where)
                return
            raise SceneError(f"{token} without {opener}", token.where)
        block = self._open[-1]
        if block.name != SAME.get(opener, opener):
            raise SceneError(f"{token} where {block.token} is open since {block.token.where}", token.where)
        self._builder.state = self._open.pop().state

    def end_import(self, token: Token) -> None:
        """Close an imported file: its blocks must be closed, and its state does not reach the importing
        file.
        """
        block = self._open[-1]
        if block.token is not token:
            raise SceneError(_unclosed(block.token), block.token.where)
        self._builder.state = self._open.pop().state

    def check_closed(self) -> None:
        """SceneError at the innermost block that is still open."""
        if self._open:
            token = self._open[-1].token
            raise SceneError(_unclosed(token), token.where)

    def begin_object(self, name: str, token: Token) -> None:
        """`ObjectBegin`: keep the shapes that follow for `ObjectInstance`."""
        builder = self._builder
        if builder.current_object is not None:
            raise SceneError("ObjectBegin inside another object", token.where)
        if name in builder.objects:
            raise SceneError(f"object {name!r} is made twice", token.where)
        check_room(builder.objects, "objects", token.where)
        self.begin(token)
        builder.objects[name] = []
        builder.current_object = name

    def end_object(self, token: Token) -> None:
        """`ObjectEnd`: close the object."""
        self.end(token)
        self._builder.current_object = None

    def instance(self, name: str, token: Token) -> None:
        """`ObjectInstance`. Its object may be declared later, as in pbrt."""
        builder = self._builder
        if builder.current_object is not None:
            raise SceneError("ObjectInstance inside an object: objects do not nest", token.where)
        if len(builder.uses) >= INSTANCE_LIMIT:
            raise SceneError(f"more than {INSTANCE_LIMIT:,} instances", token.where)
        builder.check_placed("an instance", token.where)
        builder.uses.append(InstanceUse(name, builder.state.transform, token.where))


def _unclosed(token: Token) -> str:
    return f"{token} without {next(end for end, begin in OPENED_BY.items() if begin == token.text)}"
