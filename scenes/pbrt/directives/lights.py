"""`LightSource` and `AreaLightSource`, read with pbrt-v4's defaults and units, and written back.

Luminance, luminous power and illuminance are understood where a file gives them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from scenes.description.lights import (
    DistantLight,
    Environment,
    GoniometricLight,
    Light,
    PointLight,
    PortalLight,
    ProjectionLight,
    SpotLight,
)
from scenes.description.shapes import Emission
from scenes.errors import SceneError, Unsupported
from scenes.pbrt.directives.environment import infinite
from scenes.pbrt.directives.texels import image_of, means_of
from scenes.pbrt.spectra import LUMINANCE, Role, colour
from scenes.pbrt.state import AreaLight, Builder, check_room, refuse_kind
from scenes.pbrt.text.parameters import Parameters
from scenes.pbrt.transforms import COORDINATE_LIMIT, orthonormal, uniform_scale, unit
from scenes.pbrt.write.side_files import SideFiles, scaled_image
from scenes.pbrt.write.text import numbers, rotation

Array = NDArray[np.float64]

RADIANCE_LIMIT = 1e30


def light_source(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`LightSource`: infinite, distant, and those that shine from a point."""
    if kind not in _LIGHTS:
        parameters.ignore()
        supported = ", ".join(f'"{name}"' for name in _LIGHTS)
        raise Unsupported(f'LightSource "{kind}" is not supported; supported: {supported}', parameters.where)
    if builder.current_object is not None:
        problem = (
            "a LightSource inside an object is one light of the scene, whatever the instances, as in pbrt"
        )
        builder.report.remark(problem, parameters.where)
    check_room(builder.lights, "lights", parameters.where)
    if kind != "infinite":  # which is turned alone
        builder.check_affine(parameters.where)
    if builder.moves:
        builder.report.remark(
            "a light does not move: it stands as at the start, as in pbrt", parameters.where
        )
    builder.lights.append(_LIGHTS[kind](builder, parameters))


def kinds() -> tuple[str, ...]:
    """The kinds of light that are read."""
    return tuple(_LIGHTS)


@singledispatch
def light_text(light: Light, files: SideFiles) -> list[str]:
    """The directives that read back as the same light, bit for bit. Images go to `files`."""
    raise TypeError(f"no pbrt text is known for a {type(light).__name__}")


def emitted(parameters: Parameters, name: str) -> Array:
    """The colour of a light times its `scale`, (3,) float64; white, pbrt's standard illuminant, if none is
    given.
    """
    found = colour(parameters, name, "illuminant")
    return checked(parameters, name, (np.ones(3) if found is None else found) * factor(parameters))


def factor(parameters: Parameters) -> float:
    """The `scale`; as in pbrt, a negative one subtracts light."""
    found = parameters.number("scale", 1.0)
    if found < 0:
        parameters.substitute("scale", "a light of negative scale", "as no light")
    return max(found, 0.0)


def checked(parameters: Parameters, name: str, radiance: Array) -> Array:
    """`radiance`; SceneError if it is too large."""
    if not np.all(radiance <= RADIANCE_LIMIT):
        raise parameters.fail(
            name, "the radiance is beyond 1e30, the largest that float32 images can average"
        )
    return radiance


def _positive(parameters: Parameters, name: str) -> float | None:
    """A `power` or an `illuminance`; None if it is not positive, which pbrt treats as not given."""
    value = parameters.number(name, -1.0)
    return value if value > 0 else None


def _position(builder: Builder, parameters: Parameters, from_: bool = True) -> Array:
    """The position (3,) of a light. from_: whether it has a parameter of that name."""
    own = parameters.point("from", (0.0, 0.0, 0.0)) if from_ else np.zeros(3)
    position = builder.state.transform.points(own[None])[0]
    if not np.all(np.abs(position) <= COORDINATE_LIMIT):
        raise parameters.fail("from", f"the light lies beyond {COORDINATE_LIMIT:g}, the largest coordinate")
    return position


def _direction(builder: Builder, parameters: Parameters, v: Array) -> Array:
    """The unit vector (3,) in world space of a direction in the light's own space."""
    try:
        return unit(builder.state.transform.vector(unit(v))) + 0.0
    except ValueError:
        raise parameters.fail("to", "from and to are the same point: the light has no direction") from None


def _point(builder: Builder, parameters: Parameters) -> Light:
    intensity, power = emitted(parameters, "I"), _positive(parameters, "power")
    if power is not None:
        intensity = checked(parameters, "power", intensity * (power / (4 * np.pi)))
    return PointLight(_position(builder, parameters), intensity, parameters.where)


@light_text.register
def _(light: PointLight, files: SideFiles) -> list[str]:
    place, intensity = numbers(light.position), numbers(light.intensity)
    return [f'LightSource "point" "point3 from" [ {place} ] "rgb I" [ {intensity} ]']


