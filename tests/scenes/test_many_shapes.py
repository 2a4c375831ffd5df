"""Scenes of very many shapes: what is worked out for all of them at once, or once for all of them."""

from __future__ import annotations

import gzip
import os
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from renderer.build import build
from renderer.camera import make_camera
from scenes import files
from scenes.description.scene import Film, PerspectiveCamera
from scenes.description.shapes import (
    BLOCK,
    BilinearMesh,
    Disk,
    Geometry,
    Sphere,
    TriangleMesh,
    boxes,
    cross_product,
)
from scenes.errors import PenumbraError, SceneError
from scenes.pbrt import reader
from scenes.pbrt.parser import parse, parse_file
from scenes.ply.mesh import read_ply
from tests.kit.ply_files import CORNERS, POINTS, ply_bytes, written

RNG = np.random.default_rng(5)


def _geometries() -> list[Geometry]:
    points = RNG.normal(size=(9, 3))
    axis = np.array([0.6, 0.0, 0.8])
    return [
        TriangleMesh(points, np.array([[0, 1, 2], [2, 3, 5]])),  # leaves vertices out
        Sphere(points[0], 0.7),
        Disk(points[1], axis, 2.0),
        BilinearMesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), np.array([[0, 1, 2, 3]])),
    ]


def test_boxes_of_all_shapes_are_their_own_bounds() -> None:
    # A vertex that no face uses, or a disk as its ball, would widen a box by more than 0.1.
    geometries = _geometries()
    low, high = boxes(geometries)
    for i, geometry in enumerate(geometries):
        least, greatest = geometry.bounds().extent(np.eye(3))
        np.testing.assert_array_equal(low[i], least)
        np.testing.assert_array_equal(high[i], greatest)
    assert boxes([])[0].shape == (0, 3)


def test_cross_products_are_numpys_to_the_bit() -> None:
    a, b = RNG.normal(size=(2, 50, 3))
    np.testing.assert_array_equal(cross_product(a, b), np.cross(a, b))


@pytest.mark.parametrize("bend", [0.0, 0.1])
def test_a_flat_mesh_of_several_blocks_is_known_as_flat(bend: float) -> None:
    """bend: how far the last vertex is out of the plane z = 0."""
    count = BLOCK + 10
    x = np.arange(count + 2.0)
    vertices = np.stack([x, x % 2, np.zeros_like(x)], axis=1)
    vertices[-1, 2] = bend
    faces = np.arange(count)[:, None] + np.arange(3)
    faces[1::2] = faces[1::2, ::-1]  # a strip, all faces one way
    bounds = TriangleMesh(vertices, faces).bounds()
    if bend:
        assert bounds.normal is None
    else:
        assert bounds.normal is not None
        assert np.abs(bounds.normal).tolist() == [0, 0, 1]
        assert bounds.one_way
        faces[-1] = faces[-1, ::-1]
        assert not TriangleMesh(vertices, faces).bounds().one_way


def test_a_camera_judges_many_hulls_as_it_does_one() -> None:
    camera = make_camera(PerspectiveCamera(np.eye(4), 40.0), Film(20, 10))
    hulls = RNG.normal(size=(200, 3, 1)) * 5 + RNG.normal(size=(200, 3, 8))
    seen = camera.sees_each(hulls)
    assert seen.tolist() == [camera.sees(hull) for hull in hulls]
    assert 0 < seen.sum() < 200


def test_short_lists_of_numbers_are_read_at_once_and_blamed_singly() -> None:
    head = "WorldBegin\n"
    scene = parse(f'{head}Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 -0 1e0]')
    geometry = scene.shapes[0].geometry
    assert isinstance(geometry, TriangleMesh)
    assert geometry.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 0, 1]]
    for text, column in (("[0 0 0 1 0 x 0 0 1]", 44), ("[0 0 0 1 0 1e999 0 0 1]", 44)):
        with pytest.raises(SceneError) as caught:
            parse(f'{head}Shape "trianglemesh" "point3 P" {text}')
        assert caught.value.location is not None
        assert (caught.value.location.line, caught.value.location.column) == (2, column)


