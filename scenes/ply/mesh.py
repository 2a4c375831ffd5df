"""Mesh files: vertices and faces of PLY files, as they stand in the file.

No vertex is merged, moved or reordered, and quadrilaterals stay whole, because pbrt makes bilinear patches of
them.

The reader is our own, in ply_*.py, and trimesh's is left: that refuses binary files that mix triangles with
quadrilaterals, which exporters commonly write and pbrt reads, and takes Python lists of ASCII files, some 20
times their size, before it looks at what the header says. tests/scenes/ply/test_rows.py shows that the two
agree on what both read.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenes.errors import PenumbraError
from scenes.files import FILE_LIMIT, read_bytes
from scenes.ply.header import HEADER_LIMIT, Element, Header, PlyError, Property, parse_header
from scenes.ply.rows import Rows, lay_out
from scenes.ply.text import read_numbers

TEXT_LIMIT = 2**30  # bytes of an ASCII file, whose numbers take up to four times as many
SMALL = 2**16  # bytes
CORNERS = 64  # of a face, at most; those of more than four are left out

_INDEX_NAMES = ("vertex_indices", "vertex_index")
_POINT = ("x", "y", "z")
_NORMALS = ("nx", "ny", "nz")
_UV = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))  # as pbrt knows them


@dataclass(frozen=True, eq=False)
class MeshFile:
    """The content of a mesh file.

    vertices: (m, 3) float64. triangles: (t, 3) and quads: (q, 4) int64, corners in order round the face.
    normals: (m, 3), NaN for a normal that is not finite, and uv: (m, 2) float64; None if the file has none.
    left_out: the number of faces with other counts of corners, which pbrt leaves out too.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]
    quads: NDArray[np.int64]
    normals: NDArray[np.float64] | None = None
    uv: NDArray[np.float64] | None = None
    left_out: int = 0


def read_ply(path: Path) -> MeshFile:
    """Read a PLY file, ASCII or binary, also compressed (.gz); PenumbraError if it is damaged, or holds what
    is not supported.

    Not supported are ASCII files of more than TEXT_LIMIT
    bytes and others of more than FILE_LIMIT. A header that promises more than the file holds costs no more
    time or memory than what is there. Small files, which scenes name by the thousand, are read once.
    """
    try:
        status = path.stat()
    except (OSError, ValueError):
        return _told(path)  # why
    if status.st_size > SMALL:
        return _told(path)
    return _small(path, status.st_mtime_ns, status.st_size, status.st_ino)


@lru_cache(256)
def _small(path: Path, modified: int, size: int, inode: int) -> MeshFile:
    """A file as it was at that time; what it holds is shared, and must not be written to."""
    mesh = _told(path)
    for values in (mesh.vertices, mesh.triangles, mesh.quads, mesh.normals, mesh.uv):
        if values is not None:
            values.flags.writeable = False
    return mesh


def _told(path: Path) -> MeshFile:
    try:
        return _read(path)
    except PlyError as error:
        raise PenumbraError(f"{str(path)!r} {error}") from None


def _read(path: Path) -> MeshFile:
    head = read_bytes(path, HEADER_LIMIT)
    header = parse_header(head)
    for name, what in (("vertex", "vertices"), ("face", "faces")):
        element = header.find(name)
        if element is None or not element.count:
            raise PlyError(f"has no {what}")
        if name == "face":
            _corners(element)
    vertices, faces = _rows(header, *_content(header, head, path))
    points = _columns(vertices, _POINT)
    if points is None:
        raise PlyError("has no vertices: they need the properties x, y and z")
    normals, uv = _columns(vertices, _NORMALS), _columns(vertices, *_UV)
    if normals is not None:  # a face with such a corner is shaded by its own normal
        normals = np.where(np.isfinite(normals), normals, np.nan)
    triangles, quads = _faces(faces)
    left_out = faces.element.count - len(triangles) - len(quads)
    return _checked(MeshFile(points, triangles, quads, normals, uv, left_out))


def _content(header: Header, head: bytes, path: Path) -> tuple[memoryview, int]:
    """The bytes or text that the rows are read from, and the offset at which they begin there. head: the
    first HEADER_LIMIT bytes of the file.
    """
    limit = TEXT_LIMIT if header.ascii else FILE_LIMIT
    kind = "of an ASCII PLY file; a binary one may be longer" if header.ascii else "of a file"
    if header.size + header.least() > limit:
        raise PlyError(f"declares more than the {limit >> 20} MiB that are read {kind}")
    most = header.most(CORNERS)  # what goes on behind that need not be read to be refused
    first = limit if most is None else min(limit, header.size + most)
    data = head if len(head) < HEADER_LIMIT else read_bytes(path, first + 1)
    if len(data) > limit:
        raise PlyError(f"is larger than the {limit >> 20} MiB that are read {kind}")
    if header.size + header.least() > len(data):
        size = len(data) - header.size
        raise PlyError(
            f"does not hold as much as its header says: {header.least()} bytes at least, and there are {size}"
        )
    if header.ascii:
        return read_numbers(data, header.size), 0
    return memoryview(data), header.size


def _rows(header: Header, content: memoryview, at: int) -> tuple[Rows, Rows]:
    """Where vertices and faces lie; PlyError unless the content is what the header declares, no less and no
    more.
    """
    found: dict[str, Rows] = {}
    for element in header.elements:
        if element.properties:
            rows = lay_out(element, content, at, _check_corners if element.name == "face" else None)
            at = rows.end
            if element.name in ("vertex", "face"):
                found[element.name] = rows
    if at < len(content):
        raise PlyError("does not end where its header says: there is more behind the last of its rows")
    return found["vertex"], found["face"]


def _corners(faces: Element) -> Property:
    column = faces.find(*_INDEX_NAMES)
    if column is None or column.length is None or column.type.kind == "f":
        raise PlyError(f"has no faces: they need a list of whole numbers, {' or '.join(_INDEX_NAMES)}")
    return column


def _check_corners(faces: Element, row: int, lengths: tuple[int, ...]) -> None:
    corners = lengths[faces.lists.index(_corners(faces))]
    if corners > CORNERS:
        raise PlyError(f"has a face of {corners} corners, more than {CORNERS} (face {row}): triangulate it")


def _faces(faces: Rows) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The triangles (t, 3) and the quadrilaterals (q, 4)."""
    column = _corners(faces.element)
    return faces.lists(column, 3).astype(np.int64), faces.lists(column, 4).astype(np.int64)


def _columns(vertices: Rows, *choices: tuple[str, ...]) -> NDArray[np.float64] | None:
    """The first set of properties that the vertices have all of: (m, k) float64."""
    for names in choices:
        columns = [column for column in map(vertices.element.find, names) if column and column.length is None]
        if len(columns) == len(names):
            found = np.zeros((vertices.element.count, len(names)))
            for i, column in enumerate(columns):
                found[:, i] = vertices.values(column)
            found += 0.0  # no negative zeros
            return found
    return None


def _checked(mesh: MeshFile) -> MeshFile:
    for values, name in (
        (mesh.vertices, "vertex"),
        (mesh.uv, "texture coordinate"),
    ):
        if values is not None and not np.all(np.isfinite(values)):
            raise PlyError(f"has a {name} that is not finite")
    for corners in (mesh.triangles, mesh.quads):
        if corners.min(initial=0) < 0 or corners.max(initial=0) >= len(mesh.vertices):
            raise PlyError(f"has a face with a vertex beyond its {len(mesh.vertices)} vertices")
    return mesh
