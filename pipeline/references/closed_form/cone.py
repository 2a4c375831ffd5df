"""Irradiance from an elliptic cone of directions: the one formula behind disks and spheres.

Seen from a point, the rim of a disk and the outline of a sphere both span an elliptic cone. In its principal
axes the rim is r(t) = a cos t e1 + b sin t e2 + c e3 with b >= a, and Lambert's contour integral
E = 1/2 oint n . (r x dr) / |r|^2 (Stokes's theorem, [sparrow1963]) is elementary. Over the whole rim the
terms in cos t and sin t vanish by symmetry, which leaves

    E = pi (n . e3) a b / sqrt((a^2 + c^2) (b^2 + c^2)),

a product without any cancellation: exact to rounding however small the light or near the point. Where the
receiver's horizon cuts the cone, the contour is an arc of the rim closed by a chord in the horizon plane.
Vectors are component-major here, (3, n).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenes.arrays import Array

# Below this angular extent of the visible piece the arc and the chord cancel to (extent)^3: a positive
# cubature over the piece is used instead. At the threshold the contour still has 13 digits, the cubature all.
SMALL_PIECE = 0.1
_PSI, _PSI_WEIGHT = np.polynomial.legendre.leggauss(16)
_TAU, _TAU_WEIGHT = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, eq=False)
class Cone:
    """n elliptic cones of directions.

    e1, e2, e3: (3, n), orthonormal, right-handed axes. a <= b, c: (n,), up to a common factor.
    """

    e1: Array
    e2: Array
    e3: Array
    a: Array
    b: Array
    c: Array

    def direction(self, t: Array) -> Array:
        """Points r(t) of the rim, (3, n), not normalised; t: (n,) radians, or one cone and (m,) angles."""
        return self.a * np.cos(t) * self.e1 + self.b * np.sin(t) * self.e2 + self.c * self.e3

    def derivative(self, t: Array) -> Array:
        """dr/dt, (3, n)."""
        return self.b * np.cos(t) * self.e2 - self.a * np.sin(t) * self.e1


def dot(u: Array, v: Array) -> Array:
    """Dot product over the first axis: (3, ...) x (3, ...) -> (...)."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: Array, v: Array) -> Array:
    """Cross product over the first axis: (3, ...) x (3, ...) -> (3, ...)."""
    return np.stack(
        (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]),
    )


def _any_perpendicular(w: Array) -> Array:
    """A unit vector (3, n) perpendicular to the unit vectors w (3, n)."""
    helper = np.zeros_like(w)
    np.put_along_axis(helper, np.argmin(np.abs(w), axis=0)[None], 1.0, axis=0)
    v = cross(w, helper)
    return v / np.sqrt(dot(v, v))


def _lateral(offset: Array, w: Array) -> tuple[Array, Array]:
    """Length (n,) and unit direction (3, n) of the part of `offset` perpendicular to the unit vectors w.

    On the axis (a part below 1e-15 of the offset is rounding) any perpendicular serves: the cone is circular
    there.
    """
    side = offset - dot(offset, w) * w
    length = np.sqrt(dot(side, side))
    on_axis = length <= 1e-15 * np.sqrt(dot(offset, offset))
    u = np.where(on_axis, _any_perpendicular(w), side / np.where(on_axis, 1.0, length))
    u = u - dot(u, w) * w
    return np.where(on_axis, 0.0, length), u / np.sqrt(dot(u, u))


def disk_cone(points: Array, center: Array, normal: Array, radius: Array | float) -> Cone:
    """The cones from points over disks. points, center: (3, n). normal: (3, n), unit, of either sign.

    A point in the disk's plane gives a flat cone.

    With the far and the near rim at distances d1 and d2, D = d1 d2 and q = a^2 + h^2 - R^2, the squared axes
    are D - q, 2 R^2 and D + q, each taken from the quotient 4 R^2 h^2 / (D +- q) where the difference would
    cancel; the cone's axis bisects the directions to the two rims.
    """
    offset = center - points
    side = dot(offset, normal)
    height = np.abs(side)
    w = np.where(side < 0, -normal, normal)
    lateral, u = _lateral(offset, w)
    radius = np.broadcast_to(np.asarray(radius, dtype=np.float64), height.shape)
    d1, d2 = np.hypot(lateral + radius, height), np.hypot(lateral - radius, height)
    product, q = d1 * d2, (lateral - radius) * (lateral + radius) + height * height
    large = product + np.abs(q)
    small = 4 * radius**2 * height**2 / np.where(large > 0, large, 1.0)
    e_u, e_w = _bisector(lateral, radius, height, d1, d2)
    v = cross(w, u)
    a2, c2 = np.where(q > 0, small, large), np.where(q > 0, large, small)
    return Cone(e_w * u - e_u * w, v, e_u * u + e_w * w, np.sqrt(a2), np.sqrt(2.0) * radius, np.sqrt(c2))


def _bisector(lateral: Array, radius: Array, height: Array, d1: Array, d2: Array) -> tuple[Array, Array]:
    """Unit bisector, in the disk's plane of symmetry, of the directions (lateral +- R, height).

    Over the disk (lateral < R) the sum of the two nearly cancels close to it: there the form divided by the
    height is used.
    """
    over = lateral <= radius
    total = (lateral + radius) * d2 + np.abs(lateral - radius) * d1
    e_u = np.where(over, 4 * lateral * radius * height / np.where(total > 0, total, 1.0), total)
    e_w = np.where(over, d1 + d2, height * (d1 + d2))
    length = np.hypot(e_u, e_w)
    length = np.where(length > 0, length, 1.0)
    return e_u / length, e_w / length


