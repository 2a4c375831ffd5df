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
    """A rough metal: GGX microfacets (Trowbridge-Reitz) with the Fresnel reflectance of eta + i k, two-sided.

    eta, k: (3,) float64 for red, green and blue. alpha: of the distribution, remapping already done, at least
    1e-3.
    """

    eta: Array
    k: Array
    alpha: float


Material = Diffuse | Conductor
