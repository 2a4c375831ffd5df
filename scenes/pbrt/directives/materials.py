"""`Material` and `MakeNamedMaterial`, read as pbrt-v4 does and written back."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import singledispatch
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from scenes.description.materials import (
    SMOOTHEST,
    Coated,
    Conductor,
    Dielectric,
    Diffuse,
    DiffuseTransmission,
    Material,
    Microfacets,
    MixedMaterial,
    Roughness,
)
from scenes.description.normal_perturbation import BumpMap, NormalMap, NormalPerturbation
from scenes.description.textures import Texture
from scenes.errors import Location, PenumbraError, SceneError
from scenes.pbrt.directives.stand_ins import hair, measured, subsurface
from scenes.pbrt.directives.texels import normals_of
from scenes.pbrt.directives.textures import TextureWriter, named_texture
from scenes.pbrt.spectra import colour, colour_of, index_of, samples, spectrum_name
from scenes.pbrt.state import (
    DEFAULT_REFLECTANCE,
    Builder,
    Interface,
    MaterialUse,
    MixedUse,
    NamedMaterial,
    NamedNumbers,
    Pending,
    PerturbedUse,
    TexturedDiffuse,
    check_room,
    refuse_kind,
)
from scenes.pbrt.text.parameters import Parameter, Parameters
from scenes.pbrt.write.text import numbers

Array = NDArray[np.float64]

LEAST = 1e-4  # the least alpha of a surface that is not
BUMPS = "in pbrt the bumps of a displacement hang on the size of a pixel a little: here their slopes do not"
# Alpha of a coat, and by how many percent of what it lets through pbrt's image is darker at most: measured.
WALKS = ((0.03, 0.1, 0.3, 1.0), (1.0, 4.0, 10.0, 17.0))
BRIGHT_WALKS = (
    "under a sky pbrt's own image is darker, by up to {:.0f} % of what this rough coat lets through: pbrt's "
    "samples of its walks fall short of its BSDF, to which this image holds. Under small lights they agree"
)


def material(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`Material`."""
    builder.state = replace(builder.state, material=Diffuse(np.full(3, DEFAULT_REFLECTANCE)))
    builder.state = replace(
        builder.state, material=_with_perturbation(builder, _made(kind, parameters), parameters)
    )


def kinds() -> tuple[str, ...]:
    """The kinds of material that are read."""
    return tuple(_KINDS)


def make_named_material(builder: Builder, name: str, parameters: Parameters) -> None:
    """`MakeNamedMaterial "name" "string type" "diffuse"`."""
    if name in builder.materials:
        raise SceneError(f'material "{name}" is made twice', parameters.where)
    check_room(builder.materials, "materials", parameters.where)
    if not parameters.given("type"):
        raise SceneError(f'MakeNamedMaterial "{name}" needs "string type"', parameters.where)
    builder.materials[name] = Diffuse(np.full(3, DEFAULT_REFLECTANCE))
    made = _made(parameters.text("type", ""), parameters)
    builder.materials[name] = _with_perturbation(builder, made, parameters)


def _made(kind: str, parameters: Parameters) -> MaterialUse:
    kind = "interface" if kind in ("", "none") else kind
    refuse_kind(kind, " ".join(_KINDS), parameters)
    return _KINDS[kind](parameters)


def _with_perturbation(builder: Builder, made: MaterialUse, parameters: Parameters) -> MaterialUse:
    """The material with its normal map or, without one, its displacement."""
    if isinstance(made, Interface | NamedMaterial | PerturbedUse | MixedUse):
        return made
    name, displacement = parameters.text("normalmap", ""), parameters.take("displacement", "texture")
    if name:
        return PerturbedUse(made, NormalMap(normals_of(builder, parameters, name)))
    if displacement is None:
        return made
    parameters.remark("displacement", BUMPS)
    return PerturbedUse(made, NamedNumbers(parameters.text_of(displacement), displacement.where))


def _diffuse(parameters: Parameters) -> MaterialUse:
    parameter = parameters.take("reflectance", "rgb", "spectrum", "texture")
    if parameter is None:
        return Diffuse(np.full(3, DEFAULT_REFLECTANCE))
    if parameter.type != "texture":
        return Diffuse(colour_of(parameters, parameter, "reflectance"))
    return TexturedDiffuse(parameters.text_of(parameter), parameter.where)


