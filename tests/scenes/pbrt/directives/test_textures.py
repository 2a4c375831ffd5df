"""`Texture`: every kind, its defaults, images and their encodings, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from scenes.description.materials import Diffuse
from scenes.description.shapes import Disk, Sphere, TriangleMesh
from scenes.description.textures import Checkerboard, ImageTexture, Mix, Product, Texture
from scenes.errors import SceneError
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse_file
from tests.kit.scene_texts import HEAD, TRIANGLE, world, world_fails

USE = 'Material "diffuse" "texture reflectance" "t" '
CHECKS = 'Texture "c" "spectrum" "checkerboard" '


def texture_of(body: str, folder: Path | None = None) -> Texture:
    """The texture "t" of `body`, as the reflectance of a shape."""
    text = body + "\n" + USE + TRIANGLE
    if folder is None:
        scene = world(text)
    else:
        (folder / "s.pbrt").write_text(HEAD + text)
        scene = parse_file(folder / "s.pbrt")
    material = scene.shapes[0].material
    assert isinstance(material, Diffuse)
    return material.reflectance


def constant(body: str) -> list[float]:
    texture = texture_of(body)
    assert isinstance(texture, np.ndarray)
    return texture.tolist()


@pytest.mark.parametrize(
    ("body", "value"),
    [
        ('Texture "t" "spectrum" "constant"', [1, 1, 1]),
        ('Texture "t" "spectrum" "constant" "rgb value" [ .1 .2 .3 ]', [0.1, 0.2, 0.3]),
        ('Texture "t" "spectrum" "scale"', [1, 1, 1]),
        ('Texture "t" "spectrum" "scale" "rgb tex" [ .2 .4 1 ] "float scale" .5', [0.1, 0.2, 0.5]),
        # clamped, as in pbrt
        ('Texture "t" "spectrum" "scale" "rgb tex" [ .2 .4 1 ] "float scale" 3', [pytest.approx(0.6), 1, 1]),
        ('Texture "t" "spectrum" "mix"', [0.5, 0.5, 0.5]),
        (('Texture "t" "spectrum" "mix" "rgb tex1" [ 1 0 0 ] "rgb tex2" [ 0 1 0 ] "float '
'amount" .25'), [0.75, 0.25, 0]),
        (('Texture "a" "float" "constant" "float value" .25 Texture "t" "spectrum" "mix" "texture '
'amount" "a"'), [0.25] * 3),
        # apart
        ('Texture "t" "float" "constant" Texture "t" "spectrum" "constant" "rgb value" [ 0 0 0 ]', [0, 0, 0]),
        ('Attribute "texture" "rgb value" [ 0 1 0 ] Texture "t" "spectrum" "constant"', [0, 1, 0]),
    ],
)  # fmt: skip
def test_constants(body: str, value: list[float]) -> None:
    assert constant(body) == value


def test_a_checkerboard() -> None:
    checks = texture_of('Texture "t" "spectrum" "checkerboard"')
    assert isinstance(checks, Checkerboard)
    assert isinstance(checks.first, np.ndarray)
    assert isinstance(checks.second, np.ndarray)
    assert (checks.first.tolist(), checks.second.tolist()) == ([1, 1, 1], [0, 0, 0])
    mapping = '"float uscale" 4 "float vscale" 3 "float udelta" .5 "float vdelta" .25 "string mapping" "uv"'
    checks = texture_of(
        f'Texture "t" "spectrum" "checkerboard" {mapping} "rgb tex2" [ .1 .2 .3 ] "integer dimension" 2'
    )
    assert isinstance(checks, Checkerboard)
    assert isinstance(checks.second, np.ndarray)
    assert checks.second.tolist() == [0.1, 0.2, 0.3]
    assert (checks.mapping.su, checks.mapping.sv, checks.mapping.du, checks.mapping.dv) == (4, 3, 0.5, 0.25)


def test_textures_of_textures() -> None:
    product = texture_of(CHECKS + 'Texture "t" "spectrum" "scale" "texture tex" "c" "float scale" .5')
    assert isinstance(product, Product)
    assert isinstance(product.first, Checkerboard)
    assert isinstance(product.second, np.ndarray)
    assert product.second.tolist() == [0.5, 0.5, 0.5]
    amount = 'Texture "n" "float" "checkerboard" "float tex1" .25 '
    mix = texture_of(amount + 'Texture "t" "spectrum" "mix" "rgb tex1" [ 1 0 0 ] "texture amount" "n"')
    assert isinstance(mix, Mix)
    assert isinstance(mix.amount, Checkerboard)
    assert isinstance(mix.amount.first, np.ndarray)
    assert mix.amount.first.tolist() == [0.25, 0.25, 0.25]


def test_a_material_finds_its_texture_also_when_made_later() -> None:
    material = world(USE + TRIANGLE + ' Texture "t" "spectrum" "checkerboard"').shapes[0].material
    assert isinstance(material, Diffuse)
    assert isinstance(material.reflectance, Checkerboard)


UV = ' "point2 uv" [ 0 0 .5 0 0 .25 ]'


def test_texture_coordinates_are_kept_where_a_texture_looks_at_them_and_only_there() -> None:
    texture = 'Texture "t" "spectrum" "checkerboard" '
    (plain,) = world(TRIANGLE + UV).shapes
    (textured,) = world(texture + USE + TRIANGLE + UV).shapes
    assert isinstance(plain.geometry, TriangleMesh)
    assert isinstance(textured.geometry, TriangleMesh)
    assert plain.geometry.uv is None
    assert textured.geometry.uv is not None
    assert textured.geometry.uv.tolist() == [[0, 0], [0.5, 0], [0, 0.25]]
    assert world(TRIANGLE + UV).content_hash() == world(TRIANGLE).content_hash()


def test_quadrics_with_textures_know_their_axes() -> None:
    body = 'Texture "t" "spectrum" "checkerboard" ' + USE
    (sphere,) = world(body + 'Rotate 90 1 0 0 Scale -2 2 2 Shape "sphere"').shapes
    assert isinstance(sphere.geometry, Sphere)
    assert sphere.geometry.frame is not None
    np.testing.assert_allclose(sphere.geometry.frame, [[-1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)
    (disk,) = world(body + 'ReverseOrientation Rotate 90 1 0 0 Scale 2 2 5 Shape "disk"').shapes
    assert isinstance(disk.geometry, Disk)
    assert disk.geometry.frame is not None
    np.testing.assert_allclose(disk.geometry.frame, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)
    assert disk.geometry.normal.tolist() == [0, 1, 0]  # turned; the axes are the object's
    (plain,) = world('Rotate 90 1 0 0 Shape "sphere"').shapes
    assert isinstance(plain.geometry, Sphere)
    assert plain.geometry.frame is None


def write_image(path: Path, values: np.ndarray, kind: str = "uint8") -> None:
    spec = oiio.ImageSpec(values.shape[1], values.shape[0], values.shape[2], kind)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    output = oiio.ImageOutput.create(str(path))
    assert output is not None
    assert output.open(str(path), spec)
    assert output.write_image(np.ascontiguousarray(values))
    output.close()


BYTES = np.array([[[0, 10, 255], [128, 64, 32]]], dtype=np.uint8)


def srgb(byte: float) -> float:
    """IEC 61966-2-1's decoding, written out anew."""
    value = byte / 255
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def image_of(folder: Path, parameters: str = "", name: str = "a.png") -> ImageTexture:
    texture = texture_of(f'Texture "t" "spectrum" "imagemap" "string filename" "{name}" {parameters}', folder)
    assert isinstance(texture, ImageTexture)
    return texture


