"""Image maps in scene files as pbrt-v4 takes them: resized, of numbers, encoded, of other primaries, and read
once.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from scenes.description.materials import Diffuse
from scenes.description.textures import ImageTexture, Mix
from scenes.errors import SceneError
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse_file
from tests.kit.scene_texts import HEAD, TRIANGLE
from tests.scenes.pbrt.directives.test_textures import BYTES, image_of, srgb, texture_of, write_image


def lanczos_rows(rows: np.ndarray, new: int) -> np.ndarray:
    """Rows (n, ...) resized to `new` ones, the first after the last: weights by the definition of pbrt's
    windowed sinc.
    """
    out = []
    for i in range(new):
        centre = (i + 0.5) * len(rows) / new
        near = np.arange(np.floor(centre) - 3, np.floor(centre) + 4)
        x = near + 0.5 - centre
        weight = np.where(np.abs(x) < 2, np.sinc(x) * np.sinc(x / 2), 0)
        out.append(np.tensordot(weight / weight.sum(), rows[near.astype(int) % len(rows)], 1))
    return np.array(out)


def resized_by_definition(image: np.ndarray, height: int, width: int) -> np.ndarray:
    return np.maximum(lanczos_rows(lanczos_rows(image, height).swapaxes(0, 1), width).swapaxes(0, 1), 0)


def test_textures_are_resized_to_powers_of_two_in_the_precision_of_their_file(tmp_path: Path) -> None:
    """Bytes stay bytes of their encoding: the nearest code, which a rounding difference may move by one in
    the rare tie.
    """
    codes = np.random.default_rng(6).integers(0, 256, (3, 5, 3)).astype(np.uint8)
    write_image(tmp_path / "a.png", codes)
    expected = resized_by_definition(np.vectorize(srgb)(codes), 4, 8)
    found = image_of(tmp_path).image
    bytes_ = np.minimum(found, 1) * 12.92
    bytes_ = 255 * np.where(found <= 0.0031308, bytes_, 1.055 * found ** (1 / 2.4) - 0.055)
    wanted = 255 * np.where(
        expected <= 0.0031308, 12.92 * expected, 1.055 * np.minimum(expected, 1) ** (1 / 2.4) - 0.055
    )
    np.testing.assert_allclose(bytes_, np.rint(bytes_), atol=1e-4)
    np.testing.assert_allclose(bytes_, wanted, atol=0.501)
    values = np.random.default_rng(7).uniform(0, 3, (3, 5, 3)).astype(np.float32)
    expected = resized_by_definition(values.astype(float), 4, 8)
    write_image(tmp_path / "a.exr", values, "float")
    np.testing.assert_allclose(image_of(tmp_path, name="a.exr").image, expected, rtol=1e-6, atol=1e-7)
    write_image(tmp_path / "b.exr", values, "half")
    half = resized_by_definition(values.astype(np.float16).astype(float), 4, 8)
    np.testing.assert_array_equal(image_of(tmp_path, name="b.exr").image, half.astype(np.float16))


def test_a_resized_texture_has_borders_as_its_wrap_says(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {name: np.array([[1.0, 0.5, 0.0]]) for name in "RGB"})
    left = {
        wrap: image_of(tmp_path, f'"string wrap" "{wrap}"', "a.exr").image[0, 0, 0]
        for wrap in ("repeat", "clamp", "black")
    }
    # Centre 0.375: weights (normalised) of the texels at -1.5, -.5, .5 and 1.5 by hand, sinc(x) sinc(x/2).
    x = np.array([-1.5, -0.5, 0.5, 1.5]) - 0.375
    weight = np.sinc(x) * np.sinc(x / 2)
    weight /= weight.sum()
    assert left["repeat"] == pytest.approx(weight @ [0.5, 0, 1, 0.5], abs=1e-7)
    assert left["clamp"] == pytest.approx(weight @ [1, 1, 1, 0.5], abs=1e-7)
    assert left["black"] == pytest.approx(weight @ [0, 0, 1, 0.5], abs=1e-7)


def number_of(folder: Path, parameters: str = "", name: str = "a.png") -> np.ndarray:
    number = f'Texture "n" "float" "imagemap" "string filename" "{name}" {parameters} '
    mix = texture_of(number + 'Texture "t" "spectrum" "mix" "texture amount" "n"', folder)
    assert isinstance(mix, Mix)
    assert isinstance(mix.amount, ImageTexture)
    assert np.ptp(mix.amount.image, axis=2).max() == 0
    return mix.amount.image[..., 0]


def test_numbers_of_a_file_of_colours_are_those_that_pbrt_takes(tmp_path: Path) -> None:
    linear = '"string encoding" "linear" '
    alpha = np.array([[[100], [255]]], np.uint8)
    write_image(tmp_path / "a.png", np.concatenate([BYTES, alpha], axis=2))
    np.testing.assert_allclose(number_of(tmp_path, linear)[0], alpha[0, :, 0] / 255, atol=1e-7)
    np.testing.assert_allclose(number_of(tmp_path)[0], [srgb(100), 1], atol=1e-7)  # alpha is decoded too
    np.testing.assert_allclose(
        number_of(tmp_path, linear + '"string filter" "point"')[0], BYTES[0, :, 0] / 255, atol=1e-7
    )
    with pytest.raises(SceneError, match="takes red where it filters and alpha where it does not"):
        number_of(tmp_path, '"string filter" "EWA"')
    write_image(tmp_path / "a.png", np.concatenate([BYTES, np.full((1, 2, 1), 255, np.uint8)], axis=2))
    np.testing.assert_allclose(number_of(tmp_path, linear)[0], BYTES[0].mean(axis=1) / 255, atol=1e-7)
    with pytest.raises(SceneError, match="the mean of red, green and blue"):
        number_of(tmp_path, '"string filter" "ewa"')
    write_image(tmp_path / "a.png", np.repeat(BYTES[..., :1], 3, axis=2))
    np.testing.assert_allclose(
        number_of(tmp_path, linear + '"string filter" "ewa"')[0], BYTES[0, :, 0] / 255, atol=1e-7
    )
    write_image(tmp_path / "a.tga", np.concatenate([BYTES, alpha], axis=2))  # pbrt sees no alpha in these
    mean = np.vectorize(srgb)(BYTES[0]).mean(axis=1)
    np.testing.assert_allclose(number_of(tmp_path, name="a.tga")[0], mean, atol=1e-7)


def test_an_encoding_is_of_no_effect_but_for_png(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {name: np.array([[0.25, 0.75]]) for name in "RGB"})
    write_image(tmp_path / "a.bmp", BYTES)
    for encoding in ("linear", "sRGB", "gamma 2.2"):
        assert image_of(tmp_path, f'"string encoding" "{encoding}"', "a.exr").image[0, :, 0].tolist() == [
            0.25,
            0.75,
        ]
        found = image_of(tmp_path, f'"string encoding" "{encoding}"', "a.bmp").image
        np.testing.assert_allclose(found, np.vectorize(srgb)(BYTES), atol=1e-7)
    with pytest.raises(SceneError, match='unknown encoding "rec709"'):
        image_of(tmp_path, '"string encoding" "rec709"', "a.exr")


def test_images_of_other_primaries_are_reported_at_their_name(tmp_path: Path) -> None:
    spec = oiio.ImageSpec(1, 1, 3, "float")

    def write(*chromaticities: float) -> None:
        spec.attribute("chromaticities", "float[8]", chromaticities)
        output = oiio.ImageOutput.create(str(tmp_path / "a.exr"))
        assert output is not None
        assert output.open(str(tmp_path / "a.exr"), spec)
        assert output.write_image(np.full((1, 1, 3), 0.5, np.float32))
        output.close()

    write(0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.31271, 0.32902)
    assert image_of(tmp_path, name="a.exr").image.tolist() == [[[0.5] * 3]]
    write(0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
    with pytest.raises(
        SceneError, match=r"s\.pbrt:7:35: .*chromaticities is 0\.68 0\.32 .* convert the image to sRGB"
    ):
        image_of(tmp_path, name="a.exr")


def test_a_file_is_read_once_and_counted_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_image(tmp_path / "a.png", np.zeros((3, 5, 3), np.uint8))
    (tmp_path / "b").mkdir()

    def scene(*images: str) -> list[ImageTexture]:
        maps = [f'Texture "t{i}" "spectrum" "imagemap" {image}' for i, image in enumerate(images)]
        uses = [f'Material "diffuse" "texture reflectance" "t{i}" {TRIANGLE}' for i in range(len(images))]
        (tmp_path / "s.pbrt").write_text(HEAD + "\n".join(maps + uses))
        found = [shape.material for shape in parse_file(tmp_path / "s.pbrt").shapes]
        assert all(isinstance(material, Diffuse) for material in found)
        return [material.reflectance for material in found if isinstance(material.reflectance, ImageTexture)]

    name = '"string filename" "a.png"'
    first, again, other, clamped = scene(
        name, ('"string filename" "b/../a.png" "float '
'scale" .5'), name + '"string encoding" "linear"', name + '"string wrap" "clamp"'
    )  # fmt: skip
    assert first.image is again.image
    assert first.image is not other.image
    assert first.image is not clamped.image
    monkeypatch.setattr("scenes.pbrt.directives.texels.TEXELS", 64)  # two of 4 x 8
    scene(name, name, name, name + '"string wrap" "clamp"')
    monkeypatch.setattr("scenes.pbrt.directives.texels.TEXELS", 31)
    monkeypatch.setattr("scenes.images.exr.read_texels", None)  # nothing is decoded of what is too much
    with pytest.raises(
        SceneError, match=r"s\.pbrt:\d+:36: the images of the scene, resized, have more than 31 texels"
    ):
        scene(name)


def test_texture_files_that_are_none_are_named_for_what_they_are(tmp_path: Path) -> None:
    (tmp_path / "a.png").mkdir()
    with pytest.raises(SceneError, match=r"s\.pbrt:7:35: .*a\.png: a folder, not an image file"):
        image_of(tmp_path)
