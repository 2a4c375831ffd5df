"""The same irradiances in 40 digits and by other ways: what `pipeline.references.closed_form.radiometry` is
measured against.

Floats are taken as the exact numbers they are, so that differences are the rounding of the code under test.
"""

from __future__ import annotations

from collections.abc import Sequence

import mpmath as mp
import numpy as np

DIGITS = 40
Vector = Sequence[float]


def vector(v: Vector) -> list[mp.mpf]:
    return [mp.mpf(float(x)) for x in v]


def dot(a, b):
    return sum((x * y for x, y in zip(a, b, strict=True)), mp.mpf(0))


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def norm(a):
    return mp.sqrt(dot(a, a))


def unit(v: Vector) -> np.ndarray:
    return np.asarray(v, dtype=float) / np.linalg.norm(v)


def polygon(p: Vector, n: Vector, corners: Sequence[Vector]) -> mp.mpf:
    """Lambert's sum, after clipping at the horizon."""
    with mp.workdps(DIGITS):
        v, n = [minus(vector(c), vector(p)) for c in corners], vector(n)
        if dot(cross(minus(v[1], v[0]), minus(v[2], v[0])), v[0]) >= 0:
            return mp.mpf(0)
        total = mp.mpf(0)
        v = _clip(v, n)
        for a, b in zip(v, v[1:] + v[:1], strict=True):
            k = cross(a, b)
            if norm(k) > 0:
                total += mp.atan2(norm(k), dot(a, b)) * dot(n, k) / norm(k)
        return abs(total) / 2


def _clip(v, n):
    kept = []
    for a, b in zip(v, v[1:] + v[:1], strict=True):
        x, y = dot(n, a), dot(n, b)
        if x >= 0:
            kept.append(a)
        if (x >= 0) != (y >= 0):
            kept.append([s + x / (x - y) * (t - s) for s, t in zip(a, b, strict=True)])
    return kept


def disk(p: Vector, n: Vector, center: Vector, normal: Vector, radius: float) -> mp.mpf:
    """The contour integral over the visible rim by quadrature, graded towards the rim's nearest point, plus
    the horizon's chord.
    """
    with mp.workdps(DIGITS):
        n, w, r = vector(n), vector(normal), mp.mpf(float(radius))
        o = minus(vector(center), vector(p))
        if dot(w, o) >= 0:
            return mp.mpf(0)
        u = cross(w, [1, 0, 0] if abs(w[0]) < abs(w[1]) else [0, 1, 0])
        u = [x / norm(u) for x in u]
        v = [x / norm(w) for x in cross(w, u)]
        rim = lambda t: [o[i] + r * (mp.cos(t) * u[i] + mp.sin(t) * v[i]) for i in range(3)]  # noqa: E731
        step = lambda t: [r * (mp.cos(t) * v[i] - mp.sin(t) * u[i]) for i in range(3)]  # noqa: E731
        level, (x, y) = dot(n, o), (r * dot(n, u), r * dot(n, v))
        tilt = mp.hypot(x, y)
        if level <= -tilt:
            return mp.mpf(0)
        delta = mp.pi if level >= tilt else mp.acos(-level / tilt)
        a, b = mp.atan2(y, x) - delta, mp.atan2(y, x) + delta
        nearest = mp.atan2(-dot(o, v), -dot(o, u))
        close = norm(rim(nearest)) / r
        grades = [0] + [sign * mp.mpf(10) ** -k for k in range(10) if 10**-k > close / 10 for sign in (1, -1)]
        cuts = [nearest + 2 * mp.pi * j + g for j in range(-2, 3) for g in grades]
        cuts = sorted([a, b] + [c for c in cuts if a < c < b])
        total = mp.quad(lambda t: dot(n, cross(rim(t), step(t))) / dot(rim(t), rim(t)), cuts)
        if delta < mp.pi:
            end, start = rim(b), rim(a)
            k = cross(end, start)
            total += mp.atan2(norm(k), dot(end, start)) * dot(n, k) / norm(k)
        return abs(total) / 2


def sphere(p: Vector, n: Vector, center: Vector, radius: float) -> mp.mpf:
    """Over the angle from the axis of the tangent cone, of each ring the azimuths above the horizon: no
    contour.
    """
    with mp.workdps(DIGITS):
        o, n, r = minus(vector(center), vector(p)), vector(n), mp.mpf(float(radius))
        along = dot(n, o) / norm(o)
        return _spherical_cap(norm(cross(n, o)) / norm(o), along, mp.asin(r / norm(o)))


def _spherical_cap(across, along, sigma):
    def ring(theta):
        x, y = across * mp.sin(theta), along * mp.cos(theta)
        if y >= x:
            return 2 * mp.pi * y * mp.sin(theta)
        if y <= -x:
            return mp.mpf(0)
        half = mp.acos(-y / x)
        return 2 * (y * half + x * mp.sin(half)) * mp.sin(theta)

    horizon = mp.atan2(abs(along), across)
    return mp.quad(ring, sorted({mp.mpf(0), sigma, *(h for h in (horizon,) if h < sigma)}))
