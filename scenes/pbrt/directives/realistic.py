"""pbrt's `realistic` camera as the thin lens of its focal length, for `--substitute`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.description.scene import Lens
from scenes.errors import PenumbraError
from scenes.files import read_bytes
from scenes.pbrt.text.parameters import Parameters
from scenes.pbrt.text.template import NUMBER

Array = NDArray[np.float64]

MILLIMETRE = 1e-3  # lens files are in millimetres, scenes in metres


@dataclass(frozen=True)
class ThinLens:
    """fov: of the film's shorter side, in degrees. lens: in the scene's units. share: the light that the film
    receives, over that of pbrt's other cameras.
    """

    fov: float
    lens: Lens
    share: float


def thin_lens(parameters: Parameters, diagonal: float, size: tuple[int, int]) -> ThinLens:
    """The thin lens that focuses on the same plane. diagonal: of the film, in mm. size: of the film, in
    pixels. SceneError if there is no sound lens file, or its lens cannot focus there.
    """
    name = parameters.text("lensfile", "")
    if not name:
        raise parameters.fail("lensfile", 'a realistic camera needs "string lensfile"')
    surfaces = _surfaces(parameters, name)
    focal = focal_length(surfaces) * MILLIMETRE
    if not focal > 0:
        raise parameters.fail("lensfile", f"{name!r} is no lens that forms an image")
    stops = surfaces[surfaces[:, 0] == 0, 3]
    widest = float(stops.max()) if len(stops) else np.inf
    radius = min(parameters.number("aperturediameter", 1.0), widest) / 2 * MILLIMETRE
    distance = parameters.number("focusdistance", 10.0)  # from the film
    if not distance > 4 * focal:
        raise parameters.fail(
            "focusdistance", f"a lens of {focal:g} m cannot focus {distance:g} m from its film"
        )
    ahead = (distance + np.sqrt(distance * (distance - 4 * focal))) / 2
    behind = distance - ahead
    shorter = diagonal * MILLIMETRE * min(size) / np.hypot(*size)
    fov = float(np.degrees(2 * np.arctan(shorter / 2 / behind)))
    return ThinLens(fov, Lens(radius, float(ahead)), float(np.pi * (radius / behind) ** 2))


def focal_length(surfaces: Array) -> float:
    """The focal length of a lens by paraxial rays [pharr2023, sec. 5.4.1], in its own unit.

    surfaces: (m, 4), from the scene's side: radius of curvature, 0 for a stop; distance to the next; index
    behind, 0 for air; diameter.
    """
    height, slope, before = 1.0, 0.0, 1.0
    for radius, thickness, index, _ in surfaces.tolist():
        if radius != 0:
            behind = index or 1.0
            slope = (before * slope - height * (behind - before) / radius) / behind
            before = behind
        height += slope * thickness
    return -1.0 / slope if slope else np.inf


def _surfaces(parameters: Parameters, name: str) -> Array:
    try:
        text = read_bytes(parameters.resolve(name)).decode("utf-8", errors="replace")
    except PenumbraError as error:
        raise parameters.fail("lensfile", str(error)) from None
    words = [word for line in text.splitlines() for word in line.partition("#")[0].split()]
    if not words or len(words) % 4 or not all(NUMBER.fullmatch(word) for word in words):
        raise parameters.fail("lensfile", f"{name!r} is no lens: it holds rows of four numbers")
    return np.array(words, dtype=np.float64).reshape(-1, 4)
