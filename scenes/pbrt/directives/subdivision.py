"""`Shape "loopsubdiv"`: Loop subdivision, its vertices then moved to the limit surface, as pbrt-v4 does it.

Rules, limits and tangents are those of `LoopSubdivide` of pbrt-v4 [pharr2023, the program's source]: Warren's
beta inside, (1, 6, 1) / 8 on a rim. pbrt moves a rim's vertices by (1, 3, 1) / 5, where the limit of that
rule is (1, 4, 1) / 6; Penumbra follows pbrt.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenes.description.shapes import Array, Faces, Geometry, TriangleMesh
from scenes.errors import SceneError
from scenes.pbrt.directives.meshes import Placement, emitting_side, indexed
from scenes.pbrt.text.parameters import Parameters

TRIANGLE_LIMIT = 2**24  # a few GB


class _Topology(NamedTuple):
    """Half-edge h = 3 f + k runs from corner k of face f to the next; e edges.

    start, end: (3 t,) its vertices. twin: (3 t,) the other half of its edge, -1 on a rim. edge: (3 t,) its
    edge's number. first: (m,) the half-edge from which a walk round a vertex meets all its faces by their
    winding. degree: (m,) faces at a vertex. rim: (m,) whether the vertex lies on a rim.
    """

    start: Faces
    end: Faces
    twin: Faces
    edge: Faces
    first: Faces
    degree: Faces
    rim: NDArray[np.bool_]

    def step(self, h: Faces) -> Faces:
        """The next outgoing half-edge by the winding, -1 beyond a rim."""
        return self.twin[_previous(h)]


def loop_subdivision(parameters: Parameters, placement: Placement) -> list[Geometry]:
    """`Shape "loopsubdiv"`."""
    vertices, faces = indexed(parameters, corners=3)
    parameters.text("scheme", "loop")  # of no effect in pbrt-v4
    levels = max(parameters.integer("levels", 3), 0)
    if levels > 12 or len(faces) * 4**levels > TRIANGLE_LIMIT:
        raise parameters.fail(
            "levels", f"{len(faces)} faces at level {levels} are more than {TRIANGLE_LIMIT} triangles"
        )
    try:
        vertices, faces, normals = subdivide(vertices, faces, levels)
    except ValueError as error:
        raise SceneError(f"loopsubdiv: {error}", parameters.where) from None
    # The cross product of pbrt's tangents is opposite to the faces' own normal, and decides.
    world, turned = placement.transform.points(vertices), not placement.turned
    normals = placement.transform.normals(normals) * (-1.0 if placement.reverse else 1.0)
    if placement.light is not None:
        turned = emitting_side(world[faces], normals[faces], turned, parameters, "levels")
    return [TriangleMesh(world, faces, turned, normals=normals)]


def subdivide(vertices: Array, faces: Faces, levels: int) -> tuple[Array, Faces, Array]:
    """Vertices (m, 3) on the limit surface, faces (4^levels t, 3), and the cross product (m, 3) of the limit
    tangents there, of any length, opposite to the faces' normals; ValueError for what is no surface.
    """
    for _ in range(levels):
        mesh = _topology(faces, len(vertices))
        beta = np.where(mesh.rim, 1 / 8, np.where(mesh.degree == 3, 3 / 16, 3 / (8 * mesh.degree)))
        odd = _edge_points(vertices, mesh)
        vertices = np.concatenate([_moved(vertices, mesh, beta), odd])
        a, b, c = faces.T
        ab, bc, ca = len(vertices) - len(odd) + mesh.edge.reshape(-1, 3).T
        children = [a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]
        faces = np.stack([np.stack(child, axis=1) for child in children], axis=1).reshape(-1, 3)
    mesh = _topology(faces, len(vertices))
    limit = np.where(mesh.rim, 1 / 5, np.where(mesh.degree == 3, 1 / 5, 1 / (2 * mesh.degree)))
    vertices = _moved(vertices, mesh, limit)
    return vertices, faces, _normals(vertices, mesh)


def _previous(h: Faces) -> Faces:
    """The half-edge before h in its face, which ends where h starts."""
    return h - h % 3 + (h + 2) % 3


def _topology(faces: Faces, count: int) -> _Topology:
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    edges, edge, halves = np.unique(low * count + high, return_inverse=True, return_counts=True)
    order = np.argsort(edge, kind="stable")
    pairs = order[np.flatnonzero(np.diff(edge[order]) == 0)[:, None] + [0, 1]]
    alike = edge[pairs[start[pairs[:, 0]] == start[pairs[:, 1]], 0]]
    wrong = np.concatenate([edge[start == end], np.flatnonzero(halves > 2), alike])
    if len(wrong):
        a, b = divmod(int(edges[wrong[0]]), count)
        raise ValueError(f"the edge of points {a} and {b} joins no two faces of the same winding")
    twin = np.full(len(start), -1)
    twin[pairs[:, 0]], twin[pairs[:, 1]] = pairs[:, 1], pairs[:, 0]
    faces_at = np.bincount(start, minlength=count)
    if not faces_at.all():
        raise ValueError(f"point {int(np.argmin(faces_at))} is a corner of no face")
    first, open_ = np.zeros(count, dtype=np.int64), twin < 0
    first[start] = np.arange(len(start))
    first[start[open_]] = np.flatnonzero(open_)
    rim = np.bincount(start[open_], minlength=count) > 0
    mesh = _Topology(start, end, twin, edge, first, faces_at, rim)
    _check_fans(mesh)
    return mesh


def _check_fans(mesh: _Topology) -> None:
    """ValueError where a walk round a vertex does not meet all its faces."""
    h, vertex = mesh.first, np.arange(len(mesh.first))
    for j in range(1, int(mesh.degree.max()) + 1):
        h = mesh.step(h)
        closed = (h < 0) | (h == mesh.first[vertex])
        short = closed & (mesh.degree[vertex] != j)
        if short.any():
            raise ValueError(f"point {int(vertex[np.argmax(short)])} joins sheets that share no edge there")
        h, vertex = h[~closed], vertex[~closed]


def _scatter(index: Faces, values: Array, count: int) -> Array:
    """(count, 3) sums of values (n, 3) by their index (n,)."""
    sums = [np.bincount(index, values[:, i], minlength=count) for i in range(3)]
    return np.stack(sums, axis=1, dtype=np.float64)  # whole numbers of nothing else


def _moved(vertices: Array, mesh: _Topology, weight: Array) -> Array:
    """Each vertex by `weight` (m,) of each neighbour: inside all of them, on a rim the two along it."""
    count, open_ = len(vertices), mesh.twin < 0
    inside = ~mesh.rim[mesh.start]
    ring = _scatter(mesh.start[inside], vertices[mesh.end[inside]], count)
    ring += _scatter(mesh.start[open_], vertices[mesh.end[open_]], count)
    ring += _scatter(mesh.end[open_], vertices[mesh.start[open_]], count)
    neighbours = np.where(mesh.rim, 2, mesh.degree)
    return (1 - neighbours * weight)[:, None] * vertices + weight[:, None] * ring


def _edge_points(vertices: Array, mesh: _Topology) -> Array:
    """(e, 3) the new vertex of each edge: (3, 3, 1, 1) / 8 of its ends and the corners opposite, the middle
    of a rim's.
    """
    opposite = mesh.start[_previous(np.arange(len(mesh.start)))]
    middle = (vertices[mesh.start] + vertices[mesh.end]) / 2
    half = np.where((mesh.twin < 0)[:, None], middle, 3 / 8 * middle + vertices[opposite] / 8)
    return _scatter(mesh.edge, half, int(mesh.edge.max()) + 1)


def _normals(vertices: Array, mesh: _Topology) -> Array:
    """(m, 3) the cross product of the tangents of each vertex, from the ring of its neighbours on the limit
    surface; ring j of n is met by the winding, and inside pbrt counts the other way round.
    """
    n = mesh.degree + mesh.rim
    s, t = np.zeros_like(vertices), np.zeros_like(vertices)
    h, vertex = mesh.first, np.arange(len(vertices))
    for j in range(int(n.max())):
        # Beyond the last face of a rim stands one more neighbour.
        last = mesh.rim[vertex] & (n[vertex] - 1 == j)
        at = np.where(last, mesh.start[_previous(h)], mesh.end[h])
        along, across = _tangent_weights(j, n[vertex], mesh.rim[vertex])
        s[vertex] += along[:, None] * vertices[at]
        t[vertex] += across[:, None] * vertices[at]
        more = n[vertex] - 1 > j
        h, vertex = h[more], vertex[more]
        stays = mesh.rim[vertex] & (n[vertex] - 2 == j)
        h = np.where(stays, h, mesh.step(h))
    own = np.where(mesh.rim, np.array([0, 0, -2, -1, -2, 0])[np.minimum(n, 5)], 0)
    return np.cross(s, t + own[:, None] * vertices)


def _tangent_weights(j: int, n: Faces, rim: NDArray[np.bool_]) -> tuple[Array, Array]:
    """The weights (k,) of neighbour j of n in the tangents S and T."""
    ends = (j == 0) | (j == n - 1)
    along = np.where(rim, (j == n - 1) * 1.0 - (j == 0), np.cos(2 * np.pi * j / n))
    theta = np.pi / np.maximum(n - 1, 1)
    fan = np.where(ends, -np.sin(theta), (2 - 2 * np.cos(theta)) * np.sin(j * theta))
    few = np.select([n == 2, n == 3, n == 4], [1.0, np.where(ends, 0.0, 1.0), np.where(ends, -1.0, 2.0)], fan)
    return along, np.where(rim, few, -np.sin(2 * np.pi * j / n))
