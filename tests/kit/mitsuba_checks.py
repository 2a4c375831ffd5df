"""Means of Mitsuba's images with their errors, and pbrt's environment and texture look-ups written down a
second time.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from pipeline.references.backends.mitsuba import MitsubaBackend
from pipeline.references.protocol import ReferenceRequest
from scenes.description.lights import Environment, Light
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Array, ShapeDescription
from tests.kit.mitsuba_scenes import scene

BACKEND = MitsubaBackend()


def render(given: SceneDescription, spp: int) -> tuple[Array, Array]:
    """Mean and standard error over the whole image, (3,) each."""
    image = BACKEND.render(given, ReferenceRequest(spp))
    pixels = image.mean[..., 0].size
    return image.mean.mean(axis=(0, 1)), np.sqrt(image.variance.sum(axis=(0, 1))) / pixels


def picture(given: SceneDescription, spp: int = 64) -> Array:
    """The image alone, of something that hardly varies."""
    return BACKEND.render(given, ReferenceRequest(spp)).mean


def lit(
    shapes: Sequence[ShapeDescription], lights: Sequence[Light], view: tuple[Array, float], size: int = 4
) -> SceneDescription:
    """A scene under lights that are no shapes."""
    return dataclasses.replace(scene(shapes, *view, size, size), lights=tuple(lights))


def towards(square: Array) -> Array:
    """pbrt's EqualAreaSquareToSphere, in its own words: points (..., 2) of the unit square to directions
    (..., 3).
    """
    u, v = 2 * square[..., 0] - 1, 2 * square[..., 1] - 1
    signed = 1 - (np.abs(u) + np.abs(v))
    r = 1 - np.abs(signed)
    phi = np.where(r == 0, 1, (np.abs(v) - np.abs(u)) / np.where(r == 0, 1, r) + 1) * np.pi / 4
    flat = r * np.sqrt(2 - r * r)
    return np.stack(
        [
            np.copysign(np.cos(phi), u) * flat,
            np.copysign(np.sin(phi), v) * flat,
            np.copysign(1 - r * r, signed),
        ],
        -1,
    )


def solid_angles(given: Environment, fine: int = 1024) -> tuple[Array, Array]:
    """Directions (m, 3), world space, and radiance times solid angle (m, 3), over parts of the environment's
    own texels.
    """
    height, width = (1, 1) if given.image is None else given.image.shape[:2]
    rows, columns = height * -(-fine // height), width * -(-fine // width)
    v, u = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns, indexing="ij")
    if given.mapping == "equal-area" and given.image is not None:
        own, share = towards(np.stack([u, v], -1)), np.full(u.shape, 4 * np.pi / u.size)
    else:
        theta, phi = np.pi * v, 2 * np.pi * u
        own = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
        share = np.sin(theta) * (2 * np.pi / columns) * 2 * np.sin(np.pi / rows / 2)
    value = np.broadcast_to(given.radiance, own.shape)
    if given.image is not None:
        value = value * given.image[np.int64(v * height), np.int64(u * width)]
    if given.hemisphere:
        z = own[..., 2]
        share = share * np.where(np.abs(z) < 1e-9, 0.5, z > 0)
    return (own @ given.frame.T).reshape(-1, 3), (value * share[..., None]).reshape(-1, 3)


def irradiance(given: Environment, normal: Array) -> Array:
    """Of a surface of that normal with nothing in the way: (3,), good to 1e-6 or so."""
    d, light = solid_angles(given)
    return np.maximum(d @ normal, 0.0) @ light
