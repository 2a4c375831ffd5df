"""What each directive with a parameter list means: camera, film, sampler, materials, lights, shapes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from scenes.description import (
    Diffuse,
    Emission,
    Film,
    Geometry,
    PerspectiveCamera,
    RenderDefaults,
)
from scenes.errors import Location, SceneError
from scenes.parameters import Parameters
from scenes.shapes import Placement, build_shape
from scenes.transforms import Transform, identity, rigid

DEFAULT_REFLECTANCE = 0.5
FILM_LIMIT = 65_535


@dataclass(frozen=True)
class NamedMaterial:
    """A use of a material by its name; resolved once the whole file is read, as in pbrt."""

    name: str
    where: Location


@dataclass(frozen=True, eq=False)
class GraphicsState:
    """What `AttributeBegin` saves and `AttributeEnd` restores."""

    transform: Transform = field(default_factory=identity)
    reverse: bool = False
    material: Diffuse | NamedMaterial | None = None
    emission: Emission | None = None


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A shape of the file with the material it will have."""

    geometry: Geometry
    material: Diffuse | NamedMaterial | None
    emission: Emission | None
    where: Location


@dataclass(eq=False)
class Builder:
    """What has been read of a scene so far."""

    state: GraphicsState = field(default_factory=GraphicsState)
    in_world: bool = False
    camera: PerspectiveCamera | None = None
    film: Film = field(default_factory=lambda: Film(1280, 720))
    defaults: RenderDefaults = field(default_factory=RenderDefaults)
    materials: dict[str, Diffuse] = field(default_factory=dict[str, Diffuse])
    systems: dict[str, Transform] = field(default_factory=dict[str, Transform])
    shapes: list[PlacedShape] = field(default_factory=list[PlacedShape])
    seen: set[str] = field(default_factory=set[str])


Resolve = Callable[[str], Path]
Handler = Callable[[Builder, str, Parameters, Resolve], None]


def _refuse_kind(kind: str, supported: str, parameters: Parameters) -> None:
    if kind not in supported.split():
        allowed = ", ".join(f'"{name}"' for name in supported.split())
        raise SceneError(f'{parameters.owner} "{kind}" is not supported; supported: {allowed}', parameters.where)


def _must_be(
    parameters: Parameters, name: str, value: float | str | bool, allowed: float | str | bool, why: str
) -> None:
    if value != allowed:
        shown = f'"{allowed}"' if isinstance(allowed, str) else str(allowed).lower()
        raise parameters.fail(name, f"{parameters.owner}: {name} must be {shown}: {why}")


def camera(builder: Builder, kind: str, parameters: Parameters, _: Resolve) -> None:
    """`Camera "perspective"`, a pinhole; the transformation may mirror but not stretch."""
    _refuse_kind(kind, "perspective", parameters)
    fov = parameters.number("fov", 90.0)
    if not 0 < fov < 180:
        raise parameters.fail("fov", f"fov is an angle between 0 and 180 degrees, not {fov:g}")
    _must_be(parameters, "lensradius", parameters.number("lensradius", 0.0), 0.0, "the camera is a pinhole")
    parameters.number("focaldistance", 1e6)  # of no effect without a lens
    to_world = rigid(builder.state.transform)
    if to_world is None:
        raise SceneError("the camera's transformation stretches or shears space", parameters.where)
    builder.camera = PerspectiveCamera(to_world, fov)
    builder.systems["camera"] = builder.state.transform.inverted()


def film(builder: Builder, kind: str, parameters: Parameters, _: Resolve) -> None:
    """`Film "rgb"` with the sensor at pbrt's defaults, where an image is linear radiance."""
    _refuse_kind(kind, "rgb", parameters)
    size = [parameters.integer(name, default) for name, default in (("xresolution", 1280), ("yresolution", 720))]
    for name, value in zip(("xresolution", "yresolution"), size, strict=True):
        if not 1 <= value <= FILM_LIMIT:
            raise parameters.fail(name, f"{name} must be between 1 and {FILM_LIMIT} pixels, not {value}")
    radiance = "only there is the image linear radiance"
    _must_be(parameters, "sensor", parameters.text("sensor", "cie1931"), "cie1931", radiance)
    _must_be(parameters, "iso", parameters.number("iso", 100.0), 100.0, radiance)
    _must_be(parameters, "exposuretime", parameters.number("exposuretime", 1.0), 1.0, radiance)
    _must_be(parameters, "whitebalance", parameters.number("whitebalance", 0.0), 0.0, radiance)
    parameters.flag("savefp16", True)  # how pbrt stores its file; images here are float32
    parameters.number("diagonal", 35.0)  # of no effect on a pinhole
    builder.film = Film(size[0], size[1], parameters.text("filename", ""))


