"""Files: where a scene's files may lie, how much of them is read, and how a file is replaced."""

from __future__ import annotations

import gzip
import os
import secrets
import stat
import zlib
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from scenes.errors import Location, PenumbraError, SceneError

FILE_LIMIT = 2**32  # bytes
PACKED_LIMIT = 2**30  # bytes after decompression: a small file may hold very many
POINTER = (
    b"version https://git-lfs.github.com/spec/"  # how the stand-in of a file that was not fetched begins
)


_ESCAPED = "\b\f\n\r\t"  # what \b and the like in a path become


class Files:
    """The search for files that a scene names. root: the folder of its top file, which no path leaves unless
    `allow_outside` is set.
    """

    def __init__(self, root: Path, allow_outside: bool = False) -> None:
        self._root = root
        self._allow_outside = allow_outside

    def find(self, name: str, near: Path | None, where: Location) -> Path:
        """The path of a file that a scene names.

        Names are relative to the folder of the top file, as in pbrt, or else to `near`, the folder of the
        file that names them. SceneError at `where` if the path leads outside the root, symbolic links
        included, unless that is allowed.
        """
        folders = [self._root, near] if near is not None else [self._root]
        names = [name, name.replace("\\", "/")] if "\\" in name else [name]  # files written on Windows
        try:
            paths = (folder / one for one in names for folder in folders)
            inside = [path for path in paths if self._allowed(path)]
            found = next((path for path in inside if path.exists()), None)
        except (OSError, ValueError, RuntimeError) as error:
            raise SceneError(f"{name!r} is no file name: {error}", where) from None
        if not inside:
            raise SceneError(
                f"{name!r} lies outside the folder of the scene, {str(self._root)!r}; to read it all the "
                "same, allow files from outside (penumbra --allow-outside COMMAND ...)",
                where,
            )
        if found is None and any(control in name for control in _ESCAPED):
            raise SceneError(
                f"no file {name!r}: a backslash in a string begins an escape; write / between folders", where
            )
        if found is None and len(names) > 1:
            raise SceneError(f"no file {name!r}, nor one with / for its backslashes", where)
        return found or inside[0]

    def _allowed(self, path: Path) -> bool:
        return self._allow_outside or path.resolve().is_relative_to(self._root.resolve())


def read_bytes(path: Path, first: int = FILE_LIMIT + 1) -> bytes:
    """The content of a file, decompressed if its name ends in .gz, or only its first bytes. PenumbraError if
    the file cannot be read or is too large.
    """
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise PenumbraError(f"cannot read {str(path)!r}: it is a folder")
        if not stat.S_ISREG(status.st_mode):
            raise PenumbraError(f"cannot read {str(path)!r}: it is no regular file")
        check_fetched(path)
        with gzip.open(path) if path.suffix.lower() == ".gz" else path.open("rb") as stream:
            packed = path.suffix.lower() == ".gz"
            limit = min(FILE_LIMIT, PACKED_LIMIT) if packed else FILE_LIMIT
            # Python sets aside at once what it is asked to read at most.
            data = stream.read(min(first, limit + 1, *(() if packed else (status.st_size + 1,))))
    except (OSError, ValueError, EOFError, zlib.error) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise PenumbraError(f"cannot read {str(path)!r}: {reason}") from None
    if len(data) > limit:
        raise PenumbraError(f"cannot read {str(path)!r}: it is larger than {limit >> 20} MiB")
    return data


def check_fetched(path: Path) -> None:
    """Raise PenumbraError if the file is a pointer that Git LFS left in place of a large file, and OSError if
    it cannot be read.
    """
    with path.open("rb") as stream:
        if stream.read(len(POINTER)) == POINTER:
            raise PenumbraError(
                f"{str(path)!r} is a Git LFS pointer, not the file itself: fetch it with `git lfs pull`"
            )


@contextmanager
def replacing(path: str | Path, durable: bool = False) -> Generator[Path]:
    """A temporary name beside `path`, with its suffix. It replaces `path` when the block ends well, and
    vanishes if not.

    Readers see the old file or the new one, never a part. durable: write the content to the disk before the
    name. PenumbraError if the folder cannot be written.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.{secrets.token_hex(4)}{path.suffix}")
    try:
        yield temporary
        if durable:
            _flush(temporary)
        temporary.replace(path)
    except OSError as error:
        raise PenumbraError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        if path.parent.is_dir():
            temporary.unlink(missing_ok=True)


def write_file(path: Path, content: str | bytes, durable: bool = False) -> None:
    """Replace a file by `content`, atomically, as `replacing` does; text as UTF-8."""
    with replacing(path, durable) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)


def _flush(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def utf8_name(path: str | Path) -> str:
    """The path as text, for libraries that take UTF-8 only. PenumbraError if it holds other bytes."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise PenumbraError(
            f"{str(path)!r}: the name is not UTF-8, which images need; rename the file or its folder"
        ) from None
    return str(path)
