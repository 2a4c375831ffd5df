"""The tokens of a scene file and of what it includes, as one stream."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from scenes.errors import Location, SceneError
from scenes.tokens import Source, Token, read_source, tokenize

INCLUDE_DEPTH = 16
INCLUDE_COUNT = 1000  # files that include each other twice would else grow as a power of two


class TokenStream:
    """Tokens one after another, through the files that `include` opens and back."""

    def __init__(self, source: Source, start: int) -> None:
        self._main = source
        self._stack: list[tuple[Source, Iterator[Token]]] = [(source, tokenize(source, start))]
        self._peeked: Token | None = None
        self._included = 0

    def next(self) -> Token | None:
        """The next token; None at the end."""
        if self._peeked is not None:
            token, self._peeked = self._peeked, None
            return token
        while self._stack:
            token = next(self._stack[-1][1], None)
            if token is not None:
                return token
            self._stack.pop()
        return None

    def peek(self) -> Token | None:
        """The next token, left where it is."""
        if self._peeked is None:
            self._peeked = self.next()
        return self._peeked

    def required(self, owner: Token, wanted: str) -> Token:
        """The next token; SceneError at `owner` where the file ends instead."""
        token = self.next()
        if token is None:
            raise SceneError(f"the file ends after {owner}, which needs {wanted}", owner.where)
        return token

    def resolve(self, name: str, token: Token) -> Path:
        """A file named in the scene: relative to the file that names it, else, as in pbrt, to the main file."""
        for source in (token.source, self._main):
            if source.folder is not None:
                path = source.folder / name
                try:
                    if path.exists():
                        return path
                except (OSError, ValueError) as error:
                    raise SceneError(f"{name!r} is no file name: {error}", token.where) from None
        return (token.source.folder or Path()) / name

    def include(self, name: str, token: Token) -> None:
        """Continue with the file `name`; SceneError for cycles, depth and what cannot be read."""
        path = self.resolve(name, token)
        here = [Path(source.file).resolve() for source, _ in self._stack]
        if path.resolve() in here:
            raise SceneError(f"{name!r} includes itself", token.where)
        self._included += 1
        if len(self._stack) >= INCLUDE_DEPTH or self._included > INCLUDE_COUNT:
            raise SceneError(
                f"too many includes: at most {INCLUDE_DEPTH} inside each other and {INCLUDE_COUNT} in all", token.where
            )
        source = read_source(path, token.where)
        self._stack.append((source, tokenize(source)))

    def end(self) -> Location:
        """The end of the main file, for what is missing from it."""
        return self._main.location(len(self._main.text))