HALF_OF_A_SHEET = 0.25  # pbrt's default of either part


def _diffuse_transmission(parameters: Parameters) -> MaterialUse:
    reflectance, transmittance = (
        _texture(parameters, "spectrum", part, HALF_OF_A_SHEET) for part in ("reflectance", "transmittance")
    )
    scale = parameters.number("scale", 1.0)
    return Pending(lambda builder: DiffuseTransmission(reflectance(builder), transmittance(builder), scale))


def _texture(parameters: Parameters, type_: str, name: str, default: float) -> Callable[[Builder], Texture]:
    """A constant or the texture of a name, which is looked up when the file is read."""
    types = ("float",) if type_ == "float" else ("rgb", "spectrum")
    parameter = parameters.take(name, *types, "texture")
    value = np.full(3, default)
    if parameter is None or parameter.type != "texture":
        if parameter is not None and type_ == "float":
            value = np.full(3, parameters.number(name, default))
        elif parameter is not None:
            value = colour_of(parameters, parameter, "reflectance")
        return lambda builder: value
    texture, where = parameters.text_of(parameter), parameter.where

    def found(builder: Builder) -> Texture:
        made = named_texture(builder, type_, texture, where).value
        return value if made is None else made

    return found


def _mix(parameters: Parameters) -> MaterialUse:
    names = parameters.texts("materials")
    if len(names) != 2:
        raise parameters.fail("materials", f'a mix needs "string materials", two names, not {len(names)}')
    where = parameters.located("materials")
    first, second = (NamedMaterial(name, where) for name in names)
    return MixedUse(first, second, _texture(parameters, "float", "amount", 0.5))


def _bare_conductor(parameters: Parameters) -> MaterialUse:
    metal, rough = _rough_conductor(parameters, "")
    return metal if rough is None else Pending(lambda builder: _roughened(metal, rough, builder))


def _rough_conductor(parameters: Parameters, part: str) -> tuple[Conductor, RoughUse | None]:
    """A metal, with its roughness if textures give it."""
    rough = _textured_roughness(parameters, part)
    return _conductor(parameters, part, None if rough is None else (1.0, None)), rough


def _conductor(
    parameters: Parameters, part: str = "", alpha: tuple[float, float | None] | None = None
) -> Conductor:
    """A metal. part: the beginning of its parameters' names, except that of its reflectance. alpha: None if
    parameters give it.
    """
    from scenes import color  # here, because most scenes name no metals and its tables take time

    alpha = _alpha(parameters, part) if alpha is None else alpha
    reflectance = colour(parameters, "reflectance", "reflectance")
    eta, k = (parameters.take(part + name, "rgb", "spectrum") for name in ("eta", "k"))
    if reflectance is not None:
        if eta is not None or k is not None:
            raise parameters.fail("reflectance", "a conductor has either reflectance or eta and k, not both")
        return Conductor(*color.conductor_of_reflectance(reflectance), *alpha)
    found = _refractive_index(parameters, eta, k)
    if not np.all(found[0] > 0):
        raise parameters.fail(f"{part}eta", "eta must be positive for red, green and blue")
    return Conductor(*found, *alpha)


def _refractive_index(
    parameters: Parameters, eta: Parameter | None, k: Parameter | None
) -> tuple[Array, Array]:
    """eta and k, (3,) each. Two spectra are projected together, which keeps the colour of their
    reflectance.
    """
    from scenes import color

    try:
        if _is_spectrum(eta) and _is_spectrum(k):
            names = [
                name if p is None else spectrum_name(p)
                for p, name in ((eta, "metal-Cu-eta"), (k, "metal-Cu-k"))
            ]
            metal = str(names[0]).removesuffix("-eta")
            if metal in color.METALS and names == [f"{metal}-eta", f"{metal}-k"]:
                return color.metal(metal)
            if eta is not None and k is not None and names == [None, None]:
                return color.conductor(_tabulated(parameters, eta), _tabulated(parameters, k))
        parts = [
            color.named(default, role="unbounded") if p is None else colour_of(parameters, p, "unbounded")
            for p, default in ((eta, "metal-Cu-eta"), (k, "metal-Cu-k"))
        ]
    except SceneError:
        raise
    except PenumbraError as error:
        raise SceneError(str(error), parameters.where if eta is None else eta.where) from None
    return parts[0], parts[1]


