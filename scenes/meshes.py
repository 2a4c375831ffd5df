"""Mesh files, read through trimesh and nothing else: vertices and faces as they stand in the file.

No vertex is merged, moved or reordered, and quadrilaterals stay whole, because pbrt makes bilinear patches of them.
"""
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import io
import logging
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from scenes.errors import PenumbraError
from scenes.files import read_bytes

_INDEX_NAMES = ("vertex_indices", "vertex_index")
_NORMALS = ("nx", "ny", "nz")
_UV = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))  # as pbrt knows them


@dataclass(frozen=True, eq=False)
class MeshFile:
    """vertices: (m, 3) float64. triangles: (t, 3), quads: (q, 4) int64, corners in order round the face.

    normals: (m, 3), uv: (m, 2) float64, None where the file has none.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]
    quads: NDArray[np.int64]
    normals: NDArray[np.float64] | None = None
    uv: NDArray[np.float64] | None = None


def read_ply(path: Path) -> MeshFile:
    """Read a PLY file, ASCII or binary, also compressed (.gz); PenumbraError if it is damaged, or holds what is not supported.

    Not supported are faces of five corners and more (pbrt drops them).
    """
    content = _parse(read_bytes(path), path)
    elements = content["metadata"]["_ply_raw"]
    vertices = np.asarray(content.get("vertices", np.zeros((0, 3))), dtype=np.float64)
    triangles, quads, count = _faces(elements.get("face", {}).get("data"), path)
    declared = [elements.get(name, {}).get("length", 0) for name in ("vertex", "face")]
    if [len(vertices), count] != declared or 0 in declared:
        raise PenumbraError(f"{str(path)!r} does not hold as many vertices and faces as its header says")
    data = elements["vertex"]["data"]
    normals, uv = _columns(data, len(vertices), _NORMALS), _columns(data, len(vertices), *_UV)
    return _checked(MeshFile(vertices + 0.0, triangles, quads, normals, uv), count, path)


def _columns(data: Any, count: int, *choices: tuple[str, ...]) -> NDArray[np.float64] | None:
    """The first set of properties that the vertices have all of: (m, k) float64."""
    names = set(data.dtype.names or ()) if isinstance(data, np.ndarray) else set(data)
    for choice in choices:
        if names.issuperset(choice):
            columns = [np.asarray(data[name], dtype=np.float64).reshape(count) for name in choice]
            return np.stack(columns, axis=1) + 0.0
    return None


def _parse(data: bytes, path: Path) -> dict[str, Any]:
    from trimesh.exchange.ply import load_ply  # here, because scenes without mesh files need not wait for it

    logger = logging.getLogger("trimesh")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("error")
            return cast("dict[str, Any]", load_ply(io.BytesIO(data), fix_texture=False, skip_materials=True))
    except Exception as error:  # the loader raises whatever its parsing ran into
        hint = ""
        if "unexpected length" in str(error):
            hint = "; a binary file must not mix triangles with quadrilaterals (triangulate it)"
        raise PenumbraError(f"{str(path)!r} is no PLY file that can be read ({error}){hint}") from None
    finally:
        logger.setLevel(level)


def _faces(data: Any, path: Path) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """The triangles (t, 3), the quadrilaterals (q, 4) and how many faces there are of any size."""
    names = data.dtype.names if isinstance(data, np.ndarray) else data
    name = next((n for n in _INDEX_NAMES if n in (names or ())), None)
    if name is None:
        raise PenumbraError(f"{str(path)!r} has no faces")
    column = data[name]
    if isinstance(data, np.ndarray):  # binary: a count and the corners
        if not np.all(column["f0"] == column["f1"].shape[1]):
            raise PenumbraError(f"{str(path)!r} mixes faces of different size: triangulate it")
        column = column["f1"]
    if isinstance(column, np.ndarray) and column.ndim == 2 and column.dtype != object:
        corners = column.astype(np.int64)
        sizes = [corners if corners.shape[1] == size else np.zeros((0, size), np.int64) for size in (3, 4)]
        return sizes[0], sizes[1], len(corners)
    faces = [np.asarray(face, dtype=np.int64) for face in column]
    return _with_corners(faces, 3), _with_corners(faces, 4), len(faces)


def _with_corners(faces: list[NDArray[np.int64]], corners: int) -> NDArray[np.int64]:
    chosen = [face for face in faces if face.shape == (corners,)]
    return np.array(chosen, dtype=np.int64).reshape(-1, corners)


def _checked(mesh: MeshFile, faces: int, path: Path) -> MeshFile:
    if len(mesh.triangles) + len(mesh.quads) != faces:
        raise PenumbraError(f"{str(path)!r} has faces that are neither triangles nor quadrilaterals: triangulate it")
    for values, name in ((mesh.vertices, "vertex"), (mesh.normals, "normal"), (mesh.uv, "texture coordinate")):
        if values is not None and not np.all(np.isfinite(values)):
            raise PenumbraError(f"{str(path)!r} has a {name} that is not finite")
    corners = np.concatenate([mesh.triangles.ravel(), mesh.quads.ravel()])
    if corners.min() < 0 or corners.max() >= len(mesh.vertices):
        raise PenumbraError(f"{str(path)!r} has a face with a vertex beyond its {len(mesh.vertices)} vertices")
    return mesh
