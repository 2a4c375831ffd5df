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

_INDEX_NAMES = ("vertex_indices", "vertex_index")


@dataclass(frozen=True, eq=False)
class MeshFile:
    """vertices: (m, 3) float64. triangles: (t, 3), quads: (q, 4) int64, corners in order round the face."""

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]
    quads: NDArray[np.int64]


def read_ply(path: Path) -> MeshFile:
    """Read a PLY file, ASCII or binary; PenumbraError if it is damaged, or holds what is not supported.

    Not supported are vertex normals (pbrt shades with them) and faces of five corners and more (pbrt drops them).
    """
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise PenumbraError(f"cannot read {str(path)!r}: {reason}") from None
    content = _parse(data, path)
    if "vertex_normals" in content:
        raise PenumbraError(f"{str(path)!r} has vertex normals; smooth shading is not supported yet: store it without")
    elements = content["metadata"]["_ply_raw"]
    vertices = np.asarray(content.get("vertices", np.zeros((0, 3))), dtype=np.float64)
    faces = _faces(elements.get("face", {}).get("data"), path)
    declared = [elements.get(name, {}).get("length", 0) for name in ("vertex", "face")]
    if [len(vertices), len(faces)] != declared or 0 in declared:
        raise PenumbraError(f"{str(path)!r} does not hold as many vertices and faces as its header says")
    return _checked(MeshFile(vertices + 0.0, _with_corners(faces, 3), _with_corners(faces, 4)), len(faces), path)


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


def _faces(data: Any, path: Path) -> list[NDArray[np.int64]]:
    """The corners of each face."""
    names = data.dtype.names if isinstance(data, np.ndarray) else data
    name = next((n for n in _INDEX_NAMES if n in (names or ())), None)
    if name is None:
        raise PenumbraError(f"{str(path)!r} has no faces")
    column = data[name]
    if isinstance(data, np.ndarray):  # binary: a count and the corners
        if not np.all(column["f0"] == column["f1"].shape[1]):
            raise PenumbraError(f"{str(path)!r} mixes faces of different size: triangulate it")
        column = column["f1"]
    return [np.asarray(face, dtype=np.int64) for face in column]


def _with_corners(faces: list[NDArray[np.int64]], corners: int) -> NDArray[np.int64]:
    chosen = [face for face in faces if face.shape == (corners,)]
    return np.array(chosen, dtype=np.int64).reshape(-1, corners)


def _checked(mesh: MeshFile, faces: int, path: Path) -> MeshFile:
    if len(mesh.triangles) + len(mesh.quads) != faces:
        raise PenumbraError(f"{str(path)!r} has faces that are neither triangles nor quadrilaterals: triangulate it")
    if not np.all(np.isfinite(mesh.vertices)):
        raise PenumbraError(f"{str(path)!r} has a vertex that is not finite")
    corners = np.concatenate([mesh.triangles.ravel(), mesh.quads.ravel()])
    if corners.min() < 0 or corners.max() >= len(mesh.vertices):
        raise PenumbraError(f"{str(path)!r} has a face with a vertex beyond its {len(mesh.vertices)} vertices")
    return mesh
