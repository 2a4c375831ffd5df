"""`Shape` of triangles and patches: inline meshes and mesh files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.description.patches import curved, patch_problem, refined
from scenes.description.shapes import BilinearMesh, Geometry, TriangleMesh, halves
from scenes.errors import PenumbraError, SceneError
from scenes.pbrt.state import AreaLight
from scenes.pbrt.text.numbers import Values
from scenes.pbrt.text.parameters import Parameters
from scenes.pbrt.transforms import Transform
from scenes.ply.mesh import read_ply

Array = NDArray[np.float64]

NORMAL_TOLERANCE = 1e-4  # of the components of a unit normal that says no more than the face does


@dataclass(frozen=True, eq=False)
class Placement:
    """The state of the file that bears on the next shape."""

    transform: Transform
    reverse: bool
    light: AreaLight | None

    @property
    def turned(self) -> bool:
        """Whether the geometric normal is flipped."""
        return self.reverse != self.transform.swaps_handedness


def triangle_mesh(parameters: Parameters, placement: Placement) -> list[Geometry]:
    """`Shape "trianglemesh"`."""
    vertices, faces = indexed(parameters, corners=3)
    uv = _uv(parameters, len(vertices))
    given = _normals(parameters, len(vertices))
    parameters.vectors("vector3", "S")  # tangents; what is isotropic does not depend on them
    parameters.integers("faceIndices")  # for textures that are not supported
    world = placement.transform.points(vertices)
    if given is None:
        return [TriangleMesh(world, faces, placement.turned, uv)]
    reverse, normals = _sides_and_normals(vertices, faces, given, placement, parameters, "N")
    return [TriangleMesh(world, faces, reverse, uv, normals)]


def _sides_and_normals(
    vertices: Array,
    faces: NDArray[np.int64],
    normals: Array,
    placement: Placement,
    parameters: Parameters,
    name: str,
) -> tuple[bool, Array | None]:
    """Whether the faces' own normals must be turned round to lie on the side of the given ones, which decide
    in pbrt; and the given ones in world space, None where each is its face's own or that one's opposite.
    """
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    whole = length > 0
    face = cross[whole] / length[whole, None]
    given = normals[faces[whole]]
    given = given / np.maximum(np.linalg.norm(given, axis=2, keepdims=True), np.finfo(np.float64).tiny)
    same = bool(np.abs(given - face[:, None]).max(initial=0.0) <= NORMAL_TOLERANCE)
    opposite = not same and bool(np.abs(given + face[:, None]).max(initial=0.0) <= NORMAL_TOLERANCE)
    if not (same or opposite):
        placed = placement.transform.normals(normals) * (-1.0 if placement.reverse else 1.0)
        if placement.light is None:
            return placement.turned, placed
        world = placement.transform.points(vertices)
        return emitting_side(world[faces], placed[faces], placement.turned, parameters, name), placed
    # The faces are turned by a mirror and the given normals by ReverseOrientation: with normals the order of
    # corners is of no effect.
    mirrored = placement.transform.swaps_handedness
    return (placement.reverse != opposite) != mirrored, None


def emitting_side(corners: Array, normals: Array, turned: bool, parameters: Parameters, name: str) -> bool:
    """Whether an emitter's faces are turned round: pbrt emits on the side of the interpolated normal.

    corners, normals: (t, 3, 3). turned: for faces whose normals do not tell. Faces that differ are reported.
    """
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    along = np.einsum("tc,tkc->tk", cross, normals)
    against, towards = (along < 0).any(axis=1), (along > 0).any(axis=1)
    turns = np.where(against | towards, against, turned)
    if (against & towards).any() or turns.any() != turns.all():
        parameters.unsupported(name, "normals on both sides of an emitter's faces are not supported")
    return bool(turns.any())


def bilinear_mesh(parameters: Parameters, placement: Placement) -> list[Geometry]:
    """`Shape "bilinearmesh"`."""
    vertices, faces = indexed(parameters, corners=4)
    uv, turned = _uv(parameters, len(vertices)), placement.turned
    normals = _normals(parameters, len(vertices))
    if normals is not None:
        turned, normals = _sides_and_normals(vertices, halves(faces), normals, placement, parameters, "N")
    parameters.integers("faceIndices")
    parameters.text("emissionfilename", "")  # pbrt samples by it, of no effect on the image
    return _patches(vertices, faces, uv, normals, parameters, placement, turned)


def _patches(
    vertices: Array,
    faces: NDArray[np.int64],
    uv: Array | None,
    normals: Array | None,
    parameters: Parameters,
    placement: Placement,
    turned: bool,
) -> list[Geometry]:
    """Planar patches as one mesh, all others as triangles. normals: (m, 3) on the outside, in world space."""
    world = placement.transform.points(vertices)
    bent = curved(world, faces)
    problem = patch_problem(world, faces[~bent])
    if problem:
        raise SceneError(problem, parameters.where)
    made: list[Geometry] = []
    smooth = bent if normals is None or placement.light is not None else np.ones_like(bent)
    if not smooth.all():
        made.append(BilinearMesh(world, faces[~smooth], turned, uv))
    if smooth.any():
        try:
            mesh = refined(world, faces[smooth], uv, normals, turned, placement.light is None)
        except ValueError as error:
            raise SceneError(str(error), parameters.where) from None
        made.append(mesh)
    if bent.any():
        parameters.remark(
            "P" if parameters.owner == "bilinearmesh" else "filename",
            "curved patches are rendered as triangles that leave them by at most 1e-4 of the mesh's size",
        )
    return made


def ply_mesh(parameters: Parameters, placement: Placement) -> list[Geometry]:
    """`Shape "plymesh"`: the triangles of the file as one mesh, its quadrilaterals as patches."""
    name = parameters.text("filename", "")
    if not name:
        raise parameters.fail("filename", 'plymesh needs "string filename"')
    if not name.lower().endswith((".ply", ".ply.gz")):
        raise parameters.fail("filename", f"{name!r}: only .ply files, also as .ply.gz, are supported")
    if parameters.take("displacement", "texture") is not None:
        parameters.substitute("displacement", "displacement", "as the mesh without it")
    parameters.number("edgelength", parameters.number("displacement.edgelength", 1.0))  # of no effect without
    try:
        mesh = read_ply(parameters.resolve(name))
    except SceneError:
        raise
    except PenumbraError as error:
        raise parameters.fail("filename", str(error)) from None
    if mesh.left_out:
        parameters.remark(
            "filename", "faces that are no triangles or quadrilaterals are left out, as in pbrt"
        )
    turned, normals = placement.turned, None
    if mesh.normals is not None:
        corners = np.concatenate([mesh.triangles, mesh.quads[:, :3], mesh.quads[:, [2, 3, 0]]])
        turned, normals = _sides_and_normals(
            mesh.vertices, corners, mesh.normals, placement, parameters, "filename"
        )
    geometries: list[Geometry] = []
    if len(mesh.triangles):
        world = placement.transform.points(mesh.vertices)
        geometries.append(TriangleMesh(world, mesh.triangles, turned, mesh.uv, normals))
    if len(mesh.quads):  # corners go round the face in PLY, row by row in a patch
        patches = mesh.quads[:, [0, 1, 3, 2]]
        geometries += _patches(mesh.vertices, patches, mesh.uv, normals, parameters, placement, turned)
    return geometries


def indexed(parameters: Parameters, corners: int) -> tuple[Array, NDArray[np.int64]]:
    """The points (m, 3) and the faces (t, corners) of an inline mesh."""
    vertices = parameters.vectors("point3", "P")
    indices = parameters.integers("indices")
    if vertices is None:
        raise SceneError(f'{parameters.owner} needs "point3 P"', parameters.where)
    if indices is None:
        if len(vertices) != corners:
            raise SceneError(
                f'{parameters.owner} of {len(vertices)} points needs "integer indices"', parameters.where
            )
        return vertices, np.arange(corners, dtype=np.int64).reshape(1, corners)
    faces, tokens = indices
    left = len(faces) % corners
    if len(faces) < corners:
        raise parameters.fail(
            "indices", f'"integer indices" takes groups of {corners}, not {len(faces)} numbers'
        )
    if left:
        parameters.remark("indices", f"the last {left} of {len(faces)} indices are left over, as in pbrt")
        faces = faces[:-left]
    _check_indices(faces, tokens, len(vertices))
    return vertices, faces.reshape(-1, corners)


def _check_indices(indices: NDArray[np.int64], tokens: Values, count: int) -> None:
    outside = (indices < 0) | (indices >= count)
    if outside.any():
        token = tokens.token(int(np.argmax(outside)))
        raise SceneError(
            f"index {token} is out of range: there are {count} points, counted from 0", token.where
        )


def _normals(parameters: Parameters, count: int) -> Array | None:
    """Vertex normals (m, 3), one for each point; None if none are given."""
    normals = parameters.vectors("normal", "N")
    if normals is not None and len(normals) != count:
        parameters.remark("N", f"{len(normals)} normals for {count} points: none is taken, as in pbrt")
        return None
    return normals


def _uv(parameters: Parameters, count: int) -> Array | None:
    """Texture coordinates (m, 2), one for each point; None if none are given."""
    uv = parameters.vectors("point2", "uv")
    if uv is not None and len(uv) != count:
        problem = f"{len(uv)} texture coordinates for {count} points: none is taken, as in pbrt"
        parameters.remark("uv", problem)
        return None
    return uv
