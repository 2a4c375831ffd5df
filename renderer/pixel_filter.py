"""Pixel filters by importance sampling: camera rays spread in and about a pixel as the filter does, and all
samples weigh the same.

pbrt's filters are products of a function of x and a function of y [pharr2023, sec. 8.8], so that each axis is
inverted alone.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import erf  # pyright: ignore[reportMissingTypeStubs]

from renderer.math.vectors import Floats
from scenes.description.scene import PixelFilter

# Of the gaussian's inverse: linear between nodes, the distribution is off by less than 1e-7 of its whole.
NODES = 4096


def offsets(pixel_filter: PixelFilter) -> Callable[[Floats], Floats]:
    """The map from u (2, n) in [0, 1) to offsets (2, n) in pixels from a pixel's corner, with the filter as
    density.
    """
    f = pixel_filter
    if f.kind == "box" and f.xradius == f.yradius == 0.5:
        return _identity
    one = {"box": _box, "triangle": _tent, "gaussian": _gaussian}[f.kind]
    x, y = one(f.xradius, f.sigma), one(f.yradius, f.sigma)
    return lambda u: np.stack([x(u[0]), y(u[1])]) + 0.5


def _identity(u: Floats) -> Floats:
    return u


def _box(radius: float, _: float) -> Callable[[Floats], Floats]:
    return lambda u: (2.0 * u - 1.0) * radius


def _tent(radius: float, _: float) -> Callable[[Floats], Floats]:
    def inverse(u: Floats) -> Floats:
        left, right = np.sqrt(2.0 * np.minimum(u, 0.5)) - 1.0, 1.0 - np.sqrt(2.0 * np.minimum(1.0 - u, 0.5))
        return np.where(u < 0.5, left, right) * radius

    return inverse


def _gaussian(radius: float, sigma: float) -> Callable[[Floats], Floats]:
    """The map for exp(-x^2 / 2 sigma^2) less its value at the radius: its integral in closed form, tabulated
    and inverted.
    """
    x = np.linspace(-radius, radius, NODES + 1)
    edge = np.exp(-0.5 * (radius / sigma) ** 2)
    below = sigma * np.sqrt(np.pi / 2) * erf(x / (sigma * np.sqrt(2.0))) - edge * x
    below = np.maximum.accumulate((below - below[0]) / (below[-1] - below[0]))
    return lambda u: np.interp(u, below, x)
