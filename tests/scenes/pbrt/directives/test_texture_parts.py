"""`Texture`s that stand on others: what `Attribute` says to them, names that come later, constant factors of
images.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from renderer.textures import evaluate
from scenes.description.textures import Checkerboard, ImageTexture, Mix, Product
from scenes.images.exr import write_exr
from tests.kit.scene_texts import world_fails
from tests.kit.scenes import places
from tests.scenes.pbrt.directives.test_textures import BYTES, constant, texture_of, write_image


def test_attributes_of_one_name_and_several_types() -> None:
    said = 'Attribute "texture" "rgb value" [ .2 .4 .6 ] "float value" .5 '
    assert constant(said + 'Texture "t" "spectrum" "constant"') == [0.2, 0.4, 0.6]
    mix = 'Texture "t" "spectrum" "mix" "rgb tex1" [ 0 0 0 ] "rgb tex2" [ 1 1 1 ] "texture amount" "n"'
    assert constant(said + 'Texture "n" "float" "constant" ' + mix) == [0.5] * 3
    # a type that nobody asks for is meant for others
    assert constant('Attribute "texture" "rgb value" [ 0 0 0 ] Texture "n" "float" "constant" ' + mix) == [
        1,
        1,
        1,
    ]


def test_names_that_come_later_in_pbrts_order(tmp_path: Path) -> None:
    """Images are made first, then numbers, then colours, whatever the order in the file."""
    write_image(tmp_path / "a.png", BYTES)
    image = 'Texture "i" "spectrum" "imagemap" "string filename" "a.png"'
    late = (
        'Texture "t" "spectrum" "scale" "texture tex" "i" "texture scale" "n" Texture "n" "float" '
        f'"checkerboard" {image}'
    )
    product = texture_of(late, tmp_path)
    assert isinstance(product, Product)
    assert isinstance(product.first, ImageTexture)
    assert isinstance(product.second, Checkerboard)
    world_fails('Texture "t" "float" "scale" "texture tex" "n" Texture "n" "float" "constant"', 1, 29, "'n'")


@pytest.mark.parametrize(
    ("factor", "value"),
    [
        ('"constant" "float value" .25', 0.9),
        ('"scale" "float tex" .25', 0.9),  # times 1 is its part, still constant
        ('"scale" "float tex" .5 "float scale" .5', 0.15),
        ('"mix" "float tex1" .25 "float tex2" .25', 0.15),
    ],
)
def test_only_what_is_a_constant_to_pbrt_goes_into_the_image(
    factor: str, value: float, tmp_path: Path
) -> None:
    """1 - 0.4 / 4, and elsewhere (1 - 0.4) / 4."""
    write_exr(tmp_path / "a.exr", {name: np.array([[0.4]]) for name in "RGB"})
    image = 'Texture "i" "spectrum" "imagemap" "string filename" "a.exr" "bool invert" true'
    scaled = texture_of(
        (
            f'Texture "k" "float" {factor} {image} Texture "t" "spectrum" "scale" "texture tex" "i" "texture '
            'scale" "k"'
        ),
        tmp_path,
    )
    np.testing.assert_allclose(evaluate(scaled, places(np.array([[0.5], [0.5]]))), value, rtol=1e-6)


def test_a_constant_factor_is_the_image_s_own_as_in_pbrt(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {name: np.array([[0.25, 0.8]]) for name in "RGB"})
    image = 'Texture "i" "{}" "imagemap" "string filename" "a.exr" "float scale" 2 "bool invert" true '
    scaled = texture_of(
        image.format("spectrum") + 'Texture "t" "spectrum" "scale" "texture tex" "i" "float scale" .5',
        tmp_path,
    )
    assert isinstance(scaled, ImageTexture)
    assert (scaled.scale, scaled.invert) == (1, True)
    np.testing.assert_allclose(scaled.value(scaled.image)[0, :, 0], [0.75, 0.2], rtol=1e-6)
    mixed = texture_of(
        image.format("float") + 'Texture "n" "float" "scale" "float tex" .25 "texture scale" "i" '
        'Texture "t" "spectrum" "mix" "texture amount" "n"',
        tmp_path,
    )
    assert isinstance(mixed, Mix)
    assert isinstance(mixed.amount, ImageTexture)
    assert (mixed.amount.scale, mixed.amount.invert) == (0.5, True)