def _is_spectrum(parameter: Parameter | None) -> bool:
    return parameter is None or parameter.type == "spectrum"


def _tabulated(parameters: Parameters, parameter: Parameter) -> Array:
    """A listed spectrum at 360, 361 ... 830 nm, with its end values outside its list."""
    wavelengths, values = samples(parameters, parameter)
    return np.interp(np.linspace(360.0, 830.0, 471), wavelengths, values)


def _alpha(parameters: Parameters, part: str = "") -> tuple[float, float | None]:
    """The alphas along dp/du and across, None for the second if equal; 0 for a surface that pbrt takes for
    smooth. part: as of `_conductor`.
    """
    along_u, along_v, both = _roughnesses(part)
    roughness = parameters.number(both, 0.0)
    u, v = parameters.number(along_u, roughness), parameters.number(along_v, roughness)
    remap = parameters.flag("remaproughness", True)
    if min(u, v) < 0:
        name = next(name for name in _roughnesses(part) if parameters.given(name))
        raise parameters.fail(name, f"{name} must not be negative")
    return _alphas(u, v, remap)


def _alphas(u: float, v: float, remap: bool) -> tuple[float, float | None]:
    """The alphas of roughnesses. Negative ones, which only textures give, count as 0."""
    along, across = (max(one, 0.0) for one in (u, v))
    along, across = (float(np.sqrt(one)) if remap else one for one in (along, across))
    if max(along, across) < SMOOTHEST:
        return 0.0, None
    along, across = max(along, LEAST), max(across, LEAST)
    return along, None if along == across else across


NumberUse = float | NamedNumbers
RoughUse = tuple[NumberUse, NumberUse | None, bool]


def _textured_roughness(parameters: Parameters, part: str = "") -> RoughUse | None:
    """The textures u and v and `remaproughness`; None if no texture gives the roughness. part: as of
    `_conductor`.
    """
    along_u, along_v, both = (parameters.take(name, "float", "texture") for name in _roughnesses(part))
    u, v = along_u or both, along_v or both
    if all(one is None or one.type == "float" for one in (u, v)):
        return None
    remap = parameters.flag("remaproughness", True)
    ends = [_number_or_name(parameters, one, 0.0) for one in (u, v)]
    return ends[0], None if u is v else ends[1], remap


def _number_or_name(parameters: Parameters, given: Parameter | None, default: float) -> NumberUse:
    if given is None:
        return default
    if given.type == "texture":
        return NamedNumbers(parameters.text_of(given), given.where)
    return parameters.number(given.name, 0.0)


def _roughnesses(part: str) -> tuple[str, str, str]:
    return f"{part}uroughness", f"{part}vroughness", f"{part}roughness"


def _dielectric(parameters: Parameters) -> MaterialUse:
    rough = _textured_roughness(parameters)
    glass = _glass(parameters, *(_alpha(parameters) if rough is None else (1.0, None)))
    return glass if rough is None else Pending(lambda builder: _roughened(glass, rough, builder))


def _thin_dielectric(parameters: Parameters) -> Dielectric:
    return _glass(parameters, 0.0, None, thin=True)


def _glass(parameters: Parameters, alpha: float, alpha_v: float | None, thin: bool = False) -> Dielectric:
    eta = _index(parameters, "eta")
    if not eta > 0:
        raise parameters.fail("eta", f"eta must be positive, not {eta:g}")
    return Dielectric(eta, alpha, thin, alpha_v)


def _index(parameters: Parameters, name: str) -> float:
    """A refractive index: a number or a spectrum."""
    parameter = parameters.take(name, "float", "rgb", "spectrum")
    if parameter is None or parameter.type == "float":
        return parameters.number(name, 1.5)
    return index_of(parameters, parameter)


def _coated_diffuse(parameters: Parameters) -> MaterialUse:
    base = _diffuse(parameters)
    coated, finish = _coated(parameters, "")
    if isinstance(base, Diffuse) and finish is None:
        return replace(coated, base=base)

    def made(builder: Builder) -> Coated:
        found = resolve_material(base, builder)
        assert isinstance(found, Diffuse)
        whole = replace(coated, base=found)
        return whole if finish is None else finish(whole, builder)

    return Pending(made)


