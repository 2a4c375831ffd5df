"""What a PLY file may look like: each encoding, type and order of its parts gives the rows that were
written.
"""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from trimesh.exchange.ply import export_ply, load_ply

from scenes.ply.mesh import MeshFile, read_ply
from scenes.ply.text import PIECE
from tests.kit.ply_files import CODES, CORNERS, FORMATS, POINTS, Table, ply_bytes, written

MIXED = [(0, 1, 2), (0, 1, 2, 3), (2, 3, 4), (4, 3, 2), (1, 2, 3, 4)]


def check(mesh: MeshFile, points: Table = POINTS, faces: list[tuple[int, ...]] = MIXED) -> None:
    np.testing.assert_array_equal(mesh.vertices, np.array([row[:3] for row in points[2]], dtype=np.float64))
    assert mesh.triangles.tolist() == [list(face) for face in faces if len(face) == 3]
    assert mesh.quads.tolist() == [list(face) for face in faces if len(face) == 4]


@pytest.mark.parametrize("encoding", FORMATS)
@pytest.mark.parametrize("compressed", [False, True])
def test_files_that_mix_triangles_and_quadrilaterals(tmp_path: Path, encoding: str, compressed: bool) -> None:
    data = ply_bytes(encoding, POINTS, ("face", [CORNERS], [(face,) for face in MIXED]))
    check(
        read_ply(written(tmp_path, gzip.compress(data) if compressed else data, "m.ply" + ".gz" * compressed))
    )


@pytest.mark.parametrize("encoding", FORMATS)
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_line_ends_comments_and_both_names_of_the_corners(
    tmp_path: Path, encoding: str, newline: str
) -> None:
    notes = ["comment end_header of another", "obj_info caf\u00e9 7", "comment", "comment property what x"]
    points = (
        "vertex",
        POINTS[1],
        [(10, 13, 32), *POINTS[2][1:]],
    )  # 10, 13: what a line end looks like in binary
    data = ply_bytes(
        encoding,
        points,
        ("face", ["list uchar uchar vertex_index"], [(face,) for face in MIXED]),
        newline=newline,
        notes=notes,
    )
    check(read_ply(written(tmp_path, data)), points)


@pytest.mark.parametrize("encoding", FORMATS)
def test_further_properties_and_elements_are_stepped_over(tmp_path: Path, encoding: str) -> None:
    strips = (
        "tristrips",
        ["list int int vertex_indices", "uchar flag"],
        [((1, 2, 3, -1), 9), ((), 8), ((4,), 7)],
    )
    camera = ("camera", ["float view_px", "double scale"], [(0.5, 1e300)])
    empty: Table = ("edge", ["int vertex1"], [])
    vertices = (
        "vertex",
        ["uchar red", "list uchar short tags", "float x", "float y", "list uchar float more", "float z"],
        [(i, (1,) * (i % 3), row[0], row[1], (0.5,) * (i % 2), row[2]) for i, row in enumerate(POINTS[2])],
    )
    faces = (
        "face",
        ["ushort material", CORNERS, "int face_indices", "list uchar float texcoord", "double weight"],
        [(500, face, i, (0.5,) * (2 * len(face) * (i % 2)), 0.125) for i, face in enumerate(MIXED)],
    )
    check(
        read_ply(
            written(
                tmp_path, ply_bytes(encoding, strips, camera, vertices, empty, faces, ("last", *strips[1:]))
            )
        )
    )
    first = written(tmp_path, ply_bytes(encoding, faces, strips, vertices))  # faces before the vertices
    check(read_ply(first))


@pytest.mark.parametrize("encoding", FORMATS)
@pytest.mark.parametrize("type_", CODES)
def test_every_type_by_both_its_names(tmp_path: Path, encoding: str, type_: str) -> None:
    limits = {
        "b": (-128, 127),
        "B": (0, 255),
        "h": (-32768, 32767),
        "H": (0, 65535),
        "i": (-(2**31), 2**31 - 1),
    }
    low, high = {**limits, "I": (0, 2**32 - 1), "f": (-1.5, 2.0**100), "d": (-0.1, 1e300)}[CODES[type_]]
    points: Table = ("vertex", [f"{type_} {name}" for name in "xyz"], [(low, high, 1), (2, 3, 4), (5, 6, 7)])
    whole = CODES[type_] not in "fd"
    corners = f"list {type_} {type_} vertex_indices" if whole else CORNERS
    data = ply_bytes(encoding, points, ("face", [corners], [((0, 1, 2),), ((2, 1, 0),)]))
    check(read_ply(written(tmp_path, data)), points, [(0, 1, 2), (2, 1, 0)])