def values(texture: ImageTexture) -> list[list[list[float]]]:
    return texture.value(texture.image).tolist()


@pytest.mark.parametrize("name", ["a.png", "a.tga", "a.bmp"])
def test_bytes_are_srgb(tmp_path: Path, name: str) -> None:
    write_image(tmp_path / name, BYTES)
    texture = image_of(tmp_path, name=name)
    expected = [[[srgb(b) for b in pixel] for pixel in row] for row in BYTES.tolist()]
    np.testing.assert_allclose(texture.image, expected, atol=1e-7)
    assert (texture.wrap, texture.filter) == ("repeat", "bilinear")


def test_encodings_of_png(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", BYTES)
    np.testing.assert_allclose(image_of(tmp_path, '"string encoding" "linear"').image, BYTES / 255, atol=1e-7)
    np.testing.assert_allclose(
        image_of(tmp_path, '"string encoding" "gamma 2"').image, (BYTES / 255) ** 2, atol=1e-7
    )
    with pytest.raises(SceneError, match='unknown encoding "rec709"'):
        image_of(tmp_path, '"string encoding" "rec709"')


def test_floats_are_linear_and_bounded_like_a_reflectance(tmp_path: Path) -> None:
    pixels = np.array([[[0.25, 0.5, 2.0]], [[0.125, 0, -1]]])
    write_exr(tmp_path / "a.exr", dict(zip("RGB", np.moveaxis(pixels, -1, 0), strict=True)))
    seen = [[[0.25, 0.5, 1]], [[0.125, 0, 0]]]
    assert values(image_of(tmp_path, name="a.exr")) == seen
    (tmp_path / "b.pfm").write_bytes(
        b"PF\n1 2\n-1.0\n" + pixels[::-1].astype("<f4").tobytes()
    )  # PFM goes bottom up
    assert values(image_of(tmp_path, name="b.pfm")) == seen


def test_scale_and_inversion_as_pbrt_orders_them(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {name: np.array([[0.25, 0.75]]) for name in "RGB"})
    texture = image_of(
        tmp_path, '"float scale" 2 "bool invert" true "string wrap" "clamp" "string filter" "point"', "a.exr"
    )
    assert values(texture)[0] == [[0.5] * 3, [0] * 3]
    assert (texture.wrap, texture.filter) == ("clamp", "point")
    for filter_ in ("trilinear", "ewa", "EWA"):
        assert (
            image_of(tmp_path, f'"string filter" "{filter_}" "float maxanisotropy" 4', "a.exr").filter
            == "bilinear"
        )


def test_alpha_is_left_out_and_not_multiplied_in(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", np.concatenate([BYTES, np.full((1, 2, 1), 100, np.uint8)], axis=2))
    assert image_of(tmp_path).image[0, 0, 2] == pytest.approx(1)


def test_gray_images_and_images_of_numbers(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", BYTES[..., :1])
    gray = image_of(tmp_path).image
    assert gray[0, 1].tolist() == [pytest.approx(srgb(128))] * 3
    write_image(tmp_path / "a.png", BYTES)
    number = 'Texture "n" "float" "imagemap" "string filename" "a.png" "string encoding" "linear" '
    mix = texture_of(number + 'Texture "t" "spectrum" "mix" "texture amount" "n"', tmp_path)
    assert isinstance(mix, Mix)
    assert isinstance(mix.amount, ImageTexture)
    np.testing.assert_allclose(mix.amount.image[0, 0], [265 / 3 / 255] * 3, atol=1e-7)


@pytest.mark.parametrize(
    ("body", "column", "words"),
    [
        ('Texture "t" "spectrum" "clouds"', 1, ('Texture "clouds"', '"checkerboard"')),
        ('Texture "t" "spectrum" "fbm"', 1, ('is of type "float"',)),
        ('Texture "t" "float" "marble"', 1, ('is of type "spectrum"',)),
        ('Texture "t" "float" "fbm" "integer octaves" -1', 27, ("between 0 and 64",)),
        ('Texture "t" "float" "directionmix" "vector3 dir" [ 0 0 0 ]', 36, ("zero vector",)),
        ('Texture "t" "float" "ptex" "string filename" "a.ptx"', 1, ('Texture "ptex"', "substitute")),
        ('Texture "t" "color" "constant"', 1, ('"float" or "spectrum"', '"color"')),
        ('Texture "t" "spectrum"', 1, ("quoted string",)),
        ('Texture "t" "float" "constant" Texture "t" "float" "scale"', 32, ("made twice",)),
        ('Texture "t" "spectrum" "constant" "rgb value" [ 2 0 0 ]', 35, ("at most 1",)),
        ('Texture "t" "spectrum" "constant" "float value" 1', 35, ('"rgb value"',)),
        ('Texture "t" "spectrum" "scale" "texture tex" "gone"', 32, ("texture is called 'gone'", "none")),
        # a texture inside itself is not there yet
        ('Texture "t" "float" "scale" "texture scale" "t"', 29, ("'t'",)),
        ('Texture "t" "spectrum" "checkerboard" "integer dimension" 4', 39, ("dimension 2 or 3",)),
        ('Texture "t" "spectrum" "checkerboard" "string mapping" "cube"', 39, ('"cube"', "uv")),
        ('Texture "t" "spectrum" "imagemap"', 1, ('"string filename"',)),
        ('Texture "t" "spectrum" "imagemap" "string filename" "gone.png"', 35, ("gone.png", "no such image")),
        ('Texture "t" "spectrum" "imagemap" "string filter" "sharp"', 35, ("sharp", "bilinear")),
        (USE + 'Shape "sphere"', 20, ("no spectrum texture is called 't'",)),
        ('Texture "t" "float" "constant" ' + USE + 'Shape "sphere"', 51, (("no spectrum texture is "
"called 't'"),)),
    ],
)  # fmt: skip
def test_textures_that_cannot_be_are_refused_where_they_stand(
    body: str, column: int, words: tuple[str, ...]
) -> None:
    world_fails(body, 1, column, *words)


def test_an_octahedron_of_texels_is_square(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", BYTES)
    with pytest.raises(SceneError, match=r"octahedralsphere.*square"):
        image_of(tmp_path, '"string wrap" "octahedralsphere"')


def test_images_that_are_none_are_refused_at_their_name(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"\x89PNG nonsense")
    with pytest.raises(SceneError, match=r"s\.pbrt:7:35: .*a\.png"):
        image_of(tmp_path)
    write_exr(tmp_path / "a.exr", {"R": np.zeros((1, 1)), "Z": np.zeros((1, 1))})
    with pytest.raises(SceneError, match="neither R, G and B nor one channel"):
        image_of(tmp_path, name="a.exr")
    write_exr(tmp_path / "a.exr", {name: np.full((1, 1), np.nan) for name in "RGB"})
    with pytest.raises(SceneError, match="not finite"):
        image_of(tmp_path, name="a.exr")


def test_names_that_double_each_other_stop_before_they_fill_the_memory() -> None:
    lines = [CHECKS]
    for i in range(40):
        inner = "c" if i == 0 else f"c{i - 1}"
        lines.append(f'Texture "c{i}" "spectrum" "mix" "texture tex1" "{inner}" "texture tex2" "{inner}"')
    with pytest.raises(SceneError, match="made of more than 200 others"):
        world("\n".join(lines))