def _coated_conductor(parameters: Parameters) -> MaterialUse:
    base, rough = _rough_conductor(parameters, "conductor.")
    coated, finish = _coated(parameters, "interface.")
    coated = replace(coated, base=base)
    if rough is None and finish is None:
        return coated

    def made(builder: Builder) -> Coated:
        whole = coated if rough is None else replace(coated, base=_roughened(base, rough, builder))
        return whole if finish is None else finish(whole, builder)

    return Pending(made)


Finish = Callable[[Coated, Builder], Coated]


def _coated(parameters: Parameters, part: str) -> tuple[Coated, Finish | None]:
    """A coat over gray, and a function that sets its textures once they are known, None without textures.
    part: the beginning of the boundary's parameter names.
    """
    rough = _textured_roughness(parameters, part)
    alpha, alpha_v = _alpha(parameters, part) if rough is None else (1.0, None)
    if alpha:
        share = float(np.interp(math.log(max(alpha, alpha_v or 0.0)), np.log(WALKS[0]), WALKS[1]))
        given = next(name for name in _roughnesses(part) if parameters.given(name))
        parameters.note(given, BRIGHT_WALKS.format(share))
    eta = _index(parameters, f"{part}eta")
    if eta < 0:
        raise parameters.fail(f"{part}eta", f"{part}eta must be positive, not {eta:g}")
    albedo = parameters.take("albedo", "rgb", "spectrum", "texture")
    thickness, g = (
        _number_or_name(parameters, parameters.take(name, "float", "texture"), default)
        for name, default in (("thickness", 0.01), ("g", 0.0))
    )
    depth, walks = parameters.integer("maxdepth", 10), parameters.integer("nsamples", 1)
    if walks < 1:
        raise parameters.fail("nsamples", f"nsamples must be at least 1, not {walks}")
    named = {"thickness": thickness, "g": g}
    named = {name: use for name, use in named.items() if isinstance(use, NamedNumbers)}
    textured = albedo is not None and albedo.type == "texture"
    coated = Coated(
        Dielectric(eta or 1.0, alpha, alpha_v=alpha_v),  # pbrt too takes 0 for 1
        Diffuse(np.full(3, DEFAULT_REFLECTANCE)),
        0.0 if isinstance(thickness, NamedNumbers) else max(thickness, 0.0),
        np.zeros(3) if albedo is None or textured else colour_of(parameters, albedo, "reflectance"),
        0.0 if isinstance(g, NamedNumbers) else float(np.clip(g, -1.0, 1.0)),
        max(depth, 0),
        walks,
    )

    def finish(whole: Coated, builder: Builder) -> Coated:
        coat = whole.coat if rough is None else _roughened(whole.coat, rough, builder)
        layer: dict[str, Any] = {name: _numbers_of(use, builder) for name, use in named.items()}
        if albedo is not None and textured:
            found = named_texture(builder, "spectrum", parameters.text_of(albedo), albedo.where).value
            layer["albedo"] = np.zeros(3) if found is None else found
        return replace(whole, coat=coat, **layer)

    return coated, finish if rough or named or textured else None


def _interface(parameters: Parameters) -> Interface:
    parameters.ignore()  # as pbrt does
    return Interface()


DEEPEST_MIX = 6  # mixes within mixes: 64 materials


def _mixed(use: MixedUse, builder: Builder, within: tuple[str, ...]) -> MixedMaterial:
    """The material of a mix. within: the names of the mixes around it."""
    parts: list[Material] = []
    for part in (use.first, use.second):
        if part.name in within:
            raise SceneError(f"the mix {part.name!r} is made of itself", part.where)
        if len(within) >= DEEPEST_MIX:
            raise SceneError(f"mixes of mixes go {DEEPEST_MIX} deep at most", part.where)
        found = _found(part, builder)
        if isinstance(found, Interface):
            raise SceneError('a mix with a material "interface" is not supported', part.where)
        parts.append(resolve_material(found, builder, (*within, part.name)))
    perturbations = resolve_perturbation(use.first, builder), resolve_perturbation(use.second, builder)
    return MixedMaterial(parts[0], parts[1], use.amount(builder), perturbations)


