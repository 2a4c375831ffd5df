"""PLY files: read to the bit, quadrilaterals as patches, and clear words for what is damaged or not
supported.
"""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.exchange.ply import export_ply

from scenes.description.shapes import BilinearMesh, TriangleMesh
from scenes.errors import PenumbraError, SceneError
from scenes.pbrt.parser import parse_file
from scenes.ply.mesh import read_ply
from tests.kit.scene_texts import HEAD, face_normals

POINTS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0 0\n"
TRIANGLES, QUADS = "3 0 1 2\n3 0 2 3\n", "4 0 1 2 3\n4 1 4 2 2\n"


def ascii_ply(faces: str, points: str = POINTS, extra: str = "") -> bytes:
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {points.count(chr(10))}\nproperty float x\nproperty float y\n"
    )
    head += (
        f"property float z\n{extra}element face {faces.count(chr(10))}\nproperty list uchar int "
        "vertex_indices\n"
    )
    return (head + "end_header\n" + points + faces).encode()


def binary_quads() -> bytes:
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty double x\nproperty double y\n"
    head += "property double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]], dtype="<f8")
    return head.encode() + points.tobytes() + b"\x04" + np.arange(4, dtype="<i4").tobytes()


def written(folder: Path, data: bytes, name: str = "m.ply") -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("encoding", ["binary", "ascii"])
def test_a_triangle_mesh_is_read_to_the_bit(tmp_path: Path, encoding: str) -> None:
    ball = trimesh.creation.icosphere(2)
    points = ball.vertices.astype(np.float32)
    data = export_ply(
        trimesh.Trimesh(points, ball.faces, process=False), encoding=encoding, vertex_normal=False
    )
    mesh = read_ply(written(tmp_path, data))
    np.testing.assert_array_equal(mesh.triangles, ball.faces)
    if encoding == "binary":
        np.testing.assert_array_equal(mesh.vertices, points.astype(np.float64))
    else:  # eight decimals, as trimesh writes them
        np.testing.assert_allclose(mesh.vertices, points, atol=1e-8)
    assert mesh.quads.shape == (0, 4)


def test_no_vertex_is_merged_or_dropped(tmp_path: Path) -> None:
    mesh = read_ply(written(tmp_path, ascii_ply("3 0 1 2\n", points="0 0 0\n1 0 0\n0 0 0\n7 7 7\n")))
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 0, 0], [7, 7, 7]]


def test_quads_stay_whole_also_beside_triangles(tmp_path: Path) -> None:
    mixed = read_ply(written(tmp_path, ascii_ply(TRIANGLES + QUADS)))
    assert mixed.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mixed.quads.tolist() == [[0, 1, 2, 3], [1, 4, 2, 2]]
    assert read_ply(written(tmp_path, ascii_ply(QUADS))).quads.tolist() == mixed.quads.tolist()
    assert read_ply(written(tmp_path, binary_quads())).quads.tolist() == [[0, 1, 2, 3]]


def test_a_mesh_file_becomes_the_shapes_that_pbrt_makes_of_it(tmp_path: Path) -> None:
    written(tmp_path, ascii_ply("3 1 4 2\n4 0 1 2 3\n"))
    scene = tmp_path / "s.pbrt"
    scene.write_text(HEAD + 'ReverseOrientation Translate 0 0 5 Shape "plymesh" "string filename" "m.ply"')
    triangles, patches = (shape.geometry for shape in parse_file(scene).shapes)
    assert isinstance(triangles, TriangleMesh)
    assert isinstance(patches, BilinearMesh)
    assert patches.faces.tolist() == [[0, 1, 3, 2]]  # p00 p10 p01 p11
    assert triangles.vertices[:, 2].tolist() == patches.vertices[:, 2].tolist() == [5] * 5
    for geometry in (triangles, patches):
        assert face_normals(geometry.vertices, geometry.faces, geometry.reverse).tolist() == [[0, 0, -1]]


NORMALS = "property float nx\nproperty float ny\nproperty float nz\n"


