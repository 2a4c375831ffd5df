"""Irradiance at exact points from one unoccluded diffuse polygon, disk or sphere, and behind a knife edge.

All is float64 and vectorised over points. Public arrays are (n, 3); `radiance` is a number, giving (n,), or
(3,), giving (n, 3). Irradiance is in W/m^2 for radiance in W/(m^2 sr); a Lambertian receiver of albedo rho
then shows rho / pi times it. Lights emit on the side of their normal only: behind a light, in its plane and
inside a sphere the answer is exactly 0.

Polygons: Lambert's formula E = 1/2 sum theta_i n . (v_i x v_(i+1)) / |v_i x v_(i+1)| [lambert1760] [baum1989]
after clipping at the receiver's horizon. Its edge terms cancel to the polygon's solid angle, so that below an
angular size of SMALL_POLYGON a positive cubature takes over. What is left is an absolute error of a few 1e-16
times the radiance, which shows in relative terms only for slivers: thin pieces above the horizon, or a light
seen edge-on by a receiver that is not perpendicular to it.
Disks and spheres: see cone.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.references.closed_form.cone import cone_irradiance, cross, disk_cone, dot, sphere_cone
from scenes.arrays import Array

Vectors = NDArray[Any] | Sequence[Any]  # (3,) or (n, 3) numbers
Numbers = Vectors | float | int  # a number or (n,), and for radiance (3,)

# Contour: relative error about 1e-16 / size. Cubature with 5 x 5 nodes a triangle: about (size / 2)^10.
SMALL_POLYGON = 0.01
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


def polygon_irradiance(
    points: Vectors, normals: Vectors, polygon: Vectors, radiance: Numbers = 1.0, *, two_sided: bool = False
) -> Array:
    """Irradiance from a planar convex polygon, clipped at each receiver's horizon.

    points: (n, 3). normals: (n, 3) or (3,), unit. polygon: (v, 3) or (n, v, 3), counter-clockwise as seen
    from the side that emits (normal (p1-p0) x (p2-p0)). radiance: a number or (3,).
    Returns (n,) or (n, 3).
    """
    p, n = _columns(points, normals)
    base, shape = _relative(polygon, p)
    return _times(_polygon(base, shape, n, two_sided), radiance)


def disk_irradiance(
    points: Vectors,
    normals: Vectors,
    center: Vectors,
    normal: Vectors,
    radius: Numbers,
    radiance: Numbers = 1.0,
    *,
    two_sided: bool = False,
) -> Array:
    """Irradiance from a disk at any orientation, clipped at each receiver's horizon.

    points: (n, 3). normals: (n, 3) or (3,), unit. center, normal (unit, the emitting side): (3,) or (n, 3).
    radius: a number or (n,). Returns (n,) or (n, 3). The conditioning is that of the distance to the rim: at
    1e-8 radii from the rim 8 digits remain.
    """
    p, n = _columns(points, normals)
    c, w = _column(center, p), _column(normal, p)
    side = dot(w, p - c)
    e = cone_irradiance(disk_cone(p, c, w, np.asarray(radius, dtype=np.float64)), n)
    return _times(np.where((side > 0) | (two_sided & (side < 0)), e, 0.0), radiance)


def sphere_irradiance(
    points: Vectors, normals: Vectors, center: Vectors, radius: Numbers, radiance: Numbers = 1.0
) -> Array:
    """Irradiance from a sphere that emits outwards, clipped at each receiver's horizon; 0 on and inside it.

    points: (n, 3). normals: (n, 3) or (3,), unit. center: (3,) or (n, 3). radius: a number or (n,).
    Returns (n,) or (n, 3). Wholly above the horizon this is pi L cos(theta) R^2 / d^2.
    """
    p, n = _columns(points, normals)
    c = _column(center, p)
    r = np.asarray(radius, dtype=np.float64)
    outside = dot(p - c, p - c) > r * r
    return _times(np.where(outside, cone_irradiance(sphere_cone(p, c, r), n), 0.0), radiance)


def knife_edge_irradiance(
    points: Vectors,
    normals: Vectors,
    polygon: Vectors,
    edge: Vectors,
    blocked: Vectors,
    radiance: Numbers = 1.0,
) -> Array:
    """Irradiance from a convex polygon behind an opaque half-plane: the exact penumbra profile.

    edge: (2, 3), two points of the half-plane's straight edge; blocked: (3,), a direction in the half-plane,
    from the edge inwards. The polygon must lie on one side of the half-plane's plane (ValueError otherwise);
    receivers on the same side as it, and in the plane, are not shadowed. The other arguments are those of
    `polygon_irradiance`. Method: clip by the plane through receiver and edge, then by the horizon, then
    Lambert. An empty polygon gives exactly 0, and so does the umbra's edge itself, where the plane touches
    the polygon (clipping keeps strict insides).
    """
    p, n = _columns(points, normals)
    base, shape = _relative(polygon, p)
    (a, b), into = (
        np.asarray(edge, dtype=np.float64)[..., None],
        np.asarray(blocked, dtype=np.float64)[:, None],
    )
    plane = cross(b - a, into)
    light = dot(plane[:, None], (base + p - a)[:, None] + shape)
    if light.min() < 0 < light.max():
        raise ValueError(
            "the light crosses the plane of the knife edge: the closed form needs it on one side"
        )
    shadowed = dot(plane, p - a) * light.sum(axis=0) < 0
    m = cross(a - p, b - a)
    m = np.where(dot(m, into) > 0, -m, m)
    cut, count = _clip(shape, dot(m, base) + dot(m[:, None], shape))
    whole = np.concatenate((shape, shape[:, :1]), axis=1)
    shape = np.where(shadowed, np.where(count > 0, cut, 0.0), whole)
    return _times(_polygon(base, shape, n, False, facing=_area_vector(whole)), radiance)


def clip_polygon_by_plane(
    polygon: Vectors, normal: Vectors, offset: Numbers = 0.0
) -> tuple[Array, NDArray[np.int64]]:
    """The part of convex polygons with normal . x > offset [sutherland1974], of fixed size.

    polygon: (n, v, 3). normal: (3,) or (n, 3). offset: a number or (n,).
    Returns vertices (n, v + 1, 3), in order, the last one repeated to fill up, and their number (n,), 0 where
    nothing is left. A vertex in the plane counts as outside: what merely touches the plane is empty.
    """
    shape = np.moveaxis(np.asarray(polygon, dtype=np.float64), -1, 0).swapaxes(1, 2)
    plane = _column(normal, shape[:, 0])
    distance = dot(plane[:, None], shape) - np.asarray(offset, dtype=np.float64)
    clipped, count = _clip(shape, distance)
    return np.ascontiguousarray(clipped.transpose(2, 1, 0)), count


def _columns(points: Vectors, normals: Vectors) -> tuple[Array, Array]:
    """Points and normals as (3, n)."""
    p = np.ascontiguousarray(np.atleast_2d(np.asarray(points, dtype=np.float64)).T)
    return p, _column(normals, p)


def _column(vectors: Vectors, like: Array) -> Array:
    """(3,) or (n, 3) as (3, n), n taken from `like` (3, n)."""
    v = np.asarray(vectors, dtype=np.float64)
    return np.broadcast_to(v[:, None], like.shape) if v.ndim == 1 else np.ascontiguousarray(v.T)


def _relative(polygon: Vectors, p: Array) -> tuple[Array, Array]:
    """First vertex as seen from the points, (3, n), and the polygon relative to it, (3, v, n).

    The two stay apart because edges taken from vertex - point would carry the rounding of the distance.
    """
    v = np.asarray(polygon, dtype=np.float64)
    v = np.ascontiguousarray(v.transpose(2, 1, 0)) if v.ndim == 3 else v.T[..., None]
    shape = np.broadcast_to(v - v[:, :1], (3, v.shape[1], p.shape[1]))
    return v[:, 0] - p, shape


def _times(e: Array, radiance: Numbers) -> Array:
    return np.multiply.outer(e, np.asarray(radiance, dtype=np.float64))


def _area_vector(shape: Array) -> Array:
    """Twice the area times the normal, (3, n), of polygons (3, v, n) relative to their first vertex."""
    return cross(shape[:, 1:-1], shape[:, 2:]).sum(axis=1)


def _clip(shape: Array, distance: Array) -> tuple[Array, NDArray[np.int64]]:
    """Sutherland-Hodgman for one plane: polygons (3, v + 1, n) and their vertex counts (n,).

    shape: (3, v, n). distance: (v, n), signed, of the vertices.
    """
    following, d1 = np.roll(shape, -1, axis=1), np.roll(distance, -1, axis=0)
    inside, crossing = distance > 0, (distance > 0) != (d1 > 0)
    t = np.where(crossing, distance, 0.0) / np.where(crossing, distance - d1, 1.0)
    cut = np.where(d1 == 0, following, np.where(distance == 0, shape, shape + t * (following - shape)))
    v, n = distance.shape
    slots = np.stack((shape, cut), axis=2).reshape(3, 2 * v, n)
    valid = np.stack((inside, crossing), axis=1).reshape(2 * v, n)
    count: NDArray[np.int64] = valid.sum(axis=0, dtype=np.int64)
    order = np.argsort(~valid, axis=0, kind="stable")
    number: NDArray[np.int64] = np.arange(v + 1, dtype=np.int64)
    slot = np.minimum(number[:, None], np.maximum(count - 1, 0))
    return np.take_along_axis(slots, np.take_along_axis(order, slot, axis=0)[None], axis=1), count


def _polygon(base: Array, shape: Array, n: Array, two_sided: bool, facing: Array | None = None) -> Array:
    """Irradiance (n,) per unit radiance of polygons `base + shape`.

    facing: the normal of the whole light where `shape` is a part of it.
    """
    side = -dot(_area_vector(shape) if facing is None else facing, base)
    height = dot(n, base) + dot(n[:, None], shape)
    lit = (side > 0) | (two_sided & (side < 0))
    e = np.zeros(base.shape[1])
    whole = lit & (height.min(axis=0) >= 0)
    for rows, clip in (
        (np.flatnonzero(whole), False),
        (np.flatnonzero(lit & ~whole & (height.max(axis=0) > 0)), True),
    ):
        if rows.size:
            part = shape[:, :, rows]
            part = _clip(part, height[:, rows])[0] if clip else part
            e[rows] = _above_horizon(base[:, rows], part, n[:, rows])
    return e


def _above_horizon(base: Array, shape: Array, n: Array) -> Array:
    """Irradiance of polygons wholly above the horizon, by contour or, where they are small, by cubature."""
    v = base[:, None] + shape
    nearest = np.sqrt(dot(v, v).min(axis=0))
    extent = shape - shape[:, :1]
    small = np.sqrt(dot(extent, extent).max(axis=0)) < SMALL_POLYGON * nearest
    if not small.any():
        return _contour(v, shape, n)
    e, s = np.zeros(base.shape[1]), np.flatnonzero(small)
    e[~small] = _contour(v[..., ~small], shape[..., ~small], n[:, ~small])
    e[s] = _cubature(v[:, 0, s], extent[..., s], n[:, s])
    return e


def _contour(v: Array, shape: Array, n: Array) -> Array:
    """Lambert's sum over edges, v_i x v_(i+1) taken as v_i x edge; an edge seen end-on adds nothing."""
    k = cross(v, np.roll(shape, -1, axis=1) - shape)
    sine = np.sqrt(dot(k, k))
    angle = np.arctan2(sine, dot(v, np.roll(v, -1, axis=1)))
    return np.abs((dot(n[:, None], k) * angle / np.where(sine > 0, sine, 1.0)).sum(axis=0)) / 2


def _cubature(v0: Array, extent: Array, n: Array) -> Array:
    """Gauss over the fan at the first vertex; the integrand (n . r)(normal . r) / |r|^4 is positive."""
    e1, e2 = extent[:, 1:-1], extent[:, 2:]
    weight = np.abs(dot(cross(e1, e2), v0[:, None]))
    e = np.zeros(v0.shape[1])
    for x, wx in zip((_NODES + 1) / 2, _WEIGHTS / 2, strict=True):
        for y, wy in zip((_NODES + 1) / 2, _WEIGHTS / 2, strict=True):
            r = v0[:, None] + x * (e1 + y * (e2 - e1))
            e = e + (x * wx * wy * weight * dot(n[:, None], r) / dot(r, r) ** 2).sum(axis=0)
    return e
