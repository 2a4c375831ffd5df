"""Lists of values: long runs of numbers are read at once, and become tokens only for error messages."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from scenes.errors import SceneError
from scenes.pbrt.text.lexer import Source, Token, tokenize

SHORT = 40  # characters: up to there tokens are as quick, but for a whole list of
SEVERAL = 3  # numbers
SINGLES = 1_000_000  # tokens of one list that are in no run

# A run: numbers, space and comments, possessive, so that a failure costs one pass. What follows a number at
# once belongs to its
# word, a `#` too; so a run ends where its last word does. (?![$] ): a template's declaration is no comment.
_WORD = r"[+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?+(?=[ \t\r\n\]])"
_RUN = re.compile(rf"(?:[ \t\r\n]++|{_WORD}|#(?!\$(?![^ \t\r\n]))[^\r\n]*+)*+")
_COMMENT = re.compile(r"#[^\r\n]*")
_LONG = re.compile(r"[0-9]{19}")  # beyond int64, perhaps


@dataclass(frozen=True, eq=False)
class Run:
    """Finite numbers of a text between the offsets start and end.

    whole: whether all are written as whole numbers. array: (m,) int64 if they are, unless one is very long;
    else float64.
    """

    array: NDArray[np.float64] | NDArray[np.int64]
    whole: bool
    source: Source
    start: int
    end: int

    def tokens(self) -> Iterator[Token]:
        """The numbers as they are written."""
        return islice(tokenize(self.source, self.start), len(self.array))


def read_run(source: Source, start: int) -> Run | None:
    """The numbers from offset `start` up to a bracket or to anything else; None for only a few. SceneError
    for a number beyond the range of float64.
    """
    match = _RUN.match(source.text, start)
    end = start if match is None else match.end()
    piece = source.text[start:end]
    if "#" in piece:
        piece = _COMMENT.sub(" ", piece)
    if end < start + SHORT and not (source.text[end : end + 1] == "]" and len(piece.split()) >= SEVERAL):
        return None
    if not piece or piece.isspace():
        return None
    whole = not any(letter in piece for letter in ".eE")
    array: NDArray[np.float64] | NDArray[np.int64]
    if whole and _LONG.search(piece) is None:
        array = np.fromstring(piece, dtype=np.int64, sep=" ")
    else:
        array = np.fromstring(piece, dtype=np.float64, sep=" ")
    del piece  # of a large list as much as the numbers
    if not np.all(np.isfinite(array)):
        word = next(islice(tokenize(source, start), int(np.argmin(np.isfinite(array))), None))
        raise SceneError(f"{word.text[:40]} is beyond the range of a number", word.where)
    return Run(array, whole, source, start, end)


class Values:
    """The values of a parameter, as runs and single tokens. Tokens of runs are made on demand.

    It is no `Sequence`: an index costs as much as all the tokens before it.
    """

    def __init__(self, parts: Sequence[Run | Token]) -> None:
        self._parts = parts

    def __len__(self) -> int:
        return sum(len(part.array) if isinstance(part, Run) else 1 for part in self._parts)

    def __iter__(self) -> Iterator[Token]:
        for part in self._parts:
            if isinstance(part, Run):
                yield from part.tokens()
            else:
                yield part

    def token(self, index: int) -> Token:
        """The token of the value at `index`, for a message."""
        return next(islice(iter(self), index, None))

    def integers(self) -> NDArray[np.int64] | None:
        """All values, (m,) int64; None if one is no plain whole number, or a very long one."""
        runs = [part.array for part in self._parts if isinstance(part, Run) and part.array.dtype == np.int64]
        if not runs or len(runs) < len(self._parts):
            return None
        return np.asarray(runs[0] if len(runs) == 1 else np.concatenate(runs), dtype=np.int64)

    def array(self, number: Callable[[Token], float]) -> NDArray[np.float64]:
        """All values, (m,) float64. number: the function from a single token to its number."""
        if len(self._parts) == 1 and isinstance(self._parts[0], Run):
            return np.asarray(self._parts[0].array, dtype=np.float64)
        pieces = [part.array if isinstance(part, Run) else np.array([number(part)]) for part in self._parts]
        return np.concatenate([np.zeros(0), *pieces], dtype=np.float64)
