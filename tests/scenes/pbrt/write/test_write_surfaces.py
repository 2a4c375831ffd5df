"""Lights, materials, textures and filters written as pbrt-v4 text, with their images beside it, read back as
the very same bits.
"""

from __future__ import annotations

import re
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest
import skimage.io
from numpy.typing import NDArray

from scenes.description.lights import DistantLight, Environment, Light, PointLight, SpotLight
from scenes.description.materials import (
    Coated,
    Conductor,
    Dielectric,
    Diffuse,
    DiffuseTransmission,
    Material,
    MixedMaterial,
)
from scenes.description.scene import Film, PixelFilter, RenderDefaults, SceneDescription
from scenes.description.shapes import BilinearMesh, Disk, Emission, ShapeDescription, Sphere, TriangleMesh
from scenes.description.textures import Checkerboard, ImageTexture, Mix, Product, Texture, UVMapping
from scenes.errors import PenumbraError
from scenes.pbrt.parser import parse, parse_file
from scenes.pbrt.transforms import unit
from scenes.pbrt.write.scene import export, to_pbrt
from tests.kit.exported import written
from tests.kit.scene_texts import HEAD, TRIANGLE, world
from tests.scenes.pbrt.write.test_write import Random

Array = NDArray[np.float64]


class Rich(Random):
    """Descriptions of everything that is not in `Random`; images hold float32, as those of EXR files do."""

    def image(self, gray: bool = False, square: bool = False, powers: bool = False) -> Array:
        height, width = (
            2 ** self.rng.integers(0, 3, 2) if powers else self.rng.integers(1, 6, 2)
        )  # others are resized
        image = (
            self.rng.random((height, height if square else width, 1 if gray else 3))
            .astype(np.float32)
            .astype(np.float64)
        )
        return np.repeat(image, 3, axis=2) if gray else image

    def mapping(self) -> UVMapping:
        return UVMapping(*self.rng.normal(size=4).tolist()) if self.flag() else UVMapping()

    def constant(self, gray: bool) -> Array:
        return np.full(3, self.rng.random()) if gray else self.rng.random(3)

    def texture(self, gray: bool = False, depth: int = 3) -> Texture:
        match int(self.rng.integers(5)) if depth else 0:
            case 0:
                wrap = ("repeat", "black", "clamp")[self.rng.integers(3)]
                look = "point" if self.flag() else "bilinear"
                scale = self.positive() if self.flag() else 1.0
                image = self.image(gray, powers=True)
                return ImageTexture(image, self.mapping(), wrap, look, scale, self.flag(), clamped=not gray)
            case 1:
                return Checkerboard(self.part(gray, depth), self.part(gray, depth), self.mapping())
            case 2:
                first, second = self.texture(gray, depth - 1), self.part(True, depth)
                if isinstance(first, ImageTexture) and isinstance(
                    second, np.ndarray
                ):  # read as the image's own scale
                    return replace(first, scale=first.scale * float(second[0]))
                return Product(first, second)
            case _:
                return Mix(self.part(gray, depth), self.texture(gray, depth - 1), self.part(True, depth))

    def part(self, gray: bool, depth: int) -> Texture:
        return self.constant(gray) if self.flag() else self.texture(gray, depth - 1)

    def frame(self) -> Array:
        left, _, right = np.linalg.svd(self.rng.normal(size=(3, 3)))
        return np.stack([unit(axis) for axis in (left @ right).T], axis=1) + 0.0

    def light(self) -> Light:
        match self.rng.integers(3):
            case 0:
                return PointLight(self.vector(), self.rng.random(3) * self.positive())
            case 1:
                cone, delta = float(self.rng.uniform(1, 180)), float(self.rng.random())
                return SpotLight(
                    self.vector(), self.direction(), self.rng.random(3), cone, cone - cone * delta
                )
            case _:
                return DistantLight(self.direction(), self.rng.random(3))

    def environment(self) -> Environment:
        radiance = np.full(3, self.positive())
        match self.rng.integers(4):
            case 0:
                return Environment(radiance * self.rng.random(3))
            case 1:
                return Environment(radiance * self.rng.random(3), frame=self.frame(), hemisphere=True)
            case 2:
                return Environment(radiance, self.image(square=True), "equal-area", self.frame(), self.flag())
            case _:
                return Environment(radiance, self.image(), "latitude-longitude", self.frame(), self.flag())

    def material(self) -> Material:
        base = self.base()
        if self.flag():
            return base
        if self.flag():
            return DiffuseTransmission(self.texture(), self.constant(gray=False), self.positive())
        if self.flag():
            return MixedMaterial(self.base(), self.material(), self.part(True, 2))
        alpha, across = self.alphas()
        coat = Dielectric(self.positive(), alpha, alpha_v=across)
        albedo, depth = self.rng.random(3), int(self.rng.integers(40))
        return Coated(coat, base, self.positive(), albedo, float(self.rng.uniform(-1, 1)), depth, 1 + depth)

    def base(self) -> Diffuse | Conductor:
        if self.flag():
            return Diffuse(self.texture())
        alpha, across = self.alphas()
        return Conductor(self.rng.random(3) + 0.01, self.rng.random(3), alpha, across)

    def alphas(self) -> tuple[float, float | None]:
        across = float(self.rng.uniform(1e-3, 2)) if self.flag() else None
        return float(self.rng.uniform(1e-3, 2)), across

    def shape(self) -> ShapeDescription:
        material = self.material()
        textured = material.needs_uv
        frame = self.frame()
        match self.rng.integers(4):
            case 0:
                mesh = self.mesh()
                alpha = self.texture(gray=True) if self.flag() else None
                textured = textured or (alpha is not None and not isinstance(alpha, np.ndarray))
                uv = self.rng.random((len(mesh.vertices), 2)) if textured else None
                return ShapeDescription(replace(mesh, uv=uv), material, alpha=alpha)
            case 1:
                patch = self.patch()
                image = self.image() if self.flag() else None
                light = Emission(np.full(3, self.positive()), self.flag(), image)
                uv = self.rng.random((4, 2)) if image is None and textured else None
                return ShapeDescription(
                    BilinearMesh(patch.vertices, patch.faces, patch.reverse, uv), material, light
                )
            case 2:
                return ShapeDescription(
                    Sphere(self.vector(), self.positive(), self.flag(), frame if textured else None), material
                )
            case _:
                normal = frame[:, 2] if self.flag() else -frame[:, 2] + 0.0
                return ShapeDescription(
                    Disk(self.vector(), normal, self.positive(), frame if textured else None), material
                )

    def scene(self) -> SceneDescription:
        kind = ("box", "triangle", "gaussian")[self.rng.integers(3)]
        sigma = float(self.rng.uniform(0.1, 3)) if kind == "gaussian" else 0.5
        chosen = PixelFilter(kind, *self.rng.uniform(0.1, 9, 2).tolist(), sigma)
        lights = [self.light() for _ in range(self.rng.integers(4))] + [self.environment()] * int(self.flag())
        # without light sampling pbrt would lose lights that no direction finds: there is no text for that
        plain = 2 if any(not isinstance(light, Environment) for light in lights) else 4
        estimator = (None, "ambient-occlusion", "bsdf", "hemisphere")[self.rng.integers(plain)]
        sampler = ("independent", "sobol", "stratified")[self.rng.integers(3)]
        return replace(
            super().scene(),
            film=Film(8, 6, pixel_filter=chosen),
            shapes=tuple(self.shape() for _ in range(3)),
            lights=tuple(lights),
            occlusion_distance=self.positive() if estimator == "ambient-occlusion" else np.inf,
            defaults=RenderDefaults(sampler, int(self.rng.integers(1, 2**10)), 3, estimator),
        )


