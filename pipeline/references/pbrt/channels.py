"""One colour channel of a scene as a gray scene: what a spectral renderer reproduces exactly."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.description.materials import Conductor, Dielectric, Diffuse
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Emission, ShapeDescription
from scenes.description.textures import Checkerboard, ImageTexture, Mix, Product

CHANNELS = 3


def gray_scenes(scene: SceneDescription) -> list[SceneDescription]:
    """Three gray scenes, one for each channel of the image; a single one if the scene is gray."""
    scenes = [_channel(scene, c) for c in range(CHANNELS)]
    return scenes[:1] if len({one.content_hash() for one in scenes}) == 1 else scenes


@singledispatch
def _channel(value: Any, c: int) -> Any:
    """`value` with channel c in place of all three. TypeError for a kind that nobody has said this of."""
    raise TypeError(f"no gray counterpart of a {type(value).__name__} is known")


@_channel.register
def _(value: np.ndarray, c: int) -> NDArray[np.float64]:
    return np.repeat(value[..., c : c + 1], CHANNELS, axis=-1)


@_channel.register
def _(value: None, c: int) -> None:
    return None


@_channel.register
def _(value: SceneDescription, c: int) -> SceneDescription:
    shapes = tuple(_channel(shape, c) for shape in value.shapes)
    lights = tuple(light.map_colors(lambda color: _channel(color, c)) for light in value.lights)
    return replace(value, shapes=shapes, lights=lights)


@_channel.register
def _(value: ShapeDescription, c: int) -> ShapeDescription:
    return replace(value, material=_channel(value.material, c), emission=_channel(value.emission, c))


@_channel.register
def _(value: Diffuse, c: int) -> Diffuse:
    return replace(value, reflectance=_channel(value.reflectance, c))


@_channel.register
def _(value: Conductor, c: int) -> Conductor:
    return replace(value, eta=_channel(value.eta, c), k=_channel(value.k, c))


@_channel.register
def _(value: Dielectric, c: int) -> Dielectric:
    return value


@_channel.register
def _(value: Emission, c: int) -> Emission:
    return replace(value, radiance=_channel(value.radiance, c), image=_channel(value.image, c))


@_channel.register
def _(value: ImageTexture, c: int) -> ImageTexture:
    return replace(value, image=_channel(value.image, c))


@_channel.register(Checkerboard)
@_channel.register(Product)
def _(value: Checkerboard | Product, c: int) -> Checkerboard | Product:
    return replace(value, first=_channel(value.first, c), second=_channel(value.second, c))


@_channel.register
def _(value: Mix, c: int) -> Mix:
    first, second = _channel(value.first, c), _channel(value.second, c)
    return replace(value, first=first, second=second, amount=_channel(value.amount, c))
