"""`LightSource "infinite"`: constant and image environments, and the one that several of them add up to.

Two parameters are ours and no pbrt's: `"string mapping" "latitude-longitude"` for such an image, and `"bool
hemisphere" true` for light only where the light's own z is positive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.lights import Environment, Light
from scenes.errors import Report, Unsupported
from scenes.pbrt.directives.texels import image_of, single
from scenes.pbrt.spectra import LUMINANCE
from scenes.pbrt.state import Builder
from scenes.pbrt.text.parameters import Parameters
from scenes.pbrt.transforms import orthonormal

Array = NDArray[np.float64]

MAPPINGS = ("equal-area", "latitude-longitude")


def infinite(
    builder: Builder, parameters: Parameters, colour: Array | None, scale: float, illuminance: float | None
) -> Environment:
    """An environment, `colour` being its `L` if it is given; Unsupported where its transformation
    stretches.
    """
    frame = orthonormal(builder.state.transform.matrix[:3, :3])
    if frame is None:
        raise Unsupported(
            "the transformation stretches or shears the infinite light; that is not supported",
            parameters.where,
        )
    if parameters.given("portal"):
        parameters.vectors("point3", "portal")
        parameters.unsupported(
            "portal", "portal is not supported: leave it out, and the image stays the same but for its noise"
        )
    hemisphere = parameters.flag("hemisphere", False)
    image, mapping = _image(builder, parameters, colour)
    radiance = (np.ones(3) if colour is None else colour) * scale
    if illuminance is not None:
        radiance = radiance * (
            illuminance / (np.pi if image is None else _illuminance(parameters, image, mapping))
        )
    if image is None and not hemisphere:
        frame = np.eye(3)  # which way it is turned changes nothing
    return Environment(radiance, image, mapping, frame, hemisphere, parameters.where)


def _image(builder: Builder, parameters: Parameters, colour: Array | None) -> tuple[Array | None, str]:
    name, mapping = parameters.text("filename", ""), parameters.text("mapping", MAPPINGS[0])
    if mapping not in MAPPINGS:
        raise parameters.fail("mapping", f'unknown mapping "{mapping}"; there are: {", ".join(MAPPINGS)}')
    if not name:
        return None, MAPPINGS[0]
    if colour is not None:
        raise parameters.fail("filename", "an infinite light has either L or filename, not both")
    image = image_of(builder, parameters, name)
    height, width = image.shape[:2]
    if mapping == MAPPINGS[0] and width != height:
        raise parameters.fail(
            "filename",
            f"{name!r} is {width} x {height}: pbrt's equal-area map is square; if this is a latitude-longitude map, say so with "  # noqa: E501
            '"string mapping" "latitude-longitude"',
        )
    return image, mapping


def _illuminance(parameters: Parameters, image: Array, mapping: str) -> float:
    """What pbrt-v4 divides by to make an image give an `illuminance`: half that on a surface that faces the
    light's own z.

    (Its sum over the texels of the upper half weighs each with 2 pi / n, where the solid angle of one is 4 pi
    / n.)
    """
    cosine = (
        _equal_area_cosines(len(image)) if mapping == MAPPINGS[0] else _latitude_cosines(*image.shape[:2])
    )
    total = float(np.sum((image @ LUMINANCE) * cosine)) / 2
    if not total > 0:
        raise parameters.fail(
            "illuminance", "the image is black above its horizon: it cannot give any illuminance"
        )
    return total


def _equal_area_cosines(size: int) -> Array:
    """The solid angle of each texel of the square octahedral map times its cosine to z, 0 below the horizon:
    (size, size).
    """
    u = 2 * (np.arange(size) + 0.5) / size - 1
    inner = 1 - (np.abs(u)[None, :] + np.abs(u)[:, None])  # positive on the upper half
    z = np.where(inner > 0, 1 - (1 - inner) ** 2, 0.0)
    return z * (4 * np.pi / size**2)


def _latitude_cosines(height: int, width: int) -> Array:
    """As `_equal_area_cosines`, for a latitude-longitude map: (height, width), by the exact integral over
    each row.
    """
    edges = np.maximum(np.cos(np.pi * np.arange(height + 1) / height), 0.0)
    rows = (edges[:-1] ** 2 - edges[1:] ** 2) / 2 * (2 * np.pi / width)
    return np.repeat(rows[:, None], width, axis=1)


def sum_environments(lights: Sequence[Light], report: Report) -> tuple[Light, ...]:
    """The lights with one environment at most, in the place of the first: constants add up, also to the
    texels of an image.

    Two images, and a whole sphere with a half of one, are no such light; the report says so.
    """
    total: Environment | None = None
    for light in lights:
        if isinstance(light, Environment):
            total = light if total is None else _sum(total, light, report)
    placed: list[Light] = []
    for light in lights:
        if not isinstance(light, Environment):
            placed.append(light)
        elif total is not None:
            placed.append(total)
            total = None
    return tuple(placed)


def _sum(first: Environment, second: Environment, report: Report) -> Environment:
    where = second.where
    problem = None
    if first.image is not None and second.image is not None:
        problem = "two infinite lights with images are not supported: add the images up in one"
    elif first.hemisphere != second.hemisphere or (
        first.hemisphere and not np.array_equal(first.frame, second.frame)
    ):
        problem = (
            "infinite lights over different parts of the sphere do not add up to one; that is not supported"
        )
    if problem is not None:
        if where is not None:
            report.add(problem, where)
        return first
    if first.image is None and second.image is None:
        return replace(first, radiance=first.radiance + second.radiance)
    light, constant = (first, second) if first.image is not None else (second, first)
    image = single(light.radiance * light.image + constant.radiance) if light.image is not None else None
    return replace(light, radiance=np.ones(3), image=image, where=first.where)
