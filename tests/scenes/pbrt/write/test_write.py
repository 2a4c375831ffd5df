"""Exported text is real pbrt-v4, self-contained, and reads back as the very same bits."""

from __future__ import annotations

import re
from dataclasses import astuple, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import scenes
from scenes.description.materials import Diffuse
from scenes.description.scene import (
    Camera,
    Film,
    Lens,
    OrthographicCamera,
    PerspectiveCamera,
    RenderDefaults,
    SceneDescription,
)
from scenes.description.shapes import BilinearMesh, Disk, Emission, ShapeDescription, Sphere, TriangleMesh
from scenes.pbrt.parser import parse, parse_file
from scenes.pbrt.transforms import look_at, rotate, unit
from scenes.pbrt.write.scene import ExportedScene, export, to_pbrt
from tests.kit.exported import laid_out
from tests.kit.library import library_cases
from tests.kit.scene_texts import HEAD, PATCH, TRIANGLE, world

LIBRARY = library_cases()


@cache
def exported(name: str) -> tuple[SceneDescription, ExportedScene]:
    """A scene of the library and its export, for both tests of it: a forest takes seconds."""
    scene = scenes.load(name)
    return scene, export(scene, "scene")


@pytest.mark.parametrize("name", LIBRARY)
def test_library_scenes_read_back_bitwise(name: str, tmp_path: Path) -> None:
    scene, text = exported(name)
    back = parse_file(laid_out(text, tmp_path))
    assert back.content_hash() == scene.content_hash()
    assert astuple(back.defaults) == astuple(scene.defaults)
    assert back.parameters == ()


@pytest.mark.parametrize("name", LIBRARY)
def test_exported_text_holds_nothing_that_pbrt_does_not_know(name: str) -> None:
    text = exported(name)[1].text
    bare = re.sub(r'"[^"]*"|#.*|[\[\]]', " ", text)
    words = set(bare.split())
    numbers = {word for word in words if re.fullmatch(r"-?[0-9.]+(e[+-]?[0-9]+)?", word)}
    assert "$" not in text
    assert words - numbers <= {
        "Transform", "Translate", "Camera", "Film", "PixelFilter", "Sampler", "Integrator", "WorldBegin", "AttributeBegin",  # noqa: E501
        "AttributeEnd", "AreaLightSource", "LightSource", "Material", "Texture", "ReverseOrientation", "ConcatTransform", "Shape", "true",  # noqa: E501
        "false",
    }  # fmt: skip
    for statement in ('"bool savefp16" [ false ]', 'PixelFilter "', 'Integrator "', 'Sampler "'):
        assert statement in text


