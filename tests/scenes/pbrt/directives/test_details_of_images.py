"""Details of image maps: sums beyond what a file can hold, words that are of no effect, one file read two
ways, and negative texels.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.description.textures import ImageTexture, Mix
from scenes.images.exr import write_exr
from tests.scenes.pbrt.directives.test_textures import image_of, srgb, texture_of, write_image

MOST_HALF = 65504.0  # IEEE 754: (2 - 2**-10) 2**15


@pytest.mark.parametrize("wrap", ["repeat", "clamp"])
@pytest.mark.parametrize("encoding", ["sRGB", "linear", "gamma 2.2"])
def test_a_resized_image_of_bytes_is_at_most_white(tmp_path: Path, encoding: str, wrap: str) -> None:
    """Beside black, the filter's negative lobes make more than white of white: 1.06 and 1.09 here, codes
    beyond the last.
    """
    write_image(
        tmp_path / "a.png", np.array([[255] * 3, [255, 255, 0], [255] * 3], np.uint8)[..., None].repeat(3, 2)
    )
    image = image_of(tmp_path, f'"string encoding" "{encoding}" "string wrap" "{wrap}"').image
    assert image.shape == (4, 4, 3)
    assert image.max() == 1
    assert image.min() < 1


def test_a_resized_image_of_halves_is_finite(tmp_path: Path) -> None:
    """The same sums of the largest half there is."""
    values = np.array([[MOST_HALF, MOST_HALF, 0.0]], np.float32)[..., None].repeat(3, 2)
    write_image(tmp_path / "a.exr", values, "half")
    for wrap in ("repeat", "clamp"):
        image = image_of(tmp_path, f'"string wrap" "{wrap}"', "a.exr").image
        assert image.shape == (1, 4, 3)
        assert np.isfinite(image).all()
        assert image.max() == MOST_HALF


def test_an_encoding_is_of_no_effect_on_how_other_files_than_png_are_rounded(tmp_path: Path) -> None:
    """Resized to 4 x 4, a BMP's texels are bytes of sRGB again, whatever the word: in linear bytes the dark
    ones would be off.
    """
    codes = np.random.default_rng(8).integers(0, 60, (3, 3, 3)).astype(np.uint8)
    write_image(tmp_path / "a.bmp", codes)
    said = image_of(tmp_path, '"string encoding" "linear"', "a.bmp").image
    np.testing.assert_array_equal(said, image_of(tmp_path, '"string encoding" "sRGB"', "a.bmp").image)
    nearest = np.abs(said[..., None] - np.array([srgb(byte) for byte in range(256)])).min(axis=-1)
    assert nearest.max() < 1e-7
    assert len(np.unique(said)) > 3


def numbers_by_filter(folder: Path, name: str, *filters: str) -> list[np.ndarray]:
    """The texels of one file as textures of numbers with these filters, all in one scene."""
    textures = [
        f'Texture "n{i}" "float" "imagemap" "string filename" "{name}" "string filter" "{filter_}" '
        for i, filter_ in enumerate(filters)
    ]
    mixes = 'Texture "m0" "spectrum" "mix" "texture amount" "n0" '
    for i in range(1, len(filters)):
        mixes += f'Texture "m{i}" "spectrum" "mix" "texture tex1" "m{i - 1}" "texture amount" "n{i}" '
    found = texture_of(
        "".join(textures) + mixes + f'Texture "t" "spectrum" "mix" "texture tex1" "m{len(filters) - 1}"',
        folder,
    )
    assert isinstance(found, Mix)
    images: list[np.ndarray] = []
    for _ in filters:
        found = found.first
        assert isinstance(found, Mix)
        assert isinstance(found.amount, ImageTexture)
        images.insert(0, found.amount.image)
    return images


@pytest.mark.parametrize("filters", [("point", "bilinear"), ("bilinear", "point")])
def test_numbers_of_one_file_by_two_filters_are_two_images(tmp_path: Path, filters: tuple[str, str]) -> None:
    """Red for "point", the mean for "bilinear", whichever was read first."""
    write_exr(
        tmp_path / "a.exr",
        {"R": np.full((1, 2), 0.75), "G": np.full((1, 2), 0.5), "B": np.full((1, 2), 0.125)},
    )
    expected = {"point": 0.75, "bilinear": np.float32(1.375 / 3)}
    for filter_, image in zip(filters, numbers_by_filter(tmp_path, "a.exr", *filters), strict=True):
        np.testing.assert_allclose(image, np.full((1, 2, 3), expected[filter_]), rtol=1e-7)


def test_negative_texels_are_black(tmp_path: Path) -> None:
    """Also where the image is not resized, which would cut them off: as environments and lights take them,
    and as a mean does.
    """
    plane = np.array([[0.5, -1.0], [-1.0, 0.25]])
    write_exr(tmp_path / "a.exr", dict.fromkeys("RGB", plane))
    expected = [[0.5, 0], [0, 0.25]]
    assert image_of(tmp_path, name="a.exr").image[..., 0].tolist() == expected
    for image in numbers_by_filter(tmp_path, "a.exr", "point", "bilinear"):
        assert image[..., 2].tolist() == expected
