"""Normal maps and bump maps: they turn the shading normals of a surface, without moving it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.description.textures import Texture


@dataclass(frozen=True, eq=False)
class NormalMap:
    """Normals in the frame of dp/du, dp/dv and the normal. image: (h, w, 3) float64 in [0, 1], each component
    (n + 1) / 2, repeated and interpolated, the first row at v = 1.
    """

    image: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BumpMap:
    """The normals of the surface moved by `displacement` along its normal, world units, equal in all three
    components.
    """

    displacement: Texture


NormalPerturbation = NormalMap | BumpMap