def resolve_material(use: MaterialUse, builder: Builder, within: tuple[str, ...] = ()) -> Material:
    """The material of a use, with its names looked up. within: the names of the mixes around it. SceneError
    for an unknown name.
    """
    if isinstance(use, NamedMaterial):
        within = (*within, use.name)
    use = _found(use, builder)
    if isinstance(use, MixedUse):
        return _mixed(use, builder, within)
    if isinstance(use, PerturbedUse):
        use = use.material
    if isinstance(use, NamedMaterial):
        raise SceneError(f"material {use.name!r} stands for another name", use.where)
    if isinstance(use, Interface):
        raise TypeError("a shape that light passes through has no material: leave it out first")
    if isinstance(use, Pending):
        return use.make(builder)
    if isinstance(use, TexturedDiffuse):
        found = named_texture(builder, "spectrum", use.texture, use.where).value
        if found is None:
            found = np.full(3, DEFAULT_REFLECTANCE)
        return Diffuse(np.clip(found, 0.0, 1.0) if isinstance(found, np.ndarray) else found)
    return use


Rough = TypeVar("Rough", Conductor, Dielectric)


def _roughened(bare: Rough, rough: RoughUse, builder: Builder) -> Rough:
    """The material with the textures of its roughness; constant ones become alphas."""
    u, v, remap = rough
    along, across = _numbers_of(u, builder), None if v is None else _numbers_of(v, builder)
    if isinstance(along, np.ndarray) and (across is None or isinstance(across, np.ndarray)):
        alpha, alpha_v = _alphas(float(along[0]), float(along[0] if across is None else across[0]), remap)
        return replace(bare, alpha=alpha, alpha_v=alpha_v)
    varying = Roughness(along, across, remap)
    alpha, alpha_v = varying.mean_alphas()
    return replace(bare, alpha=alpha, alpha_v=alpha_v, varying=varying)


def _numbers_of(given: NumberUse, builder: Builder) -> Texture:
    if not isinstance(given, NamedNumbers):
        return np.full(3, given)
    found = named_texture(builder, "float", given.texture, given.where).value
    return np.full(3, 0.0) if found is None else found


def resolve_perturbation(use: MaterialUse, builder: Builder) -> NormalPerturbation | None:
    """The normal map or bump map of a material. SceneError for an unknown texture."""
    use = _found(use, builder)
    if not isinstance(use, PerturbedUse):
        return None
    if isinstance(use.perturbation, NormalMap):
        return use.perturbation
    found = named_texture(builder, "float", use.perturbation.texture, use.perturbation.where).value
    return None if found is None or isinstance(found, np.ndarray) else BumpMap(found)


def _found(use: MaterialUse, builder: Builder) -> MaterialUse:
    return _named(use.name, use.where, builder.materials) if isinstance(use, NamedMaterial) else use


def _named(name: str, where: Location, materials: Mapping[str, MaterialUse]) -> MaterialUse:
    if name not in materials:
        raise SceneError(
            f"no material is called {name!r}; there are: {', '.join(materials) or 'none'}", where
        )
    return materials[name]


_KINDS: dict[str, Callable[[Parameters], MaterialUse]] = {
    "diffuse": _diffuse,
    "conductor": _bare_conductor,
    "dielectric": _dielectric,
    "thindielectric": _thin_dielectric,
    "coateddiffuse": _coated_diffuse,
    "coatedconductor": _coated_conductor,
    "diffusetransmission": _diffuse_transmission,
    "mix": _mix,
    "interface": _interface,
    "subsurface": subsurface,
    "measured": measured,
    "hair": hair,
}


@singledispatch
def material_text(material: Material, textures: TextureWriter) -> list[str]:
    """The textures that are new, and the `Material` that reads back as this one, bit for bit."""
    raise TypeError(f"no pbrt text is known for a {type(material).__name__}")


@material_text.register
def _(material: Diffuse, textures: TextureWriter) -> list[str]:
    lines: list[str] = []
    reflectance = textures.parameter("spectrum", "reflectance", material.reflectance, lines)
    return [*lines, f'Material "diffuse" {reflectance}']


@material_text.register
def _(material: DiffuseTransmission, textures: TextureWriter) -> list[str]:
    lines: list[str] = []
    parts = {"reflectance": material.reflectance, "transmittance": material.transmittance}
    text = " ".join(textures.parameter("spectrum", name, part, lines) for name, part in parts.items())
    return [*lines, f'Material "diffusetransmission" {text} "float scale" [ {material.scale!r} ]']


