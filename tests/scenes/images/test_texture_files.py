"""Images of any kind, read as textures: what is decoded, what is alpha, and what is no image."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from scenes.errors import PenumbraError
from scenes.images import exr as images


def write_texture(
    path: Path, values: np.ndarray, kind: str = "uint8", tile: int = 0, **attributes: object
) -> Path:
    spec = oiio.ImageSpec(values.shape[1], values.shape[0], values.shape[2], kind)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    spec.tile_width = spec.tile_height = tile
    for name, value in attributes.items():
        spec.attribute(name, *value) if isinstance(value, tuple) else spec.attribute(name, value)
    output = oiio.ImageOutput.create(str(path))
    assert output is not None and output.open(str(path), spec), oiio.geterror()
    values = np.ascontiguousarray(values)
    assert (
        output.write_tiles(0, values.shape[1], 0, values.shape[0], 0, 1, values)
        if tile
        else output.write_image(values)
    )
    assert output.close()
    return path


@pytest.mark.parametrize("tile", [0, 16, 48])
def test_textures_of_many_blocks_come_back_texel_by_texel(tmp_path: Path, tile: int):
    values = np.random.default_rng(1).random((700, 50, 3)).astype(np.float32)
    path = write_texture(tmp_path / "x.exr", values, "float", tile)
    np.testing.assert_array_equal(images.read_texture(path), values)


@pytest.mark.parametrize(
    ("name", "kind", "bits"), [("x.png", "uint8", 8), ("x.tif", "uint16", 16), ("x.bmp", "uint8", 8)]
)
def test_whole_numbers_are_decoded_to_float32(tmp_path: Path, name: str, kind: str, bits: int):
    values = np.random.default_rng(2).integers(0, 2**bits, (300, 5, 3)).astype(kind)
    code = values / (2**bits - 1)
    want = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    np.testing.assert_array_equal(
        images.read_texture(write_texture(tmp_path / name, values, kind)), want.astype(np.float32)
    )


def test_a_png_of_16_bits_is_kept_in_half_floats_as_pbrt_keeps_it(tmp_path: Path):
    values = np.random.default_rng(3).integers(0, 2**16, (4, 4, 3)).astype(np.uint16)
    read = images.read_texture(write_texture(tmp_path / "x.png", values, "uint16"), "linear")
    np.testing.assert_array_equal(read, (values / 65535).astype(np.float16))


def test_alpha_is_read_where_pbrt_sees_it(tmp_path: Path):
    values = np.random.default_rng(4).integers(0, 255, (3, 2, 4)).astype(np.uint8)
    for name, planes in (("x.png", 4), ("x.tga", 3)):
        header = images.texture_header(write_texture(tmp_path / name, values))
        assert images.read_texels(header, "linear").shape == (3, 2, planes)
    alpha = images.read_texels(images.texture_header(tmp_path / "x.png"), "linear")[..., 3]
    np.testing.assert_array_equal(alpha, (values[..., 3] / 255).astype(np.float32))


def test_what_is_no_file_is_said_to_be_what_it_is(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe.png")
    for read in (images.read_texture, images.read_exr):
        with pytest.raises(PenumbraError, match="a folder, not an image file"):
            read(tmp_path)
        with pytest.raises(PenumbraError, match="a pipe or a device, not an image file"):
            read(tmp_path / "pipe.png")
        with pytest.raises(PenumbraError, match="no such image file"):
            read(tmp_path / "gone.png")


def test_the_texels_of_an_exr_are_those_of_its_data_window(tmp_path: Path):
    values = np.random.default_rng(8).random((300, 4, 3)).astype(np.float32)
    spec = oiio.ImageSpec(4, 300, 3, "float")
    spec.x, spec.y, spec.full_width, spec.full_height = 7, -20, 64, 512
    output = oiio.ImageOutput.create(str(tmp_path / "x.exr"))
    assert output is not None and output.open(str(tmp_path / "x.exr"), spec)
    assert output.write_image(values) and output.close()
    np.testing.assert_array_equal(images.read_texture(tmp_path / "x.exr"), values)
