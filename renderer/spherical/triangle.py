"""The spherical triangle: its solid angle, points uniform in it, and the way back. All vectors start at the
reference point.

Two things are as published, the map of the unit square [arvo1995] and the solid angle [vanoosterom1983, eq.
8]; how they are computed is not. Arvo's angles of the triangle come from acos and their sum minus pi, which
leaves nothing of a small solid angle. Here every quantity is a product or a quotient of products of the
corners and edges:

- tan(O/2) = V / D with V the triple product of the corners and D = K (rc + ra) + e.m, where K = ra rb + a.b,
e = c - a,
  m = rb a + ra b.
- The point a + s e that cuts off a solid angle of 2 t beside the edge ab obeys s V cos t = sin t D(s), where
  D(s) = K (|a + s e| + ra) + s e.m. Squaring once leaves a linear equation:
  s = 2 K sin t (ra V cos t + sin t (a x e).(b x a)) / (P^2 - (K sin t |e|)^2), P = V cos t - sin t e.m.
- On the arc from b to that point 1 - cos is uniform; half angles keep its digits.

K cancels where a and b are nearly opposite, the point being close to the edge ab. The roles of the corners
are dealt so that ab is no such edge: see `_with_stable_edge`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.math.vectors import Floats, cross, dot
from scenes.arrays import Mask

OPPOSITE = 1e-3


@dataclass(frozen=True, eq=False)
class _StableTriangle:
    """Corners in their roles: apex b, and the edge from a to c that is cut.

    Lengths ra, rb, rc (n,), the rest (3, n).
    """

    a: Floats
    b: Floats
    c: Floats
    ra: Floats
    rb: Floats
    rc: Floats
    ab: Floats
    ac: Floats
    k: Floats  # a x b
    volume: Floats  # |a . b x c|, (n,)
    bend: Floats  # K of the module's docstring, (n,)
    slope: Floats  # e . m, (n,)

    def half(self) -> Floats:
        """Half of the solid angle, (n,); exactly 0 in the triangle's plane."""
        angle = np.arctan2(self.volume, self.bend * (self.rc + self.ra) + self.slope)
        return np.where(self.volume > 0, angle, 0.0)


def solid_angle(a: Floats, ab: Floats, ac: Floats) -> Floats:
    """Solid angle (n,) in sr of triangles, 0 in their own plane. a: (3, n), a corner; ab, ac: (3, n) or (3,
    1), its edges.

    The edges are asked for, not the corners, since corner - corner would carry the rounding of the distance.
    Relative error some 1e-16 of the size over the distance from the plane; below 1e-13 for lights of 1e-6
    rad.
    """
    b, c, k = a + ab, a + ac, cross(a, ab)
    ra, rb, rc = (np.sqrt(dot(v, v)) for v in (a, b, c))
    volume = np.abs(dot(k, ac))
    lower = (ra * rb + dot(a, b)) * (rc + ra) + rb * dot(a, ac) + ra * dot(b, ac)
    return np.where(volume > 0, 2.0 * np.arctan2(volume, lower), 0.0)


def sample(u: Floats, a: Floats, ab: Floats, ac: Floats) -> tuple[Floats, Floats]:
    """Points (3, n) of triangles, uniform in solid angle, and the solid angle (n,). u: (2, n); the rest as
    for `solid_angle`.

    Where the solid angle is 0 the point lies on the triangle or is NaN.
    """
    t = _with_stable_edge(a, ab, ac)
    half = t.half()
    with np.errstate(invalid="ignore", divide="ignore"):
        s = _cut(u[0] * half, t)
        across = t.ac * s - t.ab
        return t.b + across * _along(u[1], t.b, t.rb, across), 2.0 * half


def invert(wi: Floats, a: Floats, ab: Floats, ac: Floats) -> Floats:
    """The u (2, n) that `sample` takes to the direction of wi (3, n) inside the triangle."""
    t = _with_stable_edge(a, ab, ac)
    # Barycentric weights of the point that wi meets, up to a common factor
    wa, wb, wc = dot(wi, cross(t.b, t.ac - t.ab)), dot(wi, cross(t.ac, t.a)), dot(wi, t.k)
    with np.errstate(invalid="ignore", divide="ignore"):
        s, v = wc / (wa + wc), (wa + wc) / (wa + wb + wc)
        x = t.a + t.ac * s
        part = np.arctan2(s * t.volume, t.bend * (np.sqrt(dot(x, x)) + t.ra) + s * t.slope)
        across = t.ac * s - t.ab
        return np.stack(
            [part / t.half(), _versine(t.b, t.rb, across * v)[0] / _versine(t.b, t.rb, across)[0]]
        )