@material_text.register
def _(material: MixedMaterial, textures: TextureWriter) -> list[str]:
    lines: list[str] = []
    names: list[str] = []
    for part, perturbation in zip(material.parts, material.perturbations, strict=True):
        *before, text = material_text(part, textures)
        if perturbation is not None:
            text = f"{text} {perturbation_text(perturbation, textures, before)}"
        name, new = textures.material_name(text)
        names.append(name)
        lines += before
        if new:
            kind, _, rest = text.removeprefix("Material ").partition(" ")
            lines.append(f'MakeNamedMaterial {name} "string type" {kind} {rest}')
    amount = textures.parameter("float", "amount", material.amount, lines)
    return [*lines, f'Material "mix" "string materials" [ {" ".join(names)} ] {amount}']


@material_text.register
def _(material: Conductor, textures: TextureWriter) -> list[str]:
    lines: list[str] = []
    rough = _roughness_text({"": material}, textures, lines)
    return [*lines, f'Material "conductor" {_optical_text(material, "")} {rough}']


@material_text.register
def _(material: Dielectric, textures: TextureWriter) -> list[str]:
    eta = f'"float eta" [ {material.eta!r} ]'
    if material.thin:
        return [f'Material "thindielectric" {eta}']
    lines: list[str] = []
    rough = _roughness_text({"": material}, textures, lines)
    return [*lines, f'Material "dielectric" {eta} {rough}']


@material_text.register
def _(material: Coated, textures: TextureWriter) -> list[str]:
    lines: list[str] = []
    rough: Mapping[str, Microfacets]
    if isinstance(material.base, Diffuse):
        kind, part, rough = "coateddiffuse", "", {"": material.coat}
        base = textures.parameter("spectrum", "reflectance", material.base.reflectance, lines)
    else:
        kind, part = "coatedconductor", "interface."
        base = _optical_text(material.base, "conductor.")
        rough = {"conductor.": material.base, part: material.coat}
    coat = f'"float {part}eta" [ {material.coat.eta!r} ] {_roughness_text(rough, textures, lines)}'
    layer: dict[str, tuple[str, Texture]] = {"albedo": ("spectrum", material.albedo)}
    for name, one in (("g", material.g), ("thickness", material.thickness)):
        layer[name] = ("float", np.full(3, one) if isinstance(one, float | int) else one)
    medium = textures.parameters(layer, lines)
    walk = f'"integer maxdepth" [ {material.max_depth} ] "integer nsamples" [ {material.samples} ]'
    return [*lines, f'Material "{kind}" {base} {coat} {medium} {walk}']


def _optical_text(metal: Conductor, part: str) -> str:
    return f'"rgb {part}eta" [ {numbers(metal.eta)} ] "rgb {part}k" [ {numbers(metal.k)} ]'


def _roughness_text(parts: Mapping[str, Microfacets], textures: TextureWriter, lines: list[str]) -> str:
    """The roughness parameters of boundaries, by the beginning of their names. One `remaproughness` serves
    them all, since sqrt(alpha^2) is alpha, bit for bit.
    """
    remap = any(one.varying is not None and one.varying.remap for one in parts.values())
    text: list[str] = []
    for part, one in parts.items():
        along_u, along_v, both = _roughnesses(part)
        u, v = (
            (one.varying.u, one.varying.v)
            if one.varying is not None
            else (
                None if alpha is None else np.full(3, alpha * alpha if remap else alpha)
                for alpha in (one.alpha, one.alpha_v)
            )
        )
        assert u is not None
        named = {both: ("float", u)} if v is None else {along_u: ("float", u), along_v: ("float", v)}
        text.append(textures.parameters(named, lines))
    return " ".join([*text, f'"bool remaproughness" [ {str(remap).lower()} ]'])


def perturbation_text(perturbation: NormalPerturbation, textures: TextureWriter, lines: list[str]) -> str:
    """The parameter of a `Material` that reads back as its normal or bump map; new textures go to `lines`."""
    if isinstance(perturbation, NormalMap):
        return f'"string normalmap" {textures.files.add(perturbation.image)}'
    return textures.parameter("float", "displacement", perturbation.displacement, lines)
