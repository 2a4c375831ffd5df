"""Images that a scene names, for textures and lights."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.builder import Builder
from scenes.errors import PenumbraError, SceneError
from scenes.parameters import Parameters

TEXELS = 2**27  # of all images of a scene: 3.2 GB as they are held


def image_of(builder: Builder, parameters: Parameters, name: str, encoding: str = "sRGB") -> NDArray[np.float64]:
    """The image file `name`, which the parameter "filename" gives: (h, w, 3) float64, linear RGB, nothing below 0, rounded to float32.

    encoding: as `images.read_texture` takes it. SceneError at the parameter where it cannot be read.
    """
    from scenes.images import read_texture  # here, because most scenes name no images and its library takes time

    path = parameters.resolve(name)
    try:
        image = single(np.maximum(read_texture(path, encoding), 0.0))
    except SceneError:
        raise
    except PenumbraError as error:
        raise parameters.fail("filename", str(error)) from None
    builder.texels += image.shape[0] * image.shape[1]
    if builder.texels > TEXELS:
        raise parameters.fail("filename", f"the images of the scene have more than {TEXELS} texels in all")
    return image


def single(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """Texels rounded to float32, which is what image files hold: a scene that is written out and read again is the same to the bit."""
    return image.astype(np.float32).astype(np.float64)