def pixel_filter(_: Builder, kind: str, parameters: Parameters, __: Resolve) -> None:
    """`PixelFilter "box"` of one pixel."""
    _refuse_kind(kind, "box", parameters)
    for name in ("xradius", "yradius"):
        _must_be(parameters, name, parameters.number(name, 0.5), 0.5, "the filter is the box of one pixel")


def sampler(builder: Builder, kind: str, parameters: Parameters, _: Resolve) -> None:
    """`Sampler`: a default that a request may override; each of pbrt's Sobol' samplers stands for ours."""
    _refuse_kind(kind, "independent sobol paddedsobol zsobol", parameters)
    spp, seed = parameters.integer("pixelsamples", 16), parameters.integer("seed", 0)
    if spp < 1:
        raise parameters.fail("pixelsamples", f"pixelsamples must be at least 1, not {spp}")
    if seed < 0:
        raise parameters.fail("seed", f"seed must not be negative: {seed}")
    if kind != "independent" and parameters.text("randomization", "fastowen") not in ("fastowen", "owen"):
        raise parameters.fail("randomization", 'randomization must be "fastowen" or "owen": points are Owen-scrambled')
    builder.defaults = RenderDefaults("independent" if kind == "independent" else "sobol", spp, seed)


def integrator(_: Builder, kind: str, parameters: Parameters, __: Resolve) -> None:
    """`Integrator "path"` to depth 1, which is direct light and visible emission."""
    _refuse_kind(kind, "path simplepath", parameters)
    depth = parameters.integer("maxdepth", 5)
    if depth != 1:
        given = "" if parameters.given("maxdepth") else " (pbrt's default)"
        raise parameters.fail("maxdepth", f'maxdepth is {depth}{given}: only direct light, "integer maxdepth" [ 1 ]')


def material(builder: Builder, kind: str, parameters: Parameters, _: Resolve) -> None:
    """`Material "diffuse"`."""
    builder.state = replace(builder.state, material=_diffuse(kind, parameters))


def make_named_material(builder: Builder, name: str, parameters: Parameters, _: Resolve) -> None:
    """`MakeNamedMaterial "name" "string type" "diffuse"`."""
    if name in builder.materials:
        raise SceneError(f'material "{name}" is made twice', parameters.where)
    if not parameters.given("type"):
        raise SceneError(f'MakeNamedMaterial "{name}" needs "string type"', parameters.where)
    builder.materials[name] = _diffuse(parameters.text("type", ""), parameters)


def _diffuse(kind: str, parameters: Parameters) -> Diffuse:
    _refuse_kind(kind, "diffuse", parameters)
    reflectance = parameters.rgb("reflectance", DEFAULT_REFLECTANCE)
    if reflectance.max() > 1:
        raise parameters.fail("reflectance", f"a reflectance is at most 1, not {reflectance.max():g}")
    return Diffuse(reflectance)


def area_light(builder: Builder, kind: str, parameters: Parameters, _: Resolve) -> None:
    """`AreaLightSource "diffuse"`: radiance for the shapes that follow in this attribute block."""
    _refuse_kind(kind, "diffuse", parameters)
    radiance, factor = parameters.rgb("L", 1.0), parameters.number("scale", 1.0)
    if factor < 0:
        raise parameters.fail("scale", f"scale must not be negative: {factor:g}")
    if parameters.given("power"):
        raise parameters.fail("power", 'power is not supported: give the radiance, "rgb L"')
    if radiance.max() * factor > 1e30:
        raise parameters.fail("L", "the radiance is beyond 1e30, the largest that float32 images can average")
    emission = Emission(radiance * factor, parameters.flag("twosided", False))
    builder.state = replace(builder.state, emission=emission)


def shape(builder: Builder, kind: str, parameters: Parameters, resolve: Resolve) -> None:
    """`Shape`: its geometry in world space, with the material and the emission of the moment."""
    state = builder.state
    parameters.owner = kind
    placement = Placement(state.transform, state.reverse, state.emission, resolve)
    builder.shapes += [
        PlacedShape(geometry, state.material, state.emission, parameters.where)
        for geometry in build_shape(kind, parameters, placement)
    ]


OPTIONS: dict[str, Handler] = {
    "Camera": camera,
    "Film": film,
    "PixelFilter": pixel_filter,
    "Sampler": sampler,
    "Integrator": integrator,
}
WORLD: dict[str, Handler] = {
    "Material": material,
    "MakeNamedMaterial": make_named_material,
    "AreaLightSource": area_light,
    "Shape": shape,
}
