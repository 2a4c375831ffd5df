"""Images on lights, and textures that are scaled and inverted, through Mitsuba against what pbrt's formulas
say.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from scenes.description.materials import Diffuse
from scenes.description.shapes import Emission, ShapeDescription
from scenes.description.textures import ImageTexture
from tests.kit.mitsuba_checks import BACKEND, lit, picture
from tests.kit.mitsuba_scenes import scene
from tests.pipeline.references.mitsuba.test_surfaces import (
    BITS,
    SIZE,
    SQUARE,
    SUN,
    VIEW,
    image_at,
    shrunk,
    square_uv,
)


@pytest.mark.usefixtures("mitsuba")
def test_an_image_on_a_light_is_looked_up_as_pbrt_does() -> None:
    """Bilinearly and clamped; the nearest texels, or a row the other way up, would be off by 0.1 and more."""
    light = ShapeDescription(SQUARE, Diffuse(np.zeros(3)), Emission(np.array([1.0, 2.0, 3.0]), image=BITS))
    image = picture(scene([light], *VIEW, SIZE, SIZE), 256)
    uv = square_uv()
    there = ~np.isnan(uv[..., :1])
    seen = image_at(ImageTexture(BITS, wrap="clamp"), np.nan_to_num(uv)) * [1, 2, 3]
    error = np.abs(image - shrunk(np.where(there, seen, 0.0)))
    assert there.any()
    assert np.median(error) < 2e-3
    inside = shrunk(np.where(there, 1.0, 0.0) * np.ones(3)) == 1
    assert error[inside].max() < 0.03  # noise of 256 samples that see up to half of a texel's range


@pytest.mark.parametrize(
    "texture",
    [
        ImageTexture(BITS, scale=0.5),
        ImageTexture(BITS, scale=0.5, invert=True),
        ImageTexture(BITS, filter="point", scale=3.0, invert=True),
    ],
)
@pytest.mark.usefixtures("mitsuba")
def test_scaled_and_inverted_textures(texture: ImageTexture) -> None:
    square = ShapeDescription(SQUARE, Diffuse(texture))
    image = picture(lit([square], [SUN], VIEW, SIZE), 256)
    uv = square_uv()
    there = ~np.isnan(uv[..., :1])
    raw = image_at(dataclasses.replace(texture, scale=1.0, invert=False), np.nan_to_num(uv)) * texture.scale
    seen = np.clip(1 - raw if texture.invert else raw, 0, 1) * -SUN.wi[2]
    error = np.abs(image - shrunk(np.where(there, seen, 0.0)))
    assert np.median(error) < 2e-3


def test_a_texture_that_is_cut_off_between_its_texels_is_refused() -> None:
    square = ShapeDescription(SQUARE, Diffuse(ImageTexture(BITS, scale=3.0)))
    assert "cut off" in str(BACKEND.refuses(lit([square], [SUN], VIEW)))
