"""Lights that are no shapes, for Mitsuba: points, spots, projectors, directions and environments."""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch

import numpy as np

from pipeline.references.mitsuba.environment import LatitudeLongitude, resampled
from pipeline.references.mitsuba.shapes import Frame, affine
from pipeline.references.mitsuba.worker import Plugin
from scenes.description.lights import (
    DistantLight,
    Environment,
    Light,
    PointLight,
    ProjectionLight,
    SpotLight,
    environments,
)
from scenes.description.shapes import Array, basis
from scenes.errors import SceneError

WIDEST_CONE = 88.0  # degrees: a spot's falloff is an image on a plane before it
FALLOFF_ERROR = 1e-4  # of full intensity, at most, by which the image's interpolation may miss the falloff
MOST_FALLOFF = 4096  # texels along a side of that image
# Mitsuba's own axes of an environment, in ours: its x is our y, its y our z, its z our -x.
MITSUBA_AXES = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def lights(given: Sequence[Light], frame: Frame) -> tuple[list[Plugin], dict[str, str]]:
    """The lights as Mitsuba's plug-ins in normalised coordinates, and notes on how exact they are.

    SceneError for a light that Mitsuba cannot have. Radiance and irradiance do not depend on the scale of a
    scene; intensity grows with its square.
    """
    surroundings, notes = _environment(environments(given))
    others = (light for light in given if not isinstance(light, Environment))
    return [*(_emitter(light, frame) for light in others), *surroundings], notes


@singledispatch
def _emitter(light: Light, frame: Frame) -> Plugin:
    """Mitsuba's plug-in for a light in normalised coordinates."""
    raise SceneError(f"Mitsuba has no counterpart of a {type(light).__name__}", light.where)


@_emitter.register
def _(light: PointLight, frame: Frame) -> Plugin:
    place = affine(np.eye(3), frame.points(light.position))
    return Plugin("emitter", "point", {"to_world": place, "intensity": light.intensity * frame.scale**2})


@_emitter.register
def _(light: DistantLight, frame: Frame) -> Plugin:
    turn = affine(basis(-light.wi), np.zeros(3))
    return Plugin("emitter", "directional", {"to_world": turn, "irradiance": light.irradiance})


def _environment(given: tuple[Environment, ...]) -> tuple[list[Plugin], dict[str, str]]:
    """One emitter for all environments, as Mitsuba has no more: constants are added, others become an
    image.
    """
    given = tuple(one for one in given if one.radiance.any() and (one.image is None or one.image.any()))
    if not given:
        return [], {}
    if all(one.image is None and not one.hemisphere for one in given):
        radiance = np.sum([one.radiance for one in given], axis=0)
        return [Plugin("emitter", "constant", {"radiance": radiance})], {}
    image = resampled(given)
    values = {"bitmap": image.image, "to_world": affine(image.frame @ MITSUBA_AXES, np.zeros(3))}
    return [Plugin("emitter", "envmap", values)], {"environment": _said(image)}


def _said(image: LatitudeLongitude) -> str:
    rows, columns = image.image.shape[:2]
    return (
        f"resampled to {columns} x {rows} in latitude and longitude: "
        f"irradiance within {image.irradiance_error:.1e} of the largest, "
        f"radiance within {image.mean_error:.1e} of the mean on average (all of it where texels meet)"
    )


@_emitter.register
def _(light: SpotLight, frame: Frame) -> Plugin:
    """Mitsuba's own falloff is linear in the angle. An image on the plane at distance 1 makes it pbrt's."""
    if light.cone > WIDEST_CONE:
        raise SceneError(
            f"a spot's cone of {light.cone:g} degrees is beyond Mitsuba's ({WIDEST_CONE:g})", light.where
        )
    values: dict[str, Array | float | Plugin] = {
        "to_world": affine(basis(light.axis), frame.points(light.position)),
        "intensity": light.intensity * frame.scale**2,
        "cutoff_angle": light.cone,
        "beam_width": light.cone,
    }
    if light.falloff_start < light.cone:
        picture = {"bitmap": falloff(light), "raw": True, "format": "variant", "wrap_mode": "clamp"}
        values["texture"] = Plugin("texture", "bitmap", picture)
    return Plugin("emitter", "spot", values)


@_emitter.register
def _(light: ProjectionLight, frame: Frame) -> Plugin:
    """A spot that does not fall off, with the image amid black texels on the plane at distance 1.

    Mitsuba's own projector has light in proportion to the cosine cubed inside each texel, pbrt's has not.
    """
    image = light.image
    if (image.shape[0] - image.shape[1]) % 2:  # the border must be as many whole texels on either side
        image = image.repeat(2, axis=0).repeat(2, axis=1)
    height, width = image.shape[:2]
    side = int(np.ceil(np.hypot(height, width))) + 2  # the spot's cone holds the corners
    side += (side - width) % 2
    texel = 2 * light.half[0] / width
    cone = float(np.degrees(np.arctan(side * texel / 2)))
    if cone > WIDEST_CONE:
        raise SceneError(
            f"a projector of {light.fov:g} degrees is wider than Mitsuba's spot ({WIDEST_CONE:g})",
            light.where,
        )
    if side > MOST_FALLOFF:
        raise SceneError(f"a projector's image of {width} x {height} is too large for Mitsuba", light.where)
    y, x = (side - height) // 2, (side - width) // 2
    # Mitsuba has the first row at the bottom.
    texels = np.pad(image[::-1], ((y, side - height - y), (x, side - width - x), (0, 0)))
    picture = {"bitmap": texels, "raw": True, "format": "variant", "filter_type": "nearest"}
    values: dict[str, Array | float | Plugin] = {
        "to_world": affine(light.frame, frame.points(light.position)),
        "intensity": light.intensity * frame.scale**2,
        "cutoff_angle": cone,
        "beam_width": cone,
        "texture": Plugin("texture", "bitmap", {**picture, "wrap_mode": "clamp"}),
    }
    return Plugin("emitter", "spot", values)


def falloff(light: SpotLight) -> Array:
    """pbrt's falloff over the square around the cone, (n, n, 1), as coarse as FALLOFF_ERROR allows.

    SceneError if that needs more than MOST_FALLOFF texels a side.

    Linear interpolation errs by at most the second derivative times the squared step over 8; the steepest
    bend is along the radius.
    """
    radius = np.linspace(0.0, 1.0, 2**16 + 1)
    bend = np.abs(np.diff(_falloff_at(light, radius), 2)).max() * 2.0**32
    size = int(np.ceil(np.sqrt(bend / (8 * FALLOFF_ERROR)) * 2)) + 2  # a step is 2 / size of the radius
    if size > MOST_FALLOFF:
        raise SceneError(
            f"a spot that falls off between {light.falloff_start:g} and {light.cone:g} degrees is too steep "
            "for Mitsuba: start the falloff earlier, or at the cone itself",
            light.where,
        )
    axis = (np.arange(size) + 0.5) / size * 2 - 1
    return _falloff_at(light, np.hypot(axis[:, None], axis[None]))[..., None]


def _falloff_at(light: SpotLight, radius: Array) -> Array:
    """pbrt's smoothstep of the cosine [pharr2023, 12.2.1]; radius: off the axis, in units of the cone's."""
    cosine = 1 / np.sqrt(1 + (radius * np.tan(np.radians(light.cone))) ** 2)
    edge, start = np.cos(np.radians([light.cone, light.falloff_start]))
    x = np.clip((cosine - edge) / (start - edge), 0.0, 1.0)
    return x * x * (3 - 2 * x)