def _with_stable_edge(a: Floats, ab: Floats, ac: Floats) -> _StableTriangle:
    """Deal the roles: the apex b is the nearer end of the edge seen under the widest angle; ac is cut from
    its nearer end.

    A point close to an edge sees it under nearly pi, and close to a corner sees that corner's edges under
    pi/2; cutting such an edge, or cutting from a far corner towards a near one, costs 1e-16 / distance^2
    (measured: 1e-4 at 1e-6). Where the widest edge is within OPPOSITE of pi (as 1 + cos) it is bc whatever
    the distances: K would be lost.
    """
    b, c = a + ab, a + ac
    ra, rb, rc = (np.sqrt(dot(v, v)) for v in (a, b, c))
    cos_ab, cos_bc, cos_ca = dot(a, b) * rc, dot(b, c) * ra, dot(c, a) * rb
    wide_ab = (cos_ab < cos_bc) & (cos_ab <= cos_ca)
    wide_bc = ~wide_ab & (cos_bc <= cos_ca)
    # In turn: the widest edge runs from `one` to `two`, the corner `three` lies opposite.
    one, two, three = (_pick(wide_ab, wide_bc, *v) for v in ((a, b, c), (b, c, a), (c, a, b)))
    r1, r2, r3 = (_pick(wide_ab, wide_bc, *v) for v in ((ra, rb, rc), (rb, rc, ra), (rc, ra, rb)))
    to_two, to_three = _pick(wide_ab, wide_bc, ab, ac - ab, -ac), _pick(wide_ab, wide_bc, ac, -ab, ab - ac)
    second = r2 < r1
    apex, end = np.where(second, two, one), np.where(second, one, two)
    rb, r_end = np.where(second, r2, r1), np.where(second, r1, r2)
    to_three, to_end = np.where(second, to_three - to_two, to_three), np.where(second, -to_two, to_two)
    swap = (r_end < r3) & (dot(one, two) > (OPPOSITE - 1.0) * r1 * r2)
    near, far = np.where(swap, end, three), np.where(swap, three, end)
    ra, rc = np.where(swap, r_end, r3), np.where(swap, r3, r_end)
    to_apex = -np.where(swap, to_end, to_three)
    edge = np.where(swap, to_three - to_end, to_end - to_three)
    k, slope = cross(near, to_apex), rb * dot(near, edge) + ra * dot(apex, edge)
    bend = ra * rb + dot(near, apex)
    return _StableTriangle(near, apex, far, ra, rb, rc, to_apex, edge, k, np.abs(dot(k, edge)), bend, slope)


def _pick(one: Mask, two: Mask, x: Floats, y: Floats, z: Floats) -> Floats:
    return np.where(one, x, np.where(two, y, z))


def _cut(half: Floats, t: _StableTriangle) -> Floats:
    """The place (n,) on the edge ac, in [0, 1], up to which the solid angle beside ab is 2 half."""
    sine, cosine = np.sin(half), np.cos(half)
    upper = t.ra * t.volume * cosine - sine * dot(cross(t.a, t.ac), t.k)
    p, q = t.volume * cosine - sine * t.slope, t.bend * sine * np.sqrt(dot(t.ac, t.ac))
    lower = (p - q) * (p + q)
    s = 2.0 * t.bend * sine * upper / lower
    # lower = 0: the cut is at infinity, beyond c by rounding only
    return np.where(lower > 0, np.minimum(np.maximum(s, 0.0), 1.0), 1.0)


def _versine(b: Floats, rb: Floats, across: Floats) -> tuple[Floats, Floats, Floats]:
    """sin^2 and cos^2 of half the angle between b and b + across, and |b x across|, each (n,)."""
    x, k = b + across, cross(b, across)
    rx, sine, cosine = np.sqrt(dot(x, x)), np.sqrt(dot(k, k)), dot(b, x)
    # sin^2(h) = sin^2(2h) / (2 (1 + |cos(2h)|)) for acute angles; of obtuse ones that is cos^2(h)
    small = sine * sine / (2.0 * rb * rx * (rb * rx + np.abs(cosine)))
    return np.where(cosine > 0, small, 1.0 - small), np.where(cosine > 0, 1.0 - small, small), sine


def _along(u: Floats, b: Floats, rb: Floats, across: Floats) -> Floats:
    """The v (n,) in [0, 1] with 1 - cos(b, b + v across) = u (1 - cos(b, b + across))."""
    square, rest, sine = _versine(b, rb, across)
    s2, c2 = u * square, (1.0 - u) * square + rest
    full = 2.0 * np.sqrt(s2 * c2)
    lower = sine * (c2 - s2) - dot(b, across) * full
    return np.where(lower > 0, np.minimum(rb * rb * full / lower, 1.0), 1.0)