def _spot(builder: Builder, parameters: Parameters) -> Light:
    cone, delta = parameters.number("coneangle", 30.0), parameters.number("conedeltaangle", 5.0)
    if not 0 < cone <= 180:
        raise parameters.fail("coneangle", f"coneangle is above 0 and at most 180 degrees, not {cone:g}")
    if not 0 <= delta <= 2 * cone:
        raise parameters.fail(
            "conedeltaangle", f"conedeltaangle is between 0 and twice coneangle, not {delta:g} degrees"
        )
    inner = abs(cone - delta)  # beyond the axis it begins as far on the other side, as its cosine has it
    if uniform_scale(builder.state.transform.matrix[:3, :3]) is None:
        raise Unsupported(
            "the transformation stretches or shears the cone of the spot light; that is not supported",
            parameters.where,
        )
    start, end = np.cos(np.radians(inner)), np.cos(np.radians(cone))
    intensity, power = emitted(parameters, "I"), _positive(parameters, "power")
    if power is not None:
        intensity = checked(
            parameters, "power", intensity * (power / (2 * np.pi * ((1 - start) + (start - end) / 2)))
        )
    position = _position(builder, parameters)
    axis = parameters.point("to", (0.0, 0.0, 1.0)) - parameters.point("from", (0.0, 0.0, 0.0))
    return SpotLight(
        position, _direction(builder, parameters, axis), intensity, cone, inner, parameters.where
    )


@light_text.register
def _(light: SpotLight, files: SideFiles) -> list[str]:
    delta = light.cone - light.falloff_start
    cone = f'"float coneangle" [ {light.cone!r} ] "float conedeltaangle" [ {delta!r} ]'
    aim = f'"point3 from" [ 0 0 0 ] "point3 to" [ {numbers(light.axis)} ]'
    source = f'LightSource "spot" {aim} {cone} "rgb I" [ {numbers(light.intensity)} ]'
    return [f"Translate {numbers(light.position)}", source]


def _distant(builder: Builder, parameters: Parameters) -> Light:
    irradiance, illuminance = emitted(parameters, "L"), _positive(parameters, "illuminance")
    if illuminance is not None:
        irradiance = checked(parameters, "illuminance", irradiance * illuminance)
    axis = parameters.point("from", (0.0, 0.0, 0.0)) - parameters.point("to", (0.0, 0.0, 1.0))
    return DistantLight(_direction(builder, parameters, axis), irradiance, parameters.where)


@light_text.register
def _(light: DistantLight, files: SideFiles) -> list[str]:
    aim = f'"point3 from" [ {numbers(light.wi)} ] "point3 to" [ 0 0 0 ]'
    return [f'LightSource "distant" {aim} "rgb L" [ {numbers(light.irradiance)} ]']


def _goniometric(builder: Builder, parameters: Parameters) -> Light:
    intensity, power = emitted(parameters, "I"), _positive(parameters, "power")
    name = _filename(parameters, "goniometric")
    image = means_of(builder, parameters, name)
    height, width = image.shape
    if height != width:
        raise parameters.fail(
            "filename", f"{name!r} is {width} x {height}: the equal-area map of a goniometric light is square"
        )
    if power is not None:
        intensity = _for_power(parameters, intensity, power, 4 * np.pi * float(image.mean()))
    checked(parameters, "I", intensity * image.max())
    axes = _axes(builder, parameters, "goniometric")[:, [0, 2, 1]]  # pbrt swaps y and z
    return GoniometricLight(
        _position(builder, parameters, from_=False), axes, intensity, image, parameters.where
    )


@light_text.register
def _(light: GoniometricLight, files: SideFiles) -> list[str]:
    name = files.add(np.repeat(light.image[..., None], 3, axis=2))
    source = f'LightSource "goniometric" "rgb I" [ {numbers(light.intensity)} ] "string filename" {name}'
    return [*_placed(light.position, light.frame[:, [0, 2, 1]], "a goniometric light's"), source]


def _projection(builder: Builder, parameters: Parameters) -> Light:
    scale, power, fov = factor(parameters), _positive(parameters, "power"), parameters.number("fov", 90.0)
    if not 0 < fov < 180:
        raise parameters.fail("fov", f"fov is an angle between 0 and 180 degrees, not {fov:g}")
    image = image_of(builder, parameters, _filename(parameters, "projection"))
    axes, position = _axes(builder, parameters, "projection"), _position(builder, parameters, from_=False)
    light = ProjectionLight(position, axes, np.full(3, scale), image, fov, parameters.where)
    if power is not None:
        light = replace(
            light, intensity=_for_power(parameters, light.intensity, power, _luminous_power(light))
        )
    checked(parameters, "filename", light.intensity * image.max())
    return light


