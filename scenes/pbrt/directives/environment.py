"""`LightSource "infinite"`: constant and image environments, portals, and sums of several.

Two parameters are ours, not pbrt's: `"string mapping" "latitude-longitude"` for such an image, and `"bool
hemisphere" true` for light only where the light's own z is positive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.lights import Environment, Light, PortalLight
from scenes.errors import Unsupported
from scenes.pbrt.directives.texels import image_of, single
from scenes.pbrt.spectra import LUMINANCE
from scenes.pbrt.state import Builder
from scenes.pbrt.text.parameters import Parameters
from scenes.pbrt.transforms import orthonormal

Array = NDArray[np.float64]

MAPPINGS = ("equal-area", "latitude-longitude")
SAME_DIRECTION = 1e-3  # pbrt's own, on the cosines between the edges of a portal


def infinite(
    builder: Builder, parameters: Parameters, colour: Array | None, scale: float, illuminance: float | None
) -> Environment | PortalLight:
    """An environment. colour: its `L`, None if not given. Raises Unsupported for a transformation that
    stretches.
    """
    # Which way a constant one is turned changes nothing.
    turned = bool(parameters.text("filename", "")) or parameters.flag("hemisphere", False)
    frame = orthonormal(builder.state.transform.matrix[:3, :3]) if turned else np.eye(3)
    if frame is None:
        raise Unsupported(
            "the transformation stretches or shears the infinite light; that is not supported",
            parameters.where,
        )
    portal = _portal(parameters)
    hemisphere = parameters.flag("hemisphere", False)
    image, mapping = _image(builder, parameters, colour)
    if portal is not None:
        _check_sky_of_portal(parameters, hemisphere, mapping)
    radiance = (np.ones(3) if colour is None else colour) * scale
    if illuminance is not None:
        # Behind a portal pbrt takes a constant for an image of one texel, the whole of which is straight up.
        texels = np.ones((1, 1, 3)) if image is None and portal is not None else image
        radiance = radiance * (
            illuminance / (np.pi if texels is None else _illuminance(parameters, texels, mapping))
        )
    sky = Environment(radiance, image, mapping, frame, hemisphere, parameters.where)
    return sky if portal is None else PortalLight(sky, portal)


def _portal(parameters: Parameters) -> Array | None:
    """The corners (4, 3) of `portal`, a rectangle in turn, in world space under any transformation."""
    corners = parameters.vectors("point3", "portal")
    if corners is None:
        return None
    if len(corners) != 4:
        raise parameters.fail("portal", f"a portal has four corners, not {len(corners)}")
    edges = np.stack([corners[i] - corners[j] for i, j in ((1, 0), (2, 1), (2, 3), (3, 0))])
    lengths = np.linalg.norm(edges, axis=1)
    if not np.all(lengths > 0):
        raise parameters.fail("portal", "two corners of the portal are the same point")
    cosine = (edges / lengths[:, None]) @ (edges / lengths[:, None]).T
    parallel = cosine[[0, 1], [2, 3]] - 1
    if np.abs([*parallel, *cosine[[0, 1, 2, 3], [1, 2, 3, 0]]]).max() > SAME_DIRECTION:
        raise parameters.fail("portal", "the portal is no rectangle whose corners are given in turn")
    return corners


def _check_sky_of_portal(parameters: Parameters, hemisphere: bool, mapping: str) -> None:
    if hemisphere or mapping != MAPPINGS[0]:
        parameters.unsupported(
            "portal", "a portal with `hemisphere` or `mapping`, which are ours, is not supported"
        )


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
    """The divisor by which pbrt-v4 makes an image give an `illuminance`: half that on a surface that faces
    the light's own z.

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


def sum_environments(lights: Sequence[Light]) -> tuple[Light, ...]:
    """The lights, where constant environments are added up, also to the texels of the first image, in the
    place of the first. Lights without an exact sum stay apart.
    """
    kept: list[Light] = []
    skies: list[tuple[int, Environment]] = []
    for light in lights:
        if not isinstance(light, Environment):
            kept.append(light)
            continue
        sums = ((k, i, _sum(sky, light)) for k, (i, sky) in enumerate(skies))
        k, i, total = next((found for found in sums if found[2]), (len(skies), len(kept), light))
        skies[k : k + 1], kept[i : i + 1] = [(i, total or light)], [total or light]
    return tuple(kept)


def _sum(first: Environment, second: Environment) -> Environment | None:
    """Two environments as one; None if they have no exact sum."""
    if first.hemisphere != second.hemisphere or (
        first.hemisphere and not np.array_equal(first.frame, second.frame)
    ):
        return None
    if first.image is None and second.image is None:
        return replace(first, radiance=first.radiance + second.radiance)
    light, constant = (first, second) if first.image is not None else (second, first)
    if light.image is None or constant.image is not None:
        return None
    image = single(light.radiance * light.image + constant.radiance)
    return replace(light, radiance=np.ones(3), image=image, where=first.where)
