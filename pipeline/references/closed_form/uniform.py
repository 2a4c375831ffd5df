"""Closed-form images of coplanar receivers under distant lights and a sky of one radiance.

Nothing is hidden, so that all receivers have one irradiance. A pixel is the mean of receivers and sky,
weighted by the areas that they cover in it. Ambient occlusion is the image of white receivers under a white
sky that is not seen itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch

import numpy as np

from pipeline.references.closed_form.film import FilmPlane, areas, classify, clip_by_planes
from pipeline.references.closed_form.image import PixelImage
from pipeline.references.closed_form.patches import Plane, needs
from pipeline.references.closed_form.quadrature import sums
from pipeline.references.closed_form.scene import Receiver, ground
from scenes.arrays import Array
from scenes.description.lights import DistantLight, Environment, Light
from scenes.description.scene import SceneDescription
from scenes.errors import SceneError

ROUNDING = 1e-12  # of a pixel's area: what clipping and summing a few polygons may be off by


@dataclass(frozen=True, eq=False)
class UniformScene:
    """Receivers of one irradiance. irradiance: (3,), on the side in view. sky: (3,), radiance of the
    background.
    """

    receivers: tuple[Receiver, ...]
    irradiance: Array
    sky: Array


def is_uniform(scene: SceneDescription) -> bool:
    """Whether all light of a scene comes from infinitely far away."""
    emits = any(shape.emission for shape in scene.shapes)
    return bool(scene.lights) and not emits and all(light.place is None for light in scene.lights)


def uniform_scene(scene: SceneDescription) -> UniformScene:
    """The parts of a scene of one irradiance; SceneError with the reason if its irradiance varies."""
    receivers, plane, _ = ground(scene)
    irradiance, sky = np.zeros(3), np.zeros(3)
    for light in scene.lights:
        received, seen = _uniform(light, plane)
        irradiance, sky = irradiance + received, sky + seen
    return UniformScene(receivers, irradiance, sky)


@singledispatch
def _uniform(light: Light, plane: Plane | None) -> tuple[Array, Array]:
    """The light's irradiance (3,) on the plane and its radiance (3,) as a sky; SceneError if they vary."""
    raise needs("a sky of one radiance all around", light.where)


@_uniform.register
def _(light: DistantLight, plane: Plane | None) -> tuple[Array, Array]:
    return light.irradiance * _cosine(light.wi, plane), np.zeros(3)


@_uniform.register
def _(light: Environment, plane: Plane | None) -> tuple[Array, Array]:
    if light.image is not None or light.hemisphere:
        raise needs("a sky of one radiance all around", light.where)
    return np.pi * light.radiance, light.radiance


def open_scene(scene: SceneDescription) -> UniformScene:
    """White receivers whose radiance is the ambient occlusion of `scene`.

    SceneError if shapes may hide the sky from each other.
    """
    if any(shape.emission for shape in scene.shapes):
        raise SceneError(
            "the closed form of ambient occlusion needs a scene without lights that may be in the way"
        )
    receivers = tuple(Receiver(receiver.patch, np.ones(3)) for receiver in ground(scene)[0])
    return UniformScene(receivers, np.full(3, np.pi), np.zeros(3))


def uniform_image(scene: UniformScene, film: FilmPlane) -> PixelImage:
    """Radiance averaged over every pixel, to rounding."""
    mean = np.broadcast_to(scene.sky, (film.pixels, 3))
    for receiver in scene.receivers:
        seen = receiver.reflectance / np.pi * scene.irradiance - scene.sky
        mean = mean + np.multiply.outer(_share(film, receiver), seen)
    brightest = np.max(
        [scene.sky, *(one.reflectance / np.pi * scene.irradiance for one in scene.receivers)], axis=0
    )
    return PixelImage(mean, np.broadcast_to(ROUNDING * brightest, mean.shape), 0)


def _share(film: FilmPlane, receiver: Receiver) -> Array:
    """The share (pixels,) of each pixel that the receiver covers."""
    planes = film.planes(receiver.patch.outline)
    whole, mixed = classify(film, planes)
    cut = clip_by_planes(film.squares(mixed), np.broadcast_to(planes, (mixed.size, *planes.shape)))
    return whole + sums(mixed, areas(cut), film.pixels) / film.pixel_area


def _cosine(wi: Array, plane: Plane | None) -> float:
    """The cosine between wi and the plane's normal; 0 for light from behind."""
    return 0.0 if plane is None else max(0.0, float(wi @ plane.normal))