def _luminous_power(light: ProjectionLight) -> float:
    """pbrt's sum of luminance over the image, each texel weighted by the solid angle of its middle."""
    height, width = light.image.shape[:2]
    x = (2 * np.arange(float(width)) + 1) / width - 1
    y = (2 * np.arange(float(height)) + 1) / height - 1
    right, up = light.half
    solid = 4 * right * up / (height * width) / (1 + (x * right) ** 2 + (y[:, None] * up) ** 2) ** 1.5
    return float(np.sum((light.image @ LUMINANCE) * solid))


@light_text.register
def _(light: ProjectionLight, files: SideFiles) -> list[str]:
    name, scale = scaled_image(light.image, light.intensity, files)
    source = f'LightSource "projection" "string filename" {name}{scale} "float fov" [ {light.fov!r} ]'
    return [*_placed(light.position, light.frame, "a projection light's"), source]


def _filename(parameters: Parameters, kind: str) -> str:
    name = parameters.text("filename", "")
    if not name:
        raise SceneError(f'a {kind} light takes its image from "string filename"', parameters.where)
    return name


def _for_power(parameters: Parameters, intensity: Array, power: float, own: float) -> Array:
    """`intensity` scaled so that a light that sends out `own` lumens sends out `power`."""
    if not own > 0:
        raise parameters.fail("power", "the image is black: it cannot send out any power")
    return checked(parameters, "power", intensity * (power / own))


def _axes(builder: Builder, parameters: Parameters, kind: str) -> Array:
    """The light's own axes in world space, orthonormal columns (3, 3)."""
    axes = orthonormal(builder.state.transform.matrix[:3, :3])
    if axes is None:
        raise Unsupported(
            f"the transformation stretches or shears the {kind} light; that is not supported",
            parameters.where,
        )
    return axes


def _placed(position: Array, axes: Array, what: str) -> list[str]:
    return [f"Translate {numbers(position)}", rotation(axes, what)]


def _infinite(builder: Builder, parameters: Parameters) -> Light:
    role: Role = "absolute" if parameters.given("portal") else "illuminant"  # pbrt makes an image of it there
    found = colour(parameters, "L", role, first=True)
    light = infinite(builder, parameters, found, factor(parameters), _positive(parameters, "illuminance"))
    sky = light.sky if isinstance(light, PortalLight) else light
    checked(parameters, "L", sky.radiance if sky.image is None else sky.radiance * sky.image.max())
    return light


@light_text.register
def _(light: PortalLight, files: SideFiles) -> list[str]:
    *placed, source = light_text(light.sky, files)
    return [*placed, f'{source} "point3 portal" [ {numbers(light.corners)} ]']


@light_text.register
def _(light: Environment, files: SideFiles) -> list[str]:
    lines = [] if light.in_pbrt else ["# not pbrt-v4's: `mapping` and `hemisphere` are Penumbra's own"]
    if light.image is not None or light.hemisphere:
        lines.append(rotation(light.frame, "an infinite light's"))
    ours = ' "bool hemisphere" [ true ]' if light.hemisphere else ""
    if light.image is None:
        return [*lines, f'LightSource "infinite" "rgb L" [ {numbers(light.radiance)} ]{ours}']
    if light.mapping != "equal-area":
        ours = f' "string mapping" "{light.mapping}"{ours}'
    name, scale = scaled_image(light.image, light.radiance, files)
    return [*lines, f'LightSource "infinite" "string filename" {name}{scale}{ours}']


def area_light(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`AreaLightSource "diffuse"`: radiance for the shapes that follow in this attribute block."""
    refuse_kind(kind, "diffuse", parameters)
    name = parameters.text("filename", "")
    if name and parameters.given("L"):
        raise parameters.fail("filename", "an area light has either L or filename, not both")
    radiance = emitted(parameters, "L")
    image = image_of(builder, parameters, name) if name else None
    emission = Emission(radiance, parameters.flag("twosided", False), image)
    light = AreaLight(emission, _positive(parameters, "power"), parameters.where)
    builder.state = replace(builder.state, light=light)


def area_light_text(emission: Emission, files: SideFiles) -> str:
    """The `AreaLightSource` of an emission."""
    sides = ' "bool twosided" [ true ]' if emission.two_sided else ""
    if emission.image is None:
        return f'AreaLightSource "diffuse" "rgb L" [ {numbers(emission.radiance)} ]{sides}'
    name, scale = scaled_image(emission.image, emission.radiance, files)
    return f'AreaLightSource "diffuse" "string filename" {name}{scale}{sides}'


_LIGHTS: dict[str, Callable[[Builder, Parameters], Light]] = {
    "infinite": _infinite,
    "distant": _distant,
    "point": _point,
    "spot": _spot,
    "goniometric": _goniometric,
    "projection": _projection,
}
