"""Colours of a scene file: `rgb`, `blackbody`, and `spectrum` by pairs, by name or by file.

Light is normalised as by pbrt-v4: `rgb L [1 2 3]` reads 1, 2, 3 in the image, and any other spectrum has
luminance 1 before `scale` and `power`.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenes.errors import PenumbraError, SceneError
from scenes.files import read_bytes
from scenes.pbrt.text.lexer import Token
from scenes.pbrt.text.numbers import Values
from scenes.pbrt.text.parameters import SRGB, Parameter, Parameters
from scenes.pbrt.text.template import NUMBER

Array = NDArray[np.float64]
Role = Literal["illuminant", "absolute", "reflectance", "unbounded"]  # as `scenes.color` has them

HELIUM = 587.6  # nm, the yellow line at which catalogues give an index of refraction
WAVELENGTHS = np.linspace(360.0, 830.0, 471)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB


def colour(parameters: Parameters, name: str, role: Role, first: bool = False) -> Array | None:
    """A colour, (3,) float64 of linear sRGB, None if not given. first: take the first of several, as pbrt
    does for an infinite light. SceneError for a component that is negative or too large for its role.
    """
    parameter = parameters.take(name, "rgb", "spectrum", "blackbody")
    return None if parameter is None else colour_of(parameters, parameter, role, first)


def colour_of(parameters: Parameters, parameter: Parameter, role: Role, first: bool = False) -> Array:
    """The colour of a parameter that was taken; see `colour`."""
    size = {"rgb": 3, "blackbody": 1}.get(parameter.type, 0)
    if first and size and len(parameter.values) > size and len(parameter.values) % size == 0:
        parameters.remark(parameter.name, f"{parameter} has several values: the first holds, as in pbrt")
        kept = list(islice(iter(parameter.values), size))
        parameter = replace(parameter, values=Values(kept))
    if parameter.type == "rgb":
        return _rgb(parameters, parameter, role)
    try:
        if parameter.type == "blackbody":
            return _blackbody(parameters, parameter, role)
        return _spectrum(parameters, parameter, role)
    except SceneError:
        raise
    except PenumbraError as error:
        raise SceneError(f"{parameter}: {error}", parameter.where) from None


def _rgb(parameters: Parameters, parameter: Parameter, role: Role) -> Array:
    if len(parameter.values) != 3:
        raise SceneError(f"{parameter} takes three numbers, not {len(parameter.values)}", parameter.where)
    values = parameters.values(parameter)
    for token, value in zip(parameter.values, values, strict=True):
        if value < 0:
            raise SceneError(f"{parameter} is negative: {value:g}", token.where)
    if role == "reflectance" and values.max() > 1:
        raise SceneError(f"a reflectance is at most 1, not {values.max():g}", parameter.where)
    if parameter.space == SRGB:
        return values + 0.0
    from scenes import color

    return color.from_space(parameter.space, values, 1.0 if role == "reflectance" else np.inf, role)


def _blackbody(parameters: Parameters, parameter: Parameter, role: Role) -> Array:
    from scenes import color  # here, because most scenes name no spectra and its tables take time

    values = parameters.values(parameter)
    if len(values) != 1:
        raise SceneError(
            f"{parameter} takes one temperature in kelvin, not {len(values)} numbers; a factor is a `scale`",
            parameter.where,
        )
    if not values[0] > 0:
        raise SceneError(
            f"{parameter}: a temperature is positive, in kelvin, not {values[0]:g}", parameter.where
        )
    return color.blackbody(float(values[0]), role)


def _spectrum(parameters: Parameters, parameter: Parameter, role: Role) -> Array:
    from scenes import color

    name = spectrum_name(parameter)
    if name is not None:
        return color.named(name, role=role)
    wavelengths, values = samples(parameters, parameter)
    return color.sampled(wavelengths, values, role=role)


def spectrum_name(parameter: Parameter) -> str | None:
    """The name that a `spectrum` gives; None for one that lists its samples or names a file of them."""
    first = next(iter(parameter.values), None)
    if first is None or first.kind != "string" or _is_file(first):
        return None
    if len(parameter.values) != 1:
        raise SceneError(f"{parameter} takes one name, not {len(parameter.values)}", parameter.where)
    return first.text


def _is_file(token: Token) -> bool:
    """Whether a name is that of a file: pbrt takes any name outside its own list, none of which has a suffix,
    for a file.
    """
    return token.kind == "string" and Path(token.text).suffix != ""


def index_of(parameters: Parameters, parameter: Parameter) -> float:
    """The index of a glass given by a spectrum or a colour: at 587.6 nm, or the colour's luminance. A note
    says that dispersion is left out.
    """
    from scenes import color

    if parameter.type == "spectrum":
        name = spectrum_name(parameter)
        try:
            nm, values = (
                (WAVELENGTHS, color.spectrum(name)) if name is not None else samples(parameters, parameter)
            )
        except SceneError:
            raise
        except PenumbraError as error:
            raise SceneError(f"{parameter}: {error}", parameter.where) from None
        eta, constant = float(np.interp(HELIUM, nm, values)), bool(np.ptp(values) == 0 and name is None)
    else:
        colour = colour_of(parameters, parameter, "unbounded")
        eta, constant = float(colour @ LUMINANCE), bool(np.ptp(colour) == 0)
        eta = float(colour[0]) if constant else eta
    if not constant:
        named = parameter.values.token(0).text if parameter.type == "spectrum" else str(parameter)
        named = str(parameter) if parameter.values.token(0).kind != "string" else named
        message = f"the dispersion of {named} is left out: eta is {eta:g} for all of the spectrum"
        parameters.note(parameter.name, message)
    return eta


def samples(parameters: Parameters, parameter: Parameter) -> tuple[Array, Array]:
    """The wavelengths, in nm and increasing, and the values of a `spectrum` that lists them or names a file:
    (m,) each.
    """
    first = next(iter(parameter.values), None)
    if first is not None and _is_file(first) and len(parameter.values) == 1:
        return _pairs(_file(parameters, first), parameter)
    return _pairs(parameters.values(parameter), parameter)


def _pairs(numbers: Array, parameter: Parameter) -> tuple[Array, Array]:
    if len(numbers) % 2 or len(numbers) < 4:
        raise SceneError(
            f"{parameter} takes two or more pairs of wavelength and value, not {len(numbers)} numbers",
            parameter.where,
        )
    wavelengths, values = numbers[0::2].copy(), numbers[1::2].copy()
    if not np.all(np.diff(wavelengths) > 0):
        raise SceneError(f"{parameter}: the wavelengths must increase", parameter.where)
    if np.any(values < 0):
        raise SceneError(f"{parameter} is negative: {values.min():g}", parameter.where)
    return wavelengths, values


def _file(parameters: Parameters, token: Token) -> Array:
    """The numbers of a spectrum file: wavelengths in nanometres and values, `#` opening a comment."""
    path = parameters.resolve(token.text)
    try:
        text = read_bytes(path).decode("utf-8", errors="replace")
    except PenumbraError as error:
        raise SceneError(str(error), token.where) from None
    words = [word for line in text.splitlines() for word in line.partition("#")[0].split()]
    for word in words:
        if NUMBER.fullmatch(word) is None:
            raise SceneError(f"{str(path)!r} is no spectrum: {word!r} is not a number", token.where)
    return np.array([float(word) for word in words], dtype=np.float64)
