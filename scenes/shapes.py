"""`Shape`: pbrt-v4's triangle meshes, bilinear meshes, mesh files, spheres and disks, brought into world space.

Orientation follows pbrt-v4's source. Triangles and patches turn their normal where `ReverseOrientation` xor a
mirroring transformation says so. Spheres and disks that emit are different there: the normal of a light sample
ignores the mirroring and that of a ray's hit does not, so a mirrored one-sided light has no defined side and is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenes.description import BilinearMesh, Disk, Emission, Geometry, Sphere, TriangleMesh
from scenes.errors import PenumbraError, SceneError
from scenes.meshes import read_ply
from scenes.parameters import Parameters
from scenes.tokens import Token
from scenes.transforms import COORDINATE_LIMIT, Transform, uniform_scale, unit

Array = NDArray[np.float64]

PLANE_TOLERANCE = 1e-6  # of a patch's diameter: text of seven digits, or float32


@dataclass(frozen=True, eq=False)
class Placement:
    """What the state of the file says of the next shape. resolve: a file name as the scene file means it."""

    transform: Transform
    reverse: bool
    emission: Emission | None
    resolve: Callable[[str], Path]

    @property
    def turned(self) -> bool:
        """Whether the geometric normal is turned round."""
        return self.reverse != self.transform.swaps_handedness


def build_shape(kind: str, parameters: Parameters, placement: Placement) -> list[Geometry]:
    """The geometries of one `Shape` directive, one or two of them; SceneError for what cannot be."""
    if kind not in _SHAPES:
        raise SceneError(f"shape {kind!r} is not supported; supported: {', '.join(_SHAPES)}", parameters.where)
    with np.errstate(all="ignore"):
        geometries = _SHAPES[kind](parameters, placement)
        for geometry in geometries:
            _check_range(geometry, parameters)
            if isinstance(geometry, TriangleMesh) and placement.emission is not None:
                _check_emitter(geometry, parameters)
    return geometries


def _check_range(geometry: Geometry, parameters: Parameters) -> None:
    if isinstance(geometry, TriangleMesh | BilinearMesh):
        numbers = geometry.vertices
    else:
        numbers = np.append(geometry.center, geometry.radius)
        if not geometry.radius >= 1 / COORDINATE_LIMIT:
            raise SceneError(f"the radius is too small to compute with: {geometry.radius:g}", parameters.where)
    if not np.all(np.abs(numbers) <= COORDINATE_LIMIT):
        raise SceneError(f"the shape reaches beyond {COORDINATE_LIMIT:g}, the largest coordinate", parameters.where)


def _check_emitter(geometry: TriangleMesh, parameters: Parameters) -> None:
    corners = geometry.vertices[geometry.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if not np.all(area > 0):
        raise SceneError(f"face {int(np.argmin(area))} emits light but has no area", parameters.where)


def _triangle_mesh(parameters: Parameters, placement: Placement) -> list[Geometry]:
    vertices, faces = _indexed(parameters, corners=3)
    _ignore_uv(parameters, len(vertices))
    return [TriangleMesh(placement.transform.points(vertices), faces, placement.turned)]


def _bilinear_mesh(parameters: Parameters, placement: Placement) -> list[Geometry]:
    vertices, faces = _indexed(parameters, corners=4)
    _ignore_uv(parameters, len(vertices))
    return [_patches(vertices, faces, parameters, placement)]


def _patches(vertices: Array, faces: NDArray[np.int64], parameters: Parameters, placement: Placement) -> BilinearMesh:
    world = placement.transform.points(vertices)
    problem = patch_problem(world, faces)
    if problem:
        raise SceneError(problem, parameters.where)
    return BilinearMesh(world, faces, placement.turned)


def patch_problem(vertices: Array, faces: NDArray[np.int64]) -> str | None:
    """Why these patches are not planar convex quadrilaterals, or None. vertices (m, 3), faces (q, 4) as p00 p10 p01 p11."""
    p00, p10, p01, p11 = np.moveaxis(vertices[faces], 1, 0)
    diagonals = np.cross(p11 - p00, p01 - p10)  # twice the area, whatever the shape
    length = np.linalg.norm(diagonals, axis=1)
    diameter = np.maximum(np.linalg.norm(p11 - p00, axis=1), np.linalg.norm(p01 - p10, axis=1))
    if not np.all(length > 0):
        return f"patch {int(np.argmin(length))} has no area, or its corners are not in the order p00 p10 p01 p11"
    normal = diagonals / length[:, None]
    rounding = 4 * np.finfo(np.float32).eps * np.abs(vertices[faces]).max(axis=(1, 2))
    warp = np.abs(np.sum((p10 - p00) * normal, axis=1))  # how far the two diagonals pass each other by
    off = warp > PLANE_TOLERANCE * diameter + rounding
    if off.any():
        return f"patch {int(np.argmax(off))} is not planar: curved bilinear patches are not supported yet"
    ring = (p00, p10, p11, p01)
    turns = [np.sum(np.cross(ring[i] - ring[i - 1], ring[(i + 1) % 4] - ring[i]) * normal, axis=1) for i in range(4)]
    bad = np.min(turns, axis=0) < -PLANE_TOLERANCE * diameter**2
    if bad.any():
        return f"patch {int(np.argmax(bad))} is not convex: its corners must be given in the order p00 p10 p01 p11"
    return None


def _ply_mesh(parameters: Parameters, placement: Placement) -> list[Geometry]:
    name = parameters.text("filename", "")
    if not name:
        raise parameters.fail("filename", 'plymesh needs "string filename"')
    if not name.lower().endswith(".ply"):
        raise parameters.fail("filename", f"{name!r}: only uncompressed .ply files are supported")
    try:
        mesh = read_ply(placement.resolve(name))
    except PenumbraError as error:
        raise parameters.fail("filename", str(error)) from None
    geometries: list[Geometry] = []
    if len(mesh.triangles):
        geometries.append(TriangleMesh(placement.transform.points(mesh.vertices), mesh.triangles, placement.turned))
    if len(mesh.quads):  # corners go round the face in PLY, row by row in a patch
        geometries.append(_patches(mesh.vertices, mesh.quads[:, [0, 1, 3, 2]], parameters, placement))
    return geometries


def _indexed(parameters: Parameters, corners: int) -> tuple[Array, NDArray[np.int64]]:
    vertices = parameters.vectors("point3", "P")
    indices = parameters.integers("indices")
    if vertices is None:
        raise SceneError(f'{parameters.owner} needs "point3 P"', parameters.where)
    if indices is None:
        if len(vertices) != corners:
            raise SceneError(f'{parameters.owner} of {len(vertices)} points needs "integer indices"', parameters.where)
        return vertices, np.arange(corners, dtype=np.int64).reshape(1, corners)
    faces, tokens = indices
    if not len(faces) or len(faces) % corners:
        raise parameters.fail("indices", f'"integer indices" takes groups of {corners}, not {len(faces)} numbers')
    _check_indices(faces, tokens, len(vertices))
    return vertices, faces.reshape(-1, corners)


def _check_indices(indices: NDArray[np.int64], tokens: Sequence[Token], count: int) -> None:
    outside = (indices < 0) | (indices >= count)
    if outside.any():
        token = tokens[int(np.argmax(outside))]
        raise SceneError(f"index {token} is out of range: there are {count} points, counted from 0", token.where)


def _ignore_uv(parameters: Parameters, count: int) -> None:
    """Texture coordinates change nothing without textures; a wrong number of them is still an error."""
    uv = parameters.vectors("point2", "uv")
    if uv is not None and len(uv) != count:
        raise parameters.fail("uv", f"{len(uv)} texture coordinates for {count} points")


def _radius(parameters: Parameters) -> float:
    radius = parameters.number("radius", 1.0)
    if radius <= 0:
        raise parameters.fail("radius", f"the radius must be positive, not {radius:g}")
    return radius


def _only(parameters: Parameters, name: str, value: float) -> None:
    if parameters.number(name, value) != value:
        raise parameters.fail(name, f"{name} must be {value:g}: only the full {parameters.owner} is supported")


def _check_side(parameters: Parameters, placement: Placement) -> None:
    emission = placement.emission
    if emission and not emission.two_sided and placement.transform.swaps_handedness:
        raise SceneError(
            f"a one-sided light on a {parameters.owner} under a mirroring transformation: pbrt-v4 contradicts itself "
            "about the side it emits on; take the mirroring out and use ReverseOrientation",
            parameters.where,
        )


def _sphere(parameters: Parameters, placement: Placement) -> list[Geometry]:
    radius = _radius(parameters)
    _only(parameters, "zmin", -radius)
    _only(parameters, "zmax", radius)
    _only(parameters, "phimax", 360.0)
    _check_side(parameters, placement)
    factor = uniform_scale(placement.transform.matrix[:3, :3])
    if factor is None:
        raise SceneError("the transformation makes an ellipsoid of the sphere; that is not supported", parameters.where)
    center = placement.transform.matrix[:3, 3] + 0.0
    return [Sphere(center, radius * factor, placement.turned)]


def _disk(parameters: Parameters, placement: Placement) -> list[Geometry]:
    radius, height = _radius(parameters), parameters.number("height", 0.0)
    _only(parameters, "innerradius", 0.0)
    _only(parameters, "phimax", 360.0)
    _check_side(parameters, placement)
    factor = uniform_scale(placement.transform.matrix[:3, :2])
    if factor is None:
        raise SceneError("the transformation makes an ellipse of the disk; that is not supported", parameters.where)
    normal = unit(placement.transform.inverse[2, :3])  # the inverse transpose's image of the z axis
    if placement.turned if placement.emission is None else placement.reverse:
        normal = -normal
    center = placement.transform.points(np.array([[0.0, 0.0, height]]))[0]
    return [Disk(center, normal + 0.0, radius * factor)]


_SHAPES: dict[str, Callable[[Parameters, Placement], list[Geometry]]] = {
    "trianglemesh": _triangle_mesh,
    "plymesh": _ply_mesh,
    "bilinearmesh": _bilinear_mesh,
    "sphere": _sphere,
    "disk": _disk,
}
