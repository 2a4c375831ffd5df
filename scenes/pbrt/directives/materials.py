"""`Material` and `MakeNamedMaterial`: diffuse and rough conductors, as pbrt-v4 reads them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.materials import Conductor, Diffuse, Material
from scenes.errors import Location, PenumbraError, SceneError
from scenes.pbrt.directives.textures import named_texture
from scenes.pbrt.spectra import colour, colour_of, samples, spectrum_name
from scenes.pbrt.state import (
    DEFAULT_REFLECTANCE,
    Builder,
    MaterialUse,
    NamedMaterial,
    TexturedDiffuse,
    check_room,
    refuse_kind,
)
from scenes.pbrt.text.parameters import Parameter, Parameters

Array = NDArray[np.float64]

SMOOTH = 1e-3  # below this alpha pbrt-v4 reflects like a perfect mirror


def material(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`Material`."""
    builder.state = replace(builder.state, material=Diffuse(np.full(3, DEFAULT_REFLECTANCE)))
    builder.state = replace(builder.state, material=_made(kind, parameters))


def make_named_material(builder: Builder, name: str, parameters: Parameters) -> None:
    """`MakeNamedMaterial "name" "string type" "diffuse"`."""
    if name in builder.materials:
        raise SceneError(f'material "{name}" is made twice', parameters.where)
    check_room(builder.materials, "materials", parameters.where)
    if not parameters.given("type"):
        raise SceneError(f'MakeNamedMaterial "{name}" needs "string type"', parameters.where)
    builder.materials[name] = Diffuse(np.full(3, DEFAULT_REFLECTANCE))
    builder.materials[name] = _made(parameters.text("type", ""), parameters)


def _made(kind: str, parameters: Parameters) -> MaterialUse:
    refuse_kind(kind, "diffuse conductor", parameters)
    return _diffuse(parameters) if kind == "diffuse" else _conductor(parameters)


def _diffuse(parameters: Parameters) -> MaterialUse:
    parameter = parameters.take("reflectance", "rgb", "spectrum", "texture")
    if parameter is None:
        return Diffuse(np.full(3, DEFAULT_REFLECTANCE))
    if parameter.type != "texture":
        return Diffuse(colour_of(parameters, parameter, "reflectance"))
    return TexturedDiffuse(parameters.text_of(parameter), parameter.where)


def _conductor(parameters: Parameters) -> Conductor:
    from scenes import color  # here, because most scenes name no metals and its tables take time

    alpha = _alpha(parameters)
    reflectance = colour(parameters, "reflectance", "reflectance")
    eta, k = (parameters.take(name, "rgb", "spectrum") for name in ("eta", "k"))
    if reflectance is not None:
        if eta is not None or k is not None:
            raise parameters.fail("reflectance", "a conductor has either reflectance or eta and k, not both")
        return Conductor(*color.conductor_of_reflectance(reflectance), alpha)
    found = _refractive_index(parameters, eta, k)
    if not np.all(found[0] > 0):
        raise parameters.fail("eta", "eta must be positive for red, green and blue")
    return Conductor(*found, alpha)


def _refractive_index(
    parameters: Parameters, eta: Parameter | None, k: Parameter | None
) -> tuple[Array, Array]:
    """eta and k, (3,) each; two spectra are projected together, which gives the colour of their
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
        raise parameters.fail("eta", str(error)) from None
    return parts[0], parts[1]


def _is_spectrum(parameter: Parameter | None) -> bool:
    return parameter is None or parameter.type == "spectrum"


def _tabulated(parameters: Parameters, parameter: Parameter) -> Array:
    """A listed spectrum at 360, 361 ... 830 nm, with its end values beyond its list."""
    wavelengths, values = samples(parameters, parameter)
    return np.interp(np.linspace(360.0, 830.0, 471), wavelengths, values)


def _alpha(parameters: Parameters) -> float:
    """Of the microfacet distribution; the same both ways, and no mirror."""
    roughness = parameters.number("roughness", 0.0)
    u, v = parameters.number("uroughness", roughness), parameters.number("vroughness", roughness)
    remap = parameters.flag("remaproughness", True)
    if min(u, v) < 0:
        name = next(name for name in ("uroughness", "vroughness", "roughness") if parameters.given(name))
        raise parameters.fail(name, f"{name} must not be negative")
    if u != v:
        parameters.unsupported(
            "uroughness",
            f"uroughness {u:g} and vroughness {v:g} differ: only isotropic conductors are supported",
        )
    alpha = float(np.sqrt(u)) if remap else u
    given = next(
        (name for name in ("roughness", "uroughness", "vroughness") if parameters.given(name)), "roughness"
    )
    if alpha >= SMOOTH or given in parameters.refused:
        return max(alpha, SMOOTH)
    least = f"{SMOOTH**2 if remap else SMOOTH:g}"
    shown = f"roughness {u:g}" if parameters.given(given) else "no roughness (pbrt's default is 0)"
    parameters.unsupported(
        given,
        (
            f"a conductor of {shown} is a perfect mirror, which is not supported: roughness of at least "
            f"{least} is"
        ),
    )
    return SMOOTH


def resolved(use: MaterialUse, builder: Builder) -> Material:
    """The material that a use stands for, its names looked up; SceneError where there is no such name."""
    if isinstance(use, NamedMaterial):
        use = _named(use.name, use.where, builder.materials)
    if isinstance(use, NamedMaterial):
        raise SceneError(f"material {use.name!r} stands for another name", use.where)
    if isinstance(use, TexturedDiffuse):
        found = named_texture(builder, "spectrum", use.texture, use.where).value
        if found is None:
            return Diffuse(np.full(3, DEFAULT_REFLECTANCE))
        return Diffuse(np.clip(found, 0.0, 1.0) if isinstance(found, np.ndarray) else found)
    return use


def _named(name: str, where: Location, materials: Mapping[str, MaterialUse]) -> MaterialUse:
    if name not in materials:
        raise SceneError(
            f"no material is called {name!r}; there are: {', '.join(materials) or 'none'}", where
        )
    return materials[name]