def sphere_cone(points: Array, center: Array, radius: Array | float) -> Cone:
    """The cones from points around spheres; a half-space (c = 0) on or inside one. points, center: (3, n)."""
    offset = center - points
    distance = np.sqrt(dot(offset, offset))
    radius = np.broadcast_to(np.asarray(radius, dtype=np.float64), distance.shape)
    apart = distance > 0
    e3 = np.where(apart, offset / np.where(apart, distance, 1.0), np.array([[0.0], [0.0], [1.0]]))
    e1 = _any_perpendicular(e3)
    c = np.sqrt(np.maximum(distance - radius, 0.0) * (distance + radius))
    return Cone(e1, cross(e3, e1), e3, radius, radius, c)


def cone_irradiance(cone: Cone, normal: Array) -> Array:
    """Irradiance (n,) per unit radiance from the parts of cones above the horizon. normal: (3, n), unit."""
    n1, n2, n3 = dot(normal, cone.e1), dot(normal, cone.e2), dot(normal, cone.e3)
    tilt, level = np.hypot(n1 * cone.a, n2 * cone.b), n3 * cone.c
    spread = np.hypot(cone.a, cone.c) * np.hypot(cone.b, cone.c)
    whole = np.pi * n3 * cone.a * cone.b / np.where(spread > 0, spread, 1.0)
    e = np.where(level >= tilt, np.maximum(whole, 0.0), 0.0)
    rows = np.flatnonzero(np.abs(level) < tilt)
    if rows.size:
        e[rows] = _above_horizon(*(x[rows] for x in (cone.a, cone.b, cone.c, n1, n2, n3)))
    return e


def _above_horizon(a: Array, b: Array, c: Array, n1: Array, n2: Array, n3: Array) -> Array:
    """Irradiance of cones that the horizon cuts: the rim is visible for |t - t0| < delta."""
    tilt, level = np.hypot(n1 * a, n2 * b), n3 * c
    t0 = np.arctan2(n2 * b, n1 * a)
    delta = np.arctan2(np.sqrt((tilt - level) * (tilt + level)), -level)
    apex = np.sqrt((a * np.cos(t0)) ** 2 + (b * np.sin(t0)) ** 2 + c * c)
    small = 2 * np.sin(delta / 2) * b < SMALL_PIECE * apex
    e = np.zeros_like(a)
    for rows, method in ((np.flatnonzero(small), _cubature), (np.flatnonzero(~small), _contour)):
        if rows.size:
            e[rows] = method(*(x[rows] for x in (a, b, c, n1, n2, n3, t0, delta)))
    return np.maximum(e, 0.0)


def _over(f: Array, z: Array) -> Array:
    """f(z)/z with its limit 1 where z is so small that the next term, z^2/3, is below rounding."""
    near = np.abs(z) < 1e-8
    return np.where(near, 1.0, f / np.where(near, 1.0, z))


def _contour(a: Array, b: Array, c: Array, n1: Array, n2: Array, n3: Array, t0: Array, delta: Array) -> Array:
    """Arc by its antiderivative plus the chord's edge term; the error is rounding of the chord's angle, about
    1e-16.
    """
    pa, pb, g = np.hypot(a, c), np.hypot(b, c), np.sqrt(np.maximum((b - a) * (b + a), 0.0))
    lo, hi = (
        np.stack((np.cos(t0 - delta), np.sin(t0 - delta))),
        np.stack((np.cos(t0 + delta), np.sin(t0 + delta))),
    )

    def over_cos(p: Array) -> Array:
        z = g * p[1] / pa
        return p[1] * _over(np.arctan(z), z) / (pa * pa)

    def over_sin(p: Array) -> Array:
        z = np.clip(g * p[0] / pb, -1 + 1e-16, 1 - 1e-16)
        return -p[0] * _over(np.arctanh(z), z) / (pb * pb)

    angle = np.arctan2(pa * pb * np.sin(2 * delta), pa**2 * lo[0] * hi[0] + pb**2 * lo[1] * hi[1])
    angle = np.where((delta > np.pi / 2) & (angle < 0), angle + 2 * np.pi, angle)
    arc = -n1 * b * c * (over_cos(hi) - over_cos(lo)) - n2 * a * c * (over_sin(hi) - over_sin(lo))
    arc = arc + n3 * a * b * angle / (pa * pb)
    start, end = np.stack((a * lo[0], b * lo[1], c)), np.stack((a * hi[0], b * hi[1], c))
    k = cross(end, start)
    turn = np.copysign(np.arctan2(np.sqrt(dot(k, k)), dot(end, start)), dot(np.stack((n1, n2, n3)), k))
    return (arc + turn) / 2


def _cubature(
    a: Array, b: Array, c: Array, n1: Array, n2: Array, n3: Array, t0: Array, delta: Array
) -> Array:
    """Gauss over the visible segment s = cos psi > cos delta of the rim's ellipse; every term is positive."""
    psi = (delta[:, None] / 2) * (1 + _PSI)
    weight = np.sin(psi) ** 2 * 2 * np.sin((delta[:, None] + psi) / 2) * np.sin((delta[:, None] - psi) / 2)
    weight = weight * (delta[:, None] / 2) * _PSI_WEIGHT
    s, t = np.cos(psi)[..., None], np.sin(psi)[..., None] * _TAU
    cos0, sin0 = np.cos(t0)[:, None, None], np.sin(t0)[:, None, None]
    x, y = s * cos0 - t * sin0, s * sin0 + t * cos0
    r2 = (c * c)[:, None, None] + (a * a)[:, None, None] * x * x + (b * b)[:, None, None] * y * y
    inner = (_TAU_WEIGHT / (r2 * r2)).sum(axis=2)
    return a * b * c * np.hypot(n1 * a, n2 * b) * (weight * inner).sum(axis=1)