def test_a_small_mesh_file_is_read_anew_when_it_changed(tmp_path: Path) -> None:
    faces = ("face", [CORNERS], [((0, 1, 2),)])
    path = written(tmp_path, ply_bytes("ascii", POINTS, faces))
    first = read_ply(path)
    assert read_ply(path) is first
    with pytest.raises(ValueError, match="read-only"):
        first.vertices[0] = 0
    written(tmp_path, ply_bytes("ascii", POINTS, ("face", [CORNERS], [((2, 1, 0),)])))
    os.utime(path, ns=(1, 1))
    assert read_ply(path).triangles.tolist() == [[2, 1, 0]]


def test_materials_of_many_shapes_are_told_apart() -> None:
    """Shapes that share a material object and shapes of equal ones have their own rows of each kind."""
    text = (
        'Film "rgb" "integer xresolution" 4 "integer yresolution" 4\nWorldBegin\n'
        'Material "diffuse"\nShape "sphere"\nShape "sphere"\nMaterial "conductor"\nShape "sphere"\n'
        'Material "diffuse" "rgb reflectance" [0 0 0]\nShape "sphere"\n'
    )
    scene = build(parse(text))
    assert scene.material_of[0] == scene.material_of[1] == scene.material_of[3] != scene.material_of[2]
    assert (scene.lobes != 0).tolist() == [True, True, True, False]


def test_a_long_file_tells_how_far_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "PATIENCE", 0.0)
    monkeypatch.setattr(reader, "OFTEN", 10)
    path = tmp_path / "s.pbrt"
    path.write_text("WorldBegin\n" + 'Shape "sphere"\n' * 100)
    told: list[float] = []
    parse_file(path, progress=told.append)
    assert len(told) == 10
    assert told == sorted(told)
    assert 0 < told[0] < 0.2
    assert 0.9 < told[-1] <= 1
    monkeypatch.setattr(reader, "PATIENCE", 100.0)
    told.clear()
    parse_file(path, progress=told.append)
    assert told == []


def test_a_packed_file_has_a_limit_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What lies on the disk may be large; what a small file would become may not."""
    monkeypatch.setattr(files, "PACKED_LIMIT", 1000)
    (tmp_path / "a.txt").write_bytes(bytes(2000))
    assert len(files.read_bytes(tmp_path / "a.txt")) == 2000
    (tmp_path / "a.gz").write_bytes(gzip.compress(bytes(2000)))
    with pytest.raises(PenumbraError, match="larger than"):
        files.read_bytes(tmp_path / "a.gz")


def test_a_small_file_takes_little_memory(tmp_path: Path) -> None:
    """Not what a file may have at most, 4 GiB, which a strict system would refuse."""
    (tmp_path / "a.txt").write_bytes(bytes(2000))
    tracemalloc.start()
    try:
        files.read_bytes(tmp_path / "a.txt")
        assert tracemalloc.get_traced_memory()[1] < 10**6
    finally:
        tracemalloc.stop()


def test_an_inline_mesh_takes_three_times_the_memory_of_its_arrays_at_most(tmp_path: Path) -> None:
    """A file of pbrt text whose numbers are nearly all of it: text, lines and arrays together."""
    side = 250
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    points = np.stack([x.ravel(), y.ravel(), np.sin(x.ravel())], axis=1)
    corner = np.arange(side * side).reshape(side, side)
    a, b, c, d = (v.ravel() for v in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])
    path = tmp_path / "inline.pbrt"
    with path.open("w") as file:
        file.write('Camera "perspective" WorldBegin Shape "trianglemesh" "point3 P" [\n')
        np.savetxt(file, points, fmt="%.6f")
        file.write(']\n"integer indices" [\n')
        np.savetxt(file, faces, fmt="%d")
        file.write("]\n")
    parse_file(path)  # what is imported and kept is there then
    tracemalloc.start()
    (shape,) = parse_file(path).shapes
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    mesh = shape.geometry
    assert isinstance(mesh, TriangleMesh)
    np.testing.assert_array_equal(mesh.faces, faces)
    np.testing.assert_array_equal(mesh.vertices, points.round(6) + 0.0)
    assert peak < 3 * (mesh.vertices.nbytes + mesh.faces.nbytes)
