"""`Shape "loopsubdiv"` against the rules of pbrt-v4 written down vertex by vertex, and against limits in
closed form.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenes.description.shapes import TriangleMesh
from scenes.pbrt.directives.subdivision import subdivide
from scenes.pbrt.parser import parse
from scenes.pbrt.write.scene import to_pbrt
from tests.kit.scene_texts import world, world_fails

OCTAHEDRON = (
    [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]],
    [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
)
TETRAHEDRON = (
    [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]],
    [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
)
TRIANGLE = ([[0, 0, 0], [2, 0.1, 0], [0.3, 1, 0.5]], [[0, 1, 2]])


def fan(corners: int, closed: bool) -> tuple[list[list[float]], list[list[int]]]:
    """An uneven cone: inside its tip if closed, else on a rim of so many faces."""
    angles = [2 * math.pi * i / corners * (1 if closed else 0.7) for i in range(corners + (not closed))]
    points = [[0.1, 0.2, 1.0]] + [[math.cos(a), (1.5 + 0.1 * a) * math.sin(a), 0.1 * a * a] for a in angles]
    return points, [[0, 1 + i, 1 + (i + 1) % len(angles)] for i in range(corners)]


MESHES = [
    OCTAHEDRON,
    TETRAHEDRON,
    TRIANGLE,
    *(fan(n, True) for n in (3, 5, 6, 9)),
    *(fan(n, False) for n in (1, 2, 3, 4, 7)),
]


def ring_of(vertex: int, faces: list[list[int]]) -> tuple[list[int], bool]:
    """The neighbours of a vertex, inside against the winding and on a rim by it, as in pbrt; if on a rim."""
    follows = {f[1]: f[2] for f in _turned(faces, vertex)}
    starts = set(follows) - set(follows.values())
    rim = bool(starts)
    ring = [starts.pop() if rim else next(iter(follows))]
    for _ in range(len(follows) - (not rim)):
        ring.append(follows[ring[-1]])
    return (ring if rim else ring[::-1]), rim


def _turned(faces: list[list[int]], vertex: int) -> list[list[int]]:
    """The faces at a vertex, turned so that it comes first."""
    return [f[f.index(vertex) :] + f[: f.index(vertex)] for f in faces if vertex in f]


def weighted(points: list[np.ndarray], vertex: int, faces: list[list[int]], limit: bool) -> np.ndarray:
    """pbrt's rule of an old vertex, or of its limit."""
    ring, rim = ring_of(vertex, faces)
    n = len(ring)
    if rim:
        w = 1 / 5 if limit else 1 / 8
        return (1 - 2 * w) * points[vertex] + w * points[ring[0]] + w * points[ring[-1]]
    beta = 3 / 16 if n == 3 else 3 / (8 * n)
    w = 1 / (n + 3 / (8 * beta)) if limit else beta
    return (1 - n * w) * points[vertex] + w * sum(points[r] for r in ring)