def test_images_of_bytes_read_back_bitwise(tmp_path: Path) -> None:
    """sRGB decodes to numbers that no float32 is; they are rounded where they are read."""
    pixels = np.arange(48, dtype=np.uint8).reshape(4, 4, 3) * 5
    skimage.io.imsave(tmp_path / "bytes.png", pixels)
    look = '"string filename" "bytes.png" "float scale" 0.3 "bool invert" true'
    (tmp_path / "from.pbrt").write_text(
        HEAD
        + f'LightSource "infinite" "rgb L" [ .1 .7 .3 ] LightSource "infinite" "string filename" "bytes.png"\n'  # noqa: E501
        f'Texture "n" "float" "imagemap" {look} Texture "c" "spectrum" "imagemap" {look}\n'
        f'Texture "t" "spectrum" "mix" "texture tex1" "c" "texture amount" "n" Material "diffuse" "texture reflectance" "t"\n'  # noqa: E501
         + TRIANGLE
    )
    scene = parse_file(tmp_path / "from.pbrt")
    assert parse_file(written(scene, tmp_path)).content_hash() == scene.content_hash()


def test_a_product_that_pbrt_would_make_one_image_of_is_written_as_a_mix(tmp_path: Path) -> None:
    """Of black and the image; as a "scale" it would be read as 1 - 0.25 where it is (1 - 0.5) / 2."""
    image = ImageTexture(np.full((2, 2, 3), 0.5), invert=True)
    texture = Product(image, np.full(3, 0.5))
    sphere = ShapeDescription(Sphere(np.zeros(3), 1.0, frame=np.eye(3)), Diffuse(texture))
    (shape,) = parse_file(written(replace(world(""), shapes=(sphere,)), tmp_path)).shapes
    assert isinstance(shape.material, Diffuse)
    read = shape.material.reflectance
    assert isinstance(read, Mix)
    assert isinstance(read.second, ImageTexture)
    np.testing.assert_array_equal(read.second.value(read.second.image) * read.amount, 0.25)