@pytest.mark.parametrize(
    ("data", "word"),
    [
        (b"", "no PLY file"),
        (b"solid cube\n", "no PLY file"),
        (b"ply\nformat ascii 1.0\n", "no PLY file"),
        (b"ply\nformat ascii 1.0\nelement vertex 3\nproperty what x\nend_header\n", "no PLY file"),
        (ascii_ply(""), "no faces"),
        (ascii_ply("3 0 1 9\n"), "beyond its 5 vertices"),
        (ascii_ply("3 0 1 -1\n"), "beyond its 5 vertices"),
        (ascii_ply(TRIANGLES, points="0 0 0\n1 0 0\n1 nan 0\n0 1 0\n2 0 0\n"), "not finite"),
        (ascii_ply(TRIANGLES, points="0 0 0\n1 0 0\nhello there\n0 1 0\n"), "no PLY file"),
        (ascii_ply(TRIANGLES).replace(b"face 2", b"face 3"), "as its header says"),
        (ascii_ply(TRIANGLES).replace(b"vertex 5", b"wertex 5"), "has no vertices"),
        (binary_quads()[:-2], "does not hold as much as its header says"),
        (binary_quads() + b"\x00", "does not end where its header says"),
        (binary_quads().replace(b"face 1", b"face 1000000000000"), "1000000000000 rows of 'face'"),
    ],
)
def test_damaged_or_unsupported_files_are_named_with_the_reason(
    tmp_path: Path, data: bytes, word: str
) -> None:
    path = written(tmp_path, data)
    with pytest.raises(PenumbraError, match=word) as caught:
        read_ply(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def with_normals(normals: str, faces: str = TRIANGLES) -> bytes:
    rows = zip(["0 0 0", "1 0 0", "1 1 0", "0 1 0"], normals.split(","), strict=True)
    return ascii_ply(faces, "".join(f"{point} {normal}\n" for point, normal in rows), NORMALS)


@pytest.mark.parametrize(
    ("state", "normals", "reverse"),
    [
        ("", "0 0 1,0 0 1,0 0 1,0 0 1", False),
        (
            "",
            "0 0 -2,0 0 -1,0 0 -1,0 0 -1",
            True,
        ),  # in pbrt the given normals decide, whatever the order of corners
        ("ReverseOrientation ", "0 0 1,0 0 1,0 0 1,0 0 1", True),
        ("ReverseOrientation ", "0 0 -1,0 0 -1,0 0 -1,0 0 -1", False),
        (
            "Scale -1 1 1 ",
            "0 0 1,0 0 1,0 0 1,0 0 1",
            True,
        ),  # mirrored corners go round the other way; the normal stays +z
        ("Scale 1 1 -1 ", "0 0 1,0 0 1,0 0 1,0 0 1", True),
    ],
)
@pytest.mark.parametrize("faces", [TRIANGLES, "4 0 1 2 3\n"])
def test_normals_that_are_the_faces_own_only_choose_a_side(
    tmp_path: Path, faces: str, state: str, normals: str, reverse: bool
) -> None:
    written(tmp_path, with_normals(normals, faces))
    scene = tmp_path / "s.pbrt"
    scene.write_text(HEAD + state + 'Shape "plymesh" "string filename" "m.ply"')
    geometry = parse_file(scene).shapes[0].geometry
    assert isinstance(geometry, TriangleMesh if faces == TRIANGLES else BilinearMesh)
    assert geometry.reverse is reverse


@pytest.mark.parametrize("names", ["u v", "s t", "texture_u texture_v", "texture_s texture_t"])
@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_texture_coordinates_are_read_under_each_of_their_names(
    tmp_path: Path, names: str, encoding: str
) -> None:
    first, second = names.split()
    properties = f"property float {first}\nproperty float {second}\n"
    if encoding == "ascii":
        data = ascii_ply("3 0 1 2\n", "0 0 0 0 0\n1 0 0 .5 0\n0 1 0 0 .25\n", properties)
    else:
        head = (
            "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float "
            f"y\nproperty float z\n{properties}"
        )
        head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        rows = np.array([[0, 0, 0, 0, 0], [1, 0, 0, 0.5, 0], [0, 1, 0, 0, 0.25]], dtype="<f4")
        data = head.encode() + rows.tobytes() + b"\x03" + np.arange(3, dtype="<i4").tobytes()
    uv = read_ply(written(tmp_path, data)).uv
    assert uv is not None
    assert uv.tolist() == [[0, 0], [0.5, 0], [0, 0.25]]


def test_compressed_files_are_read(tmp_path: Path) -> None:
    written(tmp_path, gzip.compress(binary_quads()), "m.ply.gz")
    scene = tmp_path / "s.pbrt"
    scene.write_text(HEAD + 'Shape "plymesh" "string filename" "m.ply.gz"')
    assert isinstance(parse_file(scene).shapes[0].geometry, BilinearMesh)
    for data in (b"no gzip", gzip.compress(binary_quads())[:-9], b""):
        with pytest.raises(PenumbraError, match=r"m\.ply\.gz"):
            read_ply(written(tmp_path, data, "m.ply.gz"))


def test_the_edge_length_of_a_displacement_that_there_is_none_of_changes_nothing(tmp_path: Path) -> None:
    written(tmp_path, ascii_ply(TRIANGLES))
    scene = tmp_path / "s.pbrt"
    for name in ("edgelength", "displacement.edgelength"):  # pbrt has called it both
        scene.write_text(HEAD + f'Shape "plymesh" "string filename" "m.ply" "float {name}" 2')
        assert len(parse_file(scene).shapes) == 1


def test_errors_of_a_mesh_file_stand_where_the_scene_names_it(tmp_path: Path) -> None:
    written(tmp_path, ascii_ply("4 0 1 2 3\n", points="0 0 0\n1 0 0\n0.2 0.2 0\n0 1 0\n"))
    scene = tmp_path / "s.pbrt"
    scene.write_text('Camera "perspective"\nWorldBegin\n  Shape "plymesh" "string filename" "m.ply"')
    with pytest.raises(SceneError, match=r"s\.pbrt:3:3: patch 0 is not convex"):
        parse_file(scene)
    written(tmp_path, b"nonsense")
    with pytest.raises(SceneError, match=r"s\.pbrt:3:19: .*no PLY file"):
        parse_file(scene)