def refined(points: list[np.ndarray], faces: list[list[int]]) -> tuple[list[np.ndarray], list[list[int]]]:
    """One level, edge by edge."""
    new = [weighted(points, v, faces, limit=False) for v in range(len(points))]
    opposite: dict[frozenset[int], list[int]] = {}
    for f in faces:
        for k in range(3):
            opposite.setdefault(frozenset((f[k], f[(k + 1) % 3])), []).append(f[(k + 2) % 3])
    index: dict[frozenset[int], int] = {}
    for edge, corners in opposite.items():
        a, b = (points[i] for i in edge)
        index[edge] = len(new)
        ends = (a + b) / 2 if len(corners) == 1 else 3 / 8 * (a + b)
        new.append(ends if len(corners) == 1 else ends + sum(points[c] for c in corners) / 8)
    small: list[list[int]] = []
    for a, b, c in faces:
        ab, bc, ca = (index[frozenset(e)] for e in ((a, b), (b, c), (c, a)))
        small += [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return new, small


def normal(points: list[np.ndarray], vertex: int, faces: list[list[int]]) -> np.ndarray:
    """pbrt's cross product of the tangents."""
    ring, rim = ring_of(vertex, faces)
    p, n = [points[r] for r in ring], len(ring)
    if not rim:
        s = sum(math.cos(2 * math.pi * j / n) * p[j] for j in range(n))
        return np.cross(s, sum(math.sin(2 * math.pi * j / n) * p[j] for j in range(n)))
    s = p[-1] - p[0]
    if n == 2:
        return np.cross(s, p[0] + p[1] - 2 * points[vertex])
    if n == 3:
        return np.cross(s, p[1] - points[vertex])
    if n == 4:
        return np.cross(s, -p[0] + 2 * p[1] + 2 * p[2] - p[3] - 2 * points[vertex])
    theta = math.pi / (n - 1)
    t = math.sin(theta) * (p[0] + p[-1])
    t = t + sum((2 * math.cos(theta) - 2) * math.sin(k * theta) * p[k] for k in range(1, n - 1))
    return np.cross(s, -t)


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("levels", [0, 1, 2])
def test_subdivision_follows_the_rules_vertex_by_vertex(
    mesh: tuple[list[list[float]], list[list[int]]], levels: int
) -> None:
    points, faces = [np.array(p, dtype=float) for p in mesh[0]], mesh[1]
    for _ in range(levels):
        points, faces = refined(points, faces)
    limit = [weighted(points, v, faces, limit=True) for v in range(len(points))]
    found, indices, normals = subdivide(np.array(mesh[0], dtype=float), np.array(mesh[1]), levels)
    # The same triangles in the same order, whatever number a new vertex has.
    corners = np.array([[limit[v] for v in f] for f in faces])
    assert np.abs(found[indices] - corners).max() < 1e-14 * 8
    expected = np.array([[normal(limit, v, faces) for v in f] for f in faces])
    assert np.abs(normals[indices] - expected).max() < 1e-13


@pytest.mark.parametrize("mesh", [OCTAHEDRON, TETRAHEDRON])
def test_a_closed_surface_s_limit_is_the_same_from_every_level(
    mesh: tuple[list[list[float]], list[list[int]]],
) -> None:
    points, faces = np.array(mesh[0], dtype=float), np.array(mesh[1])
    coarse = [subdivide(points, faces, levels)[0] for levels in range(4)]
    for fine in coarse[1:]:
        assert np.allclose(fine[: len(points)], coarse[0], rtol=0, atol=1e-15)
    assert np.allclose(coarse[3][: len(coarse[2])], coarse[2], rtol=0, atol=1e-15)


def test_an_octahedron_s_tips_come_to_half_and_its_volume_converges() -> None:
    """Four neighbours whose sum is 0 leave 1 - 4 / 8 of a tip; a smooth limit gains four digits a level."""
    volumes: list[float] = []
    for levels in range(3, 7):
        points, faces, normals = subdivide(np.array(OCTAHEDRON[0], float), np.array(OCTAHEDRON[1]), levels)
        assert points[0].tolist() == [0.5, 0, 0]
        assert normals[0][0] < 0 and abs(normals[0][1:]).max() < 1e-15  # pbrt's look inwards
        volumes.append(float(np.linalg.det(points[faces]).sum()) / 6)
    ratios = np.diff(volumes)[:-1] / np.diff(volumes)[1:]
    assert np.allclose(ratios, 4, rtol=0.02)


TIPS = (
    'Shape "loopsubdiv" "integer levels" 1 "point3 P" [ 1 0 0 -1 0 0 0 1 0 0 -1 0 0 0 1 0 0 -1 ] '
    '"integer indices" [ 0 2 4 2 1 4 1 3 4 3 0 4 2 0 5 1 2 5 3 1 5 0 3 5 ]'
)


@pytest.mark.parametrize(
    ("state", "outwards"),
    [
        ("", False),
        ("ReverseOrientation ", True),
        ("Scale -1 1 1 ", False),
        ("Scale -1 1 1 ReverseOrientation ", True),
    ],
)
def test_the_side_of_pbrt_s_limit_normals_decides(state: str, outwards: bool) -> None:
    """They look inwards of a mesh wound outwards, mirrored or not, and ReverseOrientation turns them."""
    mesh = world(f'{state}AreaLightSource "diffuse"\n{TIPS}').shapes[0].geometry
    assert isinstance(mesh, TriangleMesh)
    volume = np.linalg.det(mesh.vertices[mesh.faces]).sum() / 6
    assert bool((volume > 0) != mesh.reverse) is outwards
    assert mesh.normals is not None
    assert np.all((mesh.normals * mesh.vertices).sum(axis=1) * (1 if outwards else -1) > 0)
    assert len(mesh.faces) == 32


def test_an_export_holds_the_subdivided_mesh() -> None:
    scene = world("ReverseOrientation " + TIPS)
    assert parse(to_pbrt(scene)).content_hash() == scene.content_hash()


@pytest.mark.parametrize(
    ("indices", "word"),
    [
        ("0 1 2 0 1 3", "points 0 and 1 joins"),
        ("0 1 2 1 0 3 0 1 3", "points 0 and 1 joins"),
        ("0 0 2 1 3 2", "points 0 and 0 joins"),
        ("0 1 2", "point 3 is a corner of no face"),
        ("0 1 2 0 3 4", "point 0 joins sheets"),
    ],
)
def test_what_is_no_surface_is_refused_in_words(indices: str, word: str) -> None:
    points = " ".join(["0 0 0", "1 0 0", "0 1 0", "0 0 1", "1 1 1"][: 5 if "4" in indices else 4])
    world_fails(f'Shape "loopsubdiv" "point3 P" [ {points} ] "integer indices" [ {indices} ]', 1, 1, word)


def test_more_triangles_than_memory_are_refused_before_they_are_made() -> None:
    line = 'Shape "loopsubdiv" "point3 P" [ 0 0 0 1 0 0 0 1 0 ] "integer levels" [ 13 ]'
    world_fails(line, 1, line.index('"integer levels') + 1, "1 faces at level 13")