@pytest.mark.parametrize("seed", range(30))
def test_any_description_reads_back_bitwise(seed: int, tmp_path: Path) -> None:
    scene = Rich(seed).scene()
    back = parse_file(written(scene, tmp_path))
    for mine, theirs in zip((*scene.lights, *scene.shapes), (*back.lights, *back.shapes), strict=True):
        assert hash_of(mine) == hash_of(theirs), (mine, theirs)
    assert back.content_hash() == scene.content_hash()
    assert astuple(back.defaults) == astuple(scene.defaults)


def hash_of(part: Light | ShapeDescription) -> str:
    """As the whole scene's, so that a difference is found where it is."""
    empty = world("")
    if isinstance(part, ShapeDescription):
        return replace(empty, shapes=(part,)).content_hash()
    return replace(empty, lights=(part,)).content_hash()


def test_a_texture_used_twice_is_written_once(tmp_path: Path) -> None:
    texture = ImageTexture(np.full((2, 2, 3), 0.25))
    shapes = tuple(
        ShapeDescription(
            Sphere(np.zeros(3), 1.0, frame=np.eye(3)), Diffuse(Mix(np.ones(3), texture, np.full(3, t)))
        )
        for t in (0.25, 0.5)
    )
    exported = export(replace(world(""), shapes=shapes), "a name")
    assert list(exported.images) == ["a name-1.exr"]
    assert exported.text.count("imagemap") == 1 and exported.text.count('"mix"') == 2


def test_what_is_ours_and_not_pbrts_is_said() -> None:
    scene = replace(world(""), lights=(Environment(np.ones(3), hemisphere=True),))
    exported = export(scene, "scene")
    assert "pbrt-v4 itself will refuse" in exported.notes[0]
    assert re.search(r"^# pbrt-v4 itself will refuse", exported.text, re.MULTILINE)
    assert re.search(r'^ *# not pbrt-v4\'s.*\n.*\n.*"bool hemisphere"', exported.text, re.MULTILINE)
    plain = export(replace(world(""), lights=(Environment(np.ones(3)),)), "scene")
    assert plain.notes == () and "hemisphere" not in plain.text


def test_images_need_files_and_rounding_is_said() -> None:
    lit = replace(world(""), lights=(Environment(np.ones(3), np.full((2, 2, 3), 0.1)),))
    assert export(lit, "scene").notes == ("images are rounded to float32",)
    with pytest.raises(PenumbraError, match="give an output file"):
        to_pbrt(lit)
    exact = replace(world(""), lights=(Environment(np.ones(3), np.full((2, 2, 3), 0.125)),))
    assert export(exact, "scene").notes == ()


def test_a_colour_over_an_image_goes_into_the_image(tmp_path: Path) -> None:
    """pbrt scales images by a number; the light is the same, the description is not."""
    colour, image = np.array([1.0, 2.0, 4.0]), np.full((2, 2, 3), 0.5)
    back = parse_file(written(replace(world(""), lights=(Environment(colour, image),)), tmp_path)).lights[0]
    assert isinstance(back, Environment) and back.image is not None
    np.testing.assert_array_equal(back.image * back.radiance, image * colour)


@pytest.mark.parametrize(
    "texture",
    [
        Product(ImageTexture(np.ones((2, 2, 3))), np.array([1.0, 0.5, 0.2])),
        Mix(np.ones(3), np.zeros(3), ImageTexture(np.array([[[0.1, 0.2, 0.3]]]))),
    ],
)
def test_colours_that_multiply_or_mix_have_no_text(texture: Texture) -> None:
    shape = ShapeDescription(TriangleMesh(np.eye(3), np.array([[0, 1, 2]])), Diffuse(texture))
    with pytest.raises(PenumbraError, match="by numbers"):
        export(replace(world(""), shapes=(shape,)), "scene")


def test_an_occlusion_distance_without_ambient_occlusion_is_said_to_be_lost() -> None:
    exported = export(replace(world(""), occlusion_distance=2.0), "scene")
    assert "occlusion distance, 2, is left out" in exported.notes[0]
    assert parse(exported.text).occlusion_distance == np.inf
