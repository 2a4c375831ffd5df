"""The tokens of a scene file and of what it includes, as one stream."""

from __future__ import annotations

from pathlib import Path

from scenes.errors import Location, SceneError
from scenes.files import FILE_LIMIT, Files
from scenes.pbrt.text.lexer import Source, Token, Tokenizer, read_source
from scenes.pbrt.text.mesh_runs import MeshRun, read_meshes
from scenes.pbrt.text.numbers import Run, read_run

INCLUDE_DEPTH = 64
INCLUDE_COUNT = 100_000  # files that include each other twice would else grow as a power of two


class TokenStream:
    """Tokens one after another, through the files that `include` opens and back."""

    def __init__(self, source: Source, start: int, files: Files) -> None:
        self._main = source
        self._files = files
        self._stack: list[tuple[Tokenizer, Token | None]] = [(Tokenizer(source, start), None)]
        self._open: list[Path] = [Path(source.file).resolve()]  # the file of each
        self._peeked: Token | None = None
        self._included = self._read = 0
        self._found: dict[tuple[str, Path | None], Path] = {}
        self._tried = source, 0  # up to where no run of meshes begins

    def next(self) -> Token | None:
        """The next token, of kind "end" at the end of an imported file; None at the end of all."""
        if self._peeked is not None:
            token, self._peeked = self._peeked, None
            return token
        while self._stack:
            token = self._stack[-1][0].next()
            if token is not None:
                return token
            _, end = self._stack.pop()
            self._open.pop()
            if end is not None:
                return end
        return None

    def peek(self) -> Token | None:
        """The next token, which stays the next."""
        if self._peeked is None:
            self._peeked = self.next()
        return self._peeked

    def required(self, owner: Token, wanted: str) -> Token:
        """The next token. SceneError at `owner` if the file ends before it."""
        token = self.next()
        if token is None or token.kind == "end":
            raise SceneError(f"the file ends after {owner}, which needs {wanted}", owner.where)
        return token

    def run(self) -> Run | None:
        """The plain numbers that stand here, if they are many; else None."""
        if self._peeked is not None or not self._stack:
            return None
        tokenizer = self._stack[-1][0]
        run = read_run(tokenizer.source, tokenizer.offset)
        if run is not None:
            tokenizer.offset = run.end
        return run

    def meshes(self) -> MeshRun | None:
        """The plain triangle meshes that follow a `Shape` here, if they are many."""
        if self._peeked is not None or not self._stack:
            return None
        tokenizer = self._stack[-1][0]
        source, end = self._tried
        if source is tokenizer.source and tokenizer.offset < end:
            return None
        run, end = read_meshes(tokenizer.source, tokenizer.offset)
        self._tried = tokenizer.source, end
        if run is not None:
            tokenizer.offset = end
        return run

    def find(self, name: str, token: Token) -> Path:
        """The path of a file that the scene names at `token`."""
        key = name, token.source.folder
        if key not in self._found:
            self._found[key] = self._files.find(name, token.source.folder, token.where)
        return self._found[key]

    def include(self, name: str, token: Token, end: Token | None = None) -> None:
        """Continue with the file `name`, and give `end` after it. SceneError for cycles, depth and files that
        cannot be read.
        """
        path = self.find(name, token)
        resolved = path.resolve()
        if resolved in self._open:
            raise SceneError(f"{name!r} includes itself", token.where)
        self._included += 1
        if len(self._stack) >= INCLUDE_DEPTH or self._included > INCLUDE_COUNT:
            raise SceneError(
                f"too many includes: at most {INCLUDE_DEPTH} inside each other and {INCLUDE_COUNT} in all",
                token.where,
            )
        source = read_source(path, token.where)
        self._read += len(source.text)
        if self._read > FILE_LIMIT:
            raise SceneError(f"the included files are larger than {FILE_LIMIT >> 20} MiB in all", token.where)
        self._stack.append((Tokenizer(source), end))
        self._open.append(resolved)

    def share(self) -> float:
        """The share of the main file that is read, in [0, 1]."""
        offset = self._stack[0][0].offset if self._stack else len(self._main.text)
        return offset / max(len(self._main.text), 1)

    def end(self) -> Location:
        """The end of the main file, the place of whatever is missing."""
        return self._main.location(len(self._main.text))
