"""Two elliptic integrals of the solid angle of a disk, by positive terms only, so that neither cancels."""

from __future__ import annotations

import numpy as np

from renderer.math.vectors import Floats
from scenes.arrays import Index

# Steps of the arithmetic-geometric mean: seven leave a ratio of 2e-8, met 1e-16 radii from a disk's rim, at 1
# - 1e-13.
MEANS = 8
# Duplication divides the differences of four arguments by 4 each time. What the series of degree 7 leaves out
# is some 5 d^8,
# d the largest difference over the mean: 2e-15 here [carlson1995, eq. 2.18, with the exponent that degree 7
# allows].
CLOSE = 0.012
# Every row takes this many steps: an ordinary disk wants four, and looking costs as much as a step.
FIRST = 4
DUPLICATIONS = 40  # 10 are the most that was seen, for cosines 1e-30 apart


def complete(kc: Floats, p: Floats) -> Floats:
    """cel(kc, p^2, 1, 0): the integral of cos^2 / ((cos^2 + p^2 sin^2) sqrt(cos^2 + kc^2 sin^2)) over a
    quarter turn.

    kc: (n,) in [2e-8, 1]. p: (n,) > 0. Returns (n,), relative error some 1e-15. The steps are
    [bulirsch1969]'s, a fixed number of them: a row's bits must not depend on when others converge.
    """
    product, mean = kc, np.ones_like(kc)
    a, b = np.ones_like(kc), np.zeros_like(kc)
    for _ in range(MEANS):
        step = product / p
        a, b = a + b / p, 2.0 * (b + a * step)
        p = p + step
        mean, kc = mean + kc, 2.0 * np.sqrt(product)
        product = kc * mean
    return (np.pi / 2) * (b + a * mean) / (mean * (mean + p))


def symmetric(x: Floats, y: Floats, z: Floats, p: Floats, apart: Floats) -> Floats:
    """Carlson's R_J(x, y, z, p) = 3/2 integral_0^oo dt / ((t + p) sqrt((t + x)(t + y)(t + z))), where p lies
    between.

    x, y, z: (n,) >= 0, at most one of them 0. p: (n,) > 0. apart: (n,) sqrt((p - x)(p - y)(p - z)), given
    lest it cancel; real. Returns (n,), relative error some 1e-15, by duplication [carlson1995, sec. 2]. A row
    stops when its own arguments are close.
    """
    out = np.zeros_like(x)
    rows: Index = np.arange(x.size, dtype=np.int64)
    total, scale = np.zeros_like(x), 1.0
    for step in range(DUPLICATIONS):
        rx, ry, rz, rp = np.sqrt(x), np.sqrt(y), np.sqrt(z), np.sqrt(p)
        d = (rp + rx) * (rp + ry) * (rp + rz)
        # R_C(1, 1 + e) = atan(sqrt e) / sqrt e, with e = apart^2 / (64^step d^2); for e = 0 it is 1
        root = np.maximum(apart * (scale * np.sqrt(scale)) / d, 1e-100)
        total = total + (6.0 * scale) * np.arctan(root) / (root * d)
        shift = rx * (ry + rz) + ry * rz
        x, y, z, p = 0.25 * (x + shift), 0.25 * (y + shift), 0.25 * (z + shift), 0.25 * (p + shift)
        scale *= 0.25
        if step < FIRST - 1:
            continue
        value, spread = _series(x, y, z, p)
        out[rows] = total + scale * value
        going = np.flatnonzero(spread > CLOSE)
        if not going.size:
            break
        rows = rows[going]
        x, y, z, p, total, apart = (v[going] for v in (x, y, z, p, total, apart))
    return out


def _series(x: Floats, y: Floats, z: Floats, p: Floats) -> tuple[Floats, Floats]:
    """R_J of close arguments, to degree 7 in their differences from the mean (DLMF 19.36.2), and the largest
    of these over the mean.
    """
    mean = 0.2 * (x + y + z + 2.0 * p)
    with np.errstate(under="ignore"):
        dx, dy, dz, dp = 1.0 - x / mean, 1.0 - y / mean, 1.0 - z / mean, 1.0 - p / mean
        spread = np.maximum(np.maximum(np.abs(dx), np.abs(dy)), np.maximum(np.abs(dz), np.abs(dp)))
        cube, square = dx * dy * dz, dp * dp
        e2 = dx * (dy + dz) + dy * dz - 3.0 * square
        e3 = cube + 2.0 * dp * (e2 + 2.0 * square)
        e4 = dp * (2.0 * cube + dp * (e2 + 3.0 * square))
        e5 = cube * square
        series = 1.0 + e2 * (-3 / 14 + e2 * (9 / 88 - e2 / 16)) + e3 * (1 / 6 + 3 / 40 * e3)
        series += (
            e2 * e3 * (-9 / 52 + 45 / 272 * e2)
            + e4 * (-3 / 22 + 3 / 20 * e2 - 9 / 68 * e3)
            + e5 * (3 / 26 - 9 / 68 * e2)
        )
        return series / (mean * np.sqrt(mean)), spread
