"""Parts of spheres, disks and cylinders about z, in object space: intersections, normals, texture
coordinates.

An affine map keeps the parameter of a ray, so that roots in object space are distances in the world. All
functions broadcast: a block of primitives against rays, or one primitive a row [pharr2023, sec. 6.2 to 6.4].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats, dot
from scenes.arrays import Mask
from scenes.description.shapes import Quadric

FORMS = ("sphere", "disk", "cylinder")
FULL_TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class Part:
    """The part of a surface that is present. Arrays broadcast. phimax: radians. inner: a disk's
    inner radius.
    """

    radius: Floats
    zmin: Floats
    zmax: Floats
    inner: Floats
    phimax: Floats

    def take(self, index: NDArray[np.integer]) -> Part:
        """The parts of primitives (n,), one a row."""
        parts = (self.radius, self.zmin, self.zmax, self.inner, self.phimax)
        return Part(*(values.take(index) for values in parts))


def to_object(x: Floats, y: Floats, z: Floats, v: Floats) -> Floats:
    """Vectors v (3, ...) in object space; x, y, z (3, ...) are the rows of the inverse matrix."""
    return np.stack([dot(x, v), dot(y, v), dot(z, v)])


def to_world(x: Floats, y: Floats, z: Floats, v: Floats) -> Floats:
    """Vectors v (3, ...) of object space in the world, by Cramer's rule."""
    yz, zx, xy = (_cross(a, b) for a, b in ((y, z), (z, x), (x, y)))
    return (yz * v[0] + zx * v[1] + xy * v[2]) / dot(x, yz)


def normal_to_world(x: Floats, y: Floats, z: Floats, n: Floats) -> Floats:
    """Unit normals in the world, by the inverse transpose."""
    out = x * n[0] + y * n[1] + z * n[2]
    with np.errstate(invalid="ignore", divide="ignore"):
        return out / np.sqrt(dot(out, out))


def _cross(a: Floats, b: Floats) -> Floats:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def roots(form: str, part: Part, p: Floats, d: Floats) -> tuple[Floats, Floats]:
    """Distances of the nearer and the farther intersection of rays p + t d, (3, ...) in object space; -inf
    for none.
    """
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        if form == "disk":
            t = (part.zmin - p[2]) / d[2]
            t = np.where(_there(form, part, p + d * t), t, -np.inf)
            return t, np.full_like(t, -np.inf)
        if form == "cylinder":
            flat = np.array([1.0, 1.0, 0.0]).reshape(3, *[1] * (d.ndim - 1))
            length = np.sqrt(d[0] * d[0] + d[1] * d[1])
            both = sphere_roots(-p * flat, d / length * flat, part.radius)
        else:
            length = np.sqrt(dot(d, d))
            both = sphere_roots(-p, d / length, part.radius)
        near, far = (t / length for t in both)
        return (
            np.where(_there(form, part, p + d * near), near, -np.inf),
            np.where(_there(form, part, p + d * far), far, -np.inf),
        )


def _there(form: str, part: Part, p: Floats) -> Mask:
    """Whether points of the whole surface lie on the part; False for NaN."""
    out: Mask
    if form == "disk":
        square = p[0] * p[0] + p[1] * p[1]
        out = (square <= part.radius * part.radius) & (square >= part.inner * part.inner)
    elif form == "cylinder":
        out = (p[2] >= part.zmin) & (p[2] <= part.zmax)
    else:  # poles that nothing cuts off are there, whatever rounding says
        out = ((part.zmin <= -part.radius) | (p[2] >= part.zmin)) & np.isfinite(p[2])
        out &= (part.zmax >= part.radius) | (p[2] <= part.zmax)
    if bool(np.any(part.phimax < FULL_TURN)):
        return out & (_angle(p) <= part.phimax)
    return out


def _angle(p: Floats) -> Floats:
    phi: Floats = np.arctan2(p[1], p[0])
    return np.where(phi < 0, phi + FULL_TURN, phi)