class Random:
    """Descriptions with the numbers that are hardest to write and to read back."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def vector(self) -> NDArray[np.float64]:
        awkward = np.array([0.0, 0.1, 1 / 3, -1e-7, 1e17, 2.0**-1074, -123456789.987654321, 5e-324])
        return np.where(self.rng.random(3) < 0.2, self.rng.choice(awkward, 3), self.rng.normal(size=3))

    def direction(self) -> NDArray[np.float64]:
        return unit(np.eye(3)[self.rng.integers(3)] if self.flag() else self.rng.normal(size=3)) + 0.0

    def flag(self) -> bool:
        return bool(self.rng.integers(2))

    def positive(self) -> float:
        return float(10 ** self.rng.uniform(-9, 9))

    def mesh(self) -> TriangleMesh:
        points = np.array([self.vector() for _ in range(self.rng.integers(3, 20))])
        faces = self.rng.integers(0, len(points), (self.rng.integers(1, 9), 3))
        return TriangleMesh(points, faces.astype(np.int64), self.flag())

    def patch(self) -> BilinearMesh:
        square = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]]) * self.rng.uniform(0.1, 10, 2)
        turn = rotate(float(self.rng.uniform(0, 360)), *self.direction().tolist()).matrix[:3, :2]
        return BilinearMesh(square @ turn.T + self.rng.normal(size=3), np.array([[0, 1, 2, 3]]), self.flag())

    def shape(self) -> ShapeDescription:
        sphere = Sphere(self.vector(), self.positive(), self.flag())
        disk = Disk(self.vector(), self.direction(), self.positive())
        geometry = [self.mesh(), self.patch(), sphere, disk][self.rng.integers(4)]
        emits = self.flag() and not isinstance(geometry, TriangleMesh)
        emission = Emission(self.rng.random(3) * self.positive(), self.flag()) if emits else None
        return ShapeDescription(geometry, Diffuse(self.rng.random(3)), emission)

    def camera(self) -> Camera:
        to_world = look_at(np.zeros(3), self.direction(), self.rng.normal(size=3)).inverse.copy()
        to_world[:3, 3] = self.vector()
        to_world[:3, 0] *= -1 if self.flag() else 1  # a mirrored camera
        lens = Lens(self.positive(), self.positive()) if self.flag() else None
        if self.flag():
            return OrthographicCamera(to_world + 0.0, lens=lens)
        return PerspectiveCamera(to_world + 0.0, float(self.rng.uniform(0.001, 179.9)), lens=lens)

    def scene(self) -> SceneDescription:
        film = Film(int(self.rng.integers(1, 4096)), int(self.rng.integers(1, 4096)))
        defaults = RenderDefaults("sobol" if self.flag() else "independent", int(self.rng.integers(1, 2**20)))
        shapes = tuple(self.shape() for _ in range(self.rng.integers(5)))
        return SceneDescription("random", self.camera(), film, shapes, defaults=defaults)


@pytest.mark.parametrize("seed", range(60))
def test_any_description_reads_back_bitwise(seed: int) -> None:
    scene = Random(seed).scene()
    back = parse(to_pbrt(scene))
    assert back.content_hash() == scene.content_hash()
    assert astuple(back.defaults) == astuple(scene.defaults)


def test_what_was_transformed_is_exported_in_world_space() -> None:
    body = "Rotate 33 1 2 3 Translate 1 2 3 Scale .1 .1 .1 ReverseOrientation\n" + TRIANGLE + "\n" + PATCH
    body += (
        '\nShape "sphere" "float radius" 3\nAreaLightSource "diffuse" Rotate 11 0 1 0 Shape "disk" '
        '"float height" .3'
    )
    scene = parse("Rotate 12 3 2 1\nScale -2 2 2\n" + HEAD + body)
    assert parse(to_pbrt(scene)).content_hash() == scene.content_hash()
    assert to_pbrt(parse(to_pbrt(scene))).split("WorldBegin")[1] == to_pbrt(scene).split("WorldBegin")[1]


def test_a_camera_from_six_digits_is_made_orthonormal_and_then_exact() -> None:
    turn = np.round(look_at(np.zeros(3), np.array([1.0, 2, 3]), np.array([0, 1.0, 0])).matrix, 6)
    text = "Transform [ " + " ".join(repr(v) for v in turn.T.ravel().tolist()) + " ]\nTranslate 1 2 3\n"
    scene = parse(text + 'Camera "perspective"\nWorldBegin')
    rotation = scene.camera.camera_to_world[:3, :3]
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(rotation, turn[:3, :3].T, atol=2e-6)
    np.testing.assert_allclose(scene.camera.camera_to_world[:3, 3], [-1, -2, -3], atol=1e-5)
    assert parse(to_pbrt(scene)).content_hash() == scene.content_hash()


def test_a_camera_that_stretches_is_written_to_rounding() -> None:
    """Its matrix is inverted twice on the way, which an orthonormal one is not."""
    camera = parse("ConcatTransform [ 1 .2 0 0  0 2 0 0  .1 0 1 0  0 0 0 1 ]\n" + HEAD).camera
    back = parse(to_pbrt(replace(world(""), camera=camera))).camera
    np.testing.assert_allclose(back.camera_to_world, camera.camera_to_world, rtol=1e-14, atol=1e-14)


def test_a_window_is_written_to_the_bit() -> None:
    text = HEAD.replace('"float fov"', '"float screenwindow" [ -1.1 .7 -.3 .4 ] "float fov"')
    assert parse(to_pbrt(parse(text))).content_hash() == parse(text).content_hash()


def test_the_values_of_a_template_are_told_in_a_comment() -> None:
    text = to_pbrt(scenes.load("touching-light", {"gap": 1e-5}))
    assert "# with gap = 1e-05, xresolution = 320.0" in text
    assert "1e-05" in text.split("WorldBegin")[1]


def test_a_name_cannot_break_out_of_its_comment_or_string() -> None:
    scene = replace(world(""), name='a"\nShape "cube"', film=Film(8, 6, 'x"\\y\n'))
    assert parse(to_pbrt(scene)).film.filename == 'x"\\y\n'
