"""Stand-ins for materials that are not simulated: the nearest diffuse one for `subsurface`, `measured` and
`hair`.

`--substitute` renders and lists them; without it they are refused.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.description.materials import Diffuse
from scenes.pbrt.spectra import colour, colour_of
from scenes.pbrt.state import DEFAULT_REFLECTANCE, TexturedDiffuse
from scenes.pbrt.text.parameters import Parameters

Array = NDArray[np.float64]

KINDS = ("subsurface", "measured", "hair")

# The diffuse reflectance of the measured media that pbrt knows by name [jensen2001, fig. 5].
NAMED = {
    "Apple": (0.85, 0.84, 0.53), "Chicken1": (0.31, 0.15, 0.10), "Chicken2": (0.32, 0.16, 0.10),
    "Cream": (0.98, 0.90, 0.73), "Ketchup": (0.16, 0.01, 0.00), "Marble": (0.83, 0.79, 0.75),
    "Potato": (0.77, 0.62, 0.21), "Skimmilk": (0.81, 0.81, 0.69), "Skin1": (0.44, 0.22, 0.13),
    "Skin2": (0.63, 0.44, 0.34), "Spectralon": (1.00, 1.00, 1.00), "Wholemilk": (0.91, 0.88, 0.76),
}  # fmt: skip
ABSORPTION, SCATTERING = (0.0011, 0.0024, 0.014), (2.55, 3.21, 3.77)  # pbrt's defaults, 1/mm
EUMELANIN, PHEOMELANIN = (0.419, 0.697, 1.37), (0.187, 0.4, 1.05)  # absorption of hair's pigments
BROWN = 1.3  # pbrt's concentration of eumelanin where a file says nothing of hair's colour
ROUGHNESS = 0.3  # pbrt's beta_n


def subsurface(parameters: Parameters) -> Diffuse | TexturedDiffuse:
    """A diffuse material of the same albedo."""
    parameters.ignore()  # of what is left, nothing has an effect
    parameters.substitute("", 'Material "subsurface"', "as diffuse of the same albedo")
    parameter = parameters.take("reflectance", "rgb", "spectrum", "texture")
    if parameter is not None and parameter.type == "texture":
        return TexturedDiffuse(parameters.text_of(parameter), parameter.where)
    if parameter is not None:
        return Diffuse(colour_of(parameters, parameter, "reflectance"))
    name = parameters.text("name", "")
    if name:
        return Diffuse(np.array(NAMED.get(name, (DEFAULT_REFLECTANCE,) * 3)))
    sigma_a, sigma_s = _coefficient(parameters, "sigma_a"), _coefficient(parameters, "sigma_s")
    return Diffuse(_diffusion(sigma_a, sigma_s, parameters))


def _coefficient(parameters: Parameters, name: str) -> Array:
    """A coefficient of a medium, (3,); pbrt's default where it is a texture."""
    default = np.array(ABSORPTION if name == "sigma_a" else SCATTERING)
    parameter = parameters.take(name, "rgb", "spectrum", "texture")
    if parameter is None or parameter.type == "texture":
        return default
    return colour_of(parameters, parameter, "unbounded")


def _diffusion(sigma_a: Array, sigma_s: Array, parameters: Parameters) -> Array:
    """The albedo, (3,), of a half-space by the dipole [jensen2001]."""
    eta = parameters.number("eta", 1.33)
    fresnel = -1.440 / eta**2 + 0.710 / eta + 0.668 + 0.0636 * eta
    a = (1 + fresnel) / (1 - fresnel)
    scattered = sigma_s * (1 - parameters.number("g", 0.0))
    albedo = scattered / np.maximum(scattered + sigma_a, np.finfo(np.float64).tiny)
    root = np.sqrt(3 * (1 - albedo))
    return np.clip(albedo / 2 * (1 + np.exp(-4 / 3 * a * root)) * np.exp(-root), 0.0, 1.0)


def measured(parameters: Parameters) -> Diffuse:
    """A gray diffuse material: its file is not read."""
    parameters.ignore()  # of what is left, nothing has an effect
    parameters.substitute("", 'Material "measured"', f"as diffuse of reflectance {DEFAULT_REFLECTANCE:g}")
    return Diffuse(np.full(3, DEFAULT_REFLECTANCE))


def hair(parameters: Parameters) -> Diffuse:
    """A diffuse material of the hair's colour. pbrt's fit [chiang2016] derives that colour from pigments."""
    parameters.ignore()
    parameters.substitute("", 'Material "hair"', "as diffuse of its colour")
    for name in ("reflectance", "color"):
        parameter = parameters.take(name, "rgb", "spectrum", "texture")
        if parameter is not None and parameter.type != "texture":
            return Diffuse(colour_of(parameters, parameter, "reflectance"))
    sigma_a = colour(parameters, "sigma_a", "unbounded")
    if sigma_a is None:
        eumelanin, pheomelanin = (parameters.number(name, -1.0) for name in ("eumelanin", "pheomelanin"))
        eumelanin = BROWN if max(eumelanin, pheomelanin) < 0 else eumelanin
        sigma_a = max(eumelanin, 0.0) * np.array(EUMELANIN) + max(pheomelanin, 0.0) * np.array(PHEOMELANIN)
    b = parameters.number("beta_n", ROUGHNESS)
    width = 5.969 - 0.215 * b + 2.532 * b**2 - 10.73 * b**3 + 5.574 * b**4 + 0.245 * b**5
    return Diffuse(np.exp(-np.sqrt(sigma_a) * width))