def sphere_roots(to_center: Floats, d: Floats, radius: Floats) -> tuple[Floats, Floats]:
    """Both roots of |t d - c| = r for unit d, without cancellation [haines2019]; -inf for a miss."""
    along = dot(to_center, d)
    off = to_center - d * along
    half = radius * radius - dot(off, off)
    root = np.sqrt(np.maximum(half, 0.0))
    q = along + np.copysign(root, along)
    distance = np.sqrt(dot(to_center, to_center))
    power = (distance - radius) * (distance + radius)
    other = np.divide(power, q, out=np.zeros_like(q), where=q != 0)
    miss = half < 0
    near, far = np.minimum(q, other), np.maximum(q, other)
    return np.where(miss, -np.inf, near), np.where(miss, -np.inf, far)


def onto(form: str, part: Part, p: Floats) -> tuple[Floats, Floats]:
    """Points p (3, ...) moved onto their surfaces, and the normals there, not of unit length."""
    zero = np.zeros_like(p[0])
    if form == "disk":
        return np.stack([p[0], p[1], zero + part.zmin]), np.stack([zero, zero, zero + 1.0])
    with np.errstate(invalid="ignore", divide="ignore"):
        if form == "cylinder":
            factor = part.radius / np.sqrt(p[0] * p[0] + p[1] * p[1])
            return np.stack([p[0] * factor, p[1] * factor, p[2]]), np.stack([p[0], p[1], zero])
        return p * (part.radius / np.sqrt(dot(p, p))), p


def leaves_inwards(form: str, p: Floats, d: Floats) -> Mask:
    """Whether rays d from points p on the surface enter its inside, where they may hit it again."""
    if form == "disk":
        return np.zeros(np.broadcast_shapes(p[0].shape, d[0].shape), dtype=np.bool_)
    along = p[0] * d[0] + p[1] * d[1]
    return along < 0 if form == "cylinder" else along + p[2] * d[2] < 0


def texture_coordinates(form: str, part: Part, p: Floats) -> Floats:
    """(2, n): u is the share of phimax. v goes from zmin to zmax, by angle on a sphere and inwards
    on a disk.
    """
    rho = np.sqrt(p[0] * p[0] + p[1] * p[1])
    with np.errstate(invalid="ignore", divide="ignore"):
        u = _angle(p) / part.phimax
        if form == "disk":
            v = (part.radius - rho) / (part.radius - part.inner)
        elif form == "cylinder":
            v = (p[2] - part.zmin) / (part.zmax - part.zmin)
        else:
            low, high = (np.arccos(np.clip(z / part.radius, -1.0, 1.0)) for z in (part.zmin, part.zmax))
            v = (np.arctan2(rho, p[2]) - low) / (high - low)
    return np.stack([u, v])


def positions(form: str, part: Part, u: Floats) -> tuple[Floats, Floats]:
    """Points (3, n) in object space, uniform over the parts by u (2, n), and their unit normals."""
    phi = u[1] * part.phimax
    x, y, zero = np.cos(phi), np.sin(phi), np.zeros_like(phi)
    if form == "disk":
        low = part.inner * part.inner
        rho = np.sqrt(low + u[0] * (part.radius * part.radius - low))
        return np.stack([rho * x, rho * y, zero + part.zmin]), np.stack([zero, zero, zero + 1.0])
    z = part.zmin + u[0] * (part.zmax - part.zmin)
    if form == "cylinder":
        return np.stack([part.radius * x, part.radius * y, z]), np.stack([x, y, zero])
    cosine = z / part.radius
    sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
    normal = np.stack([sine * x, sine * y, cosine])
    return normal * part.radius, normal


def inverse_rows(geometry: Quadric) -> Floats:
    """The rows (3, 3) of the inverse of a quadric's linear map."""
    return np.asarray(np.linalg.inv(geometry.matrix[:, :3]), dtype=np.float64)
