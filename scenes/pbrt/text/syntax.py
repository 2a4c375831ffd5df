"""The grammar of pbrt-v4 between tokens and meaning: strings, numbers in brackets, parameter lists."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from scenes.errors import Report, SceneError
from scenes.pbrt.text.lexer import Token, odd_space
from scenes.pbrt.text.numbers import SINGLES, Run, Values
from scenes.pbrt.text.parameters import SPELLINGS, TYPES, TYPES_OF_VERSION_3, VERSION_3, Parameter, Parameters
from scenes.pbrt.text.stream import TokenStream
from scenes.pbrt.text.template import Bindings

PARAMETERS = 1000
RETRY = 4  # tokens


class Syntax:
    """Reader of the parts of a directive after its name. space: the current `ColorSpace`."""

    def __init__(
        self, tokens: TokenStream, bindings: Bindings, report: Report, space: Callable[[], str]
    ) -> None:
        self.tokens = tokens
        self._bindings = bindings
        self._report = report
        self._space = space

    def string(self, owner: Token) -> str:
        """A quoted string."""
        token = self.tokens.required(owner, "a quoted string")
        if token.kind != "string":
            raise SceneError(f"{owner} needs a quoted string, not {token}", token.where)
        return token.text

    def word(self, owner: Token, wanted: str) -> str:
        """A word, with or without quotes."""
        token = self.tokens.required(owner, wanted)
        if token.kind not in ("word", "string"):
            raise SceneError(f"{owner} needs {wanted}, not {token}", token.where)
        return token.text

    def numbers(self, owner: Token, count: int) -> list[float]:
        """`count` numbers; 16 of them stand in brackets."""
        if count == 16:
            opening = self.tokens.required(owner, "numbers in brackets")
            if opening.kind != "[":
                raise SceneError(f"{owner} needs its numbers in brackets", opening.where)
            values = self._bracketed(opening)
            if len(values) != count:
                raise SceneError(f"{owner} takes {count} numbers, not {len(values)}", owner.where)
            return values.array(self._bindings.number).tolist()
        tokens = [self.tokens.required(owner, f"{count} numbers") for _ in range(count)]
        return [float(self._bindings.number(token)) for token in tokens]

    def parameters(self, owner: Token, defaults: Sequence[Parameter] = ()) -> Parameters:
        """The parameter list of a directive. defaults: parameters that `Attribute` gave for it."""
        where = owner.where
        return Parameters(
            owner.text,
            where,
            self.items(),
            self._bindings,
            self._report,
            lambda name: self.tokens.find(name, owner),
            defaults,
        )

    def items(self) -> list[Parameter]:
        """The parameters that stand here."""
        items: list[Parameter] = []
        while (head := self.tokens.peek()) is not None and head.kind == "string":
            if len(items) >= PARAMETERS:
                raise SceneError(f"more than {PARAMETERS} parameters of one directive", head.where)
            self.tokens.next()
            items.append(self._parameter(head))
        return items

    def _parameter(self, head: Token) -> Parameter:
        words = head.text.replace("\t", " ").split(" ")
        words = [word for word in words if word]  # what stands behind the name is of no effect, as in pbrt
        if len(words) < 2:
            hint = odd_space(head.text)
            raise SceneError(f'{head} is no parameter: write "type name" and its values{hint}', head.where)
        type_ = SPELLINGS.get(words[0], words[0])
        if type_ in TYPES_OF_VERSION_3:
            raise SceneError(f"parameter type {type_!r} {VERSION_3}", head.where)
        if type_ not in TYPES:
            raise SceneError(
                f"unknown parameter type {words[0]!r}; there are: {', '.join(TYPES)}", head.where
            )
        first = self.tokens.required(head, "a value")
        if first.kind == "]":
            raise SceneError(f"a ] where the value of {head} should stand", first.where)
        values = self._bracketed(first) if first.kind == "[" else Values([first])
        return Parameter(type_, words[1], values, head.where, self._space())

    def _bracketed(self, opening: Token) -> Values:
        parts: list[Run | Token] = []
        singles = 0
        while True:
            # Where no run begins, none does in the next few tokens.
            run = None if singles % RETRY else self.tokens.run()
            if run is not None:
                parts.append(run)
            token = self.tokens.required(opening, "a closing ]")
            if token.kind == "]":
                return Values(parts)
            if token.kind == "[":
                raise SceneError("a [ inside a list of values", token.where)
            singles += 1
            if singles > SINGLES:
                raise SceneError(f"more than {SINGLES:,} values that are no plain numbers", token.where)
            parts.append(token)