def test_text_is_rounded_to_the_declared_type_and_may_be_broken_anywhere(tmp_path: Path) -> None:
    head = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty double y\nproperty int z\n"
    head += b"element face 1\nproperty list uchar int vertex_indices\nend_header"
    mesh = read_ply(written(tmp_path, head + b"\n\n0.1\n0.1 -0 \t 1e0 -0.\r\n-3 .5 2 2.0 3 0 1 2"))
    assert mesh.vertices.tolist() == [[float(np.float32(0.1)), 0.1, 0], [1, 0, -3], [0.5, 2, 2]]
    assert not np.signbit(mesh.vertices[1, 1])


@settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
@given(
    st.lists(st.tuples(st.sampled_from([3, 4]), st.integers(1, 400)), min_size=1, max_size=6),
    st.sampled_from(sorted(FORMATS)),
)
def test_runs_of_any_length(
    tmp_path_factory: pytest.TempPathFactory, runs: list[tuple[int, int]], encoding: str
) -> None:
    """Up to 2,400 faces: runs shorter and longer than what is compared at once, so that an end off by one
    shows.
    """
    sizes = [size for size, count in runs for _ in range(count)]
    faces = [tuple((7 * i + k) % 5 for k in range(size)) for i, size in enumerate(sizes)]
    data = ply_bytes(
        encoding, POINTS, ("face", [CORNERS, "uchar i"], [(face, i % 251) for i, face in enumerate(faces)])
    )
    check(read_ply(written(tmp_path_factory.getbasetemp(), data, "runs.ply")), faces=faces)


@pytest.mark.parametrize("encoding", FORMATS)
def test_faces_of_one_size_in_rows_of_several(tmp_path: Path, encoding: str) -> None:
    """Triangles whose rows have other lists too, in runs longer than what is stepped over one by one."""
    faces = [(i % 5, (i + 1) % 5, (i + 2) % 5) for i in range(300)]
    rows = [(face, (0.5,) * (i // 50 % 3), i % 100) for i, face in enumerate(faces)]
    data = ply_bytes(encoding, POINTS, ("face", [CORNERS, "list ushort double more", "char i"], rows))
    check(read_ply(written(tmp_path, data)), faces=faces)


def test_text_longer_than_what_is_read_at_a_time(tmp_path: Path) -> None:
    count = PIECE // 16  # three pieces and more
    rng = np.random.default_rng(1)
    points: Table = (
        "vertex",
        [f"double {name}" for name in "xyz"],
        [tuple(row) for row in rng.normal(size=(count, 3)).tolist()],
    )
    data = ply_bytes("ascii", points, ("face", [CORNERS], [((0, 1, 2),)]))
    assert len(data) > 3 * PIECE
    check(read_ply(written(tmp_path, data)), points, [(0, 1, 2)])  # repr is exact: to the bit


@pytest.mark.parametrize("encoding", ["binary", "ascii"])
@pytest.mark.parametrize("normals", [False, True])
def test_trimesh_s_reader_agrees_on_what_it_writes(tmp_path: Path, encoding: str, normals: bool) -> None:
    ball = trimesh.creation.icosphere(2)
    ball.vertex_attributes["s"] = ball.vertices[:, 0].astype(np.float32)
    ball.vertex_attributes["t"] = ball.vertices[:, 1].astype(np.float32)
    ball.face_attributes["weight"] = np.arange(len(ball.faces), dtype=np.int32)
    path = written(tmp_path, export_ply(ball, encoding=encoding, vertex_normal=normals))
    with path.open("rb") as stream:
        theirs = load_ply(stream, fix_texture=False)
    ours = read_ply(path)
    np.testing.assert_array_equal(ours.vertices, theirs["vertices"])
    np.testing.assert_array_equal(ours.triangles, theirs["faces"])
    assert (ours.normals is not None) == normals
    if ours.normals is not None:
        np.testing.assert_array_equal(ours.normals, theirs["vertex_normals"])
    assert ours.uv is not None
    np.testing.assert_array_equal(ours.uv, theirs["visual"].uv)
