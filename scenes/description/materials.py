"""Materials: how surfaces scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.description.textures import Texture

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Diffuse:
    """Lambertian, two-sided as pbrt's. reflectance: (3,) float64 in [0, 1], or a texture of such."""

    reflectance: Texture


@dataclass(frozen=True, eq=False)
class Conductor:
    """A metal: GGX microfacets (Trowbridge-Reitz) with the Fresnel reflectance of eta + i k, two-sided.

    eta, k: (3,) float64 for red, green and blue. alpha: of the distribution, remapping already done, at least
    1e-3; 0 for a mirror.
    """

    eta: Array
    k: Array
    alpha: float


@dataclass(frozen=True, eq=False)
class Dielectric:
    """A boundary of glass or the like. eta: the index inside over that outside, the side of the normal.

    alpha: of the GGX distribution, remapping already done, 0 for a smooth boundary. thin: whether it is a
    pane with both of its sides, which is smooth and bends no ray.
    """

    eta: float
    alpha: float
    thin: bool = False


Material = Diffuse | Conductor | Dielectric
