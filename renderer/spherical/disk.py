"""The solid angle of a disk from any point, and directions uniform in it: a spherical ellipse, in elliptic
integrals.

A disk is seen as a spherical ellipse [guillen2017]: a cone about an axis that bisects the two ends of the
diameter in the plane of symmetry, with half-angles `minor` (a, in that plane) and `major` (b, across it).
With `near` and `far` the distances to the two ends, in radii, and h, o the height and the offset of the
point,

    sin 2a = 2 h / (near far),   cos 2a = (h^2 + o^2 - 1) / (near far),   sin b = 2 / (near + far),
    cos b / cos a = 2 sqrt(near far) / (near + far),

none of which cancels. The meridian planes about the major axis, numbered by sin(phi) = s sin(a), cut the
ellipse into lunes of length 2 y(s) in the sine of the latitude, whose area is that length (Archimedes), so
that with T = s / sqrt(1 - s^2)

    solid angle right of T = 2 sin a sin b integral_T^oo dt / ((1 + t^2) sqrt((1 + A t^2) (1 + B t^2))),
    A = cos^2 b,  B = cos^2 a.

It is symmetric in the two angles and its integrand is positive. [guillen2017] has such a map (the parallel
one) in Legendre's integrals of the first and third kind and inverts it by tables or Newton's method; what is
used here is made of positive terms only, so that neither a small ellipse nor a near hemisphere cancels:
- the whole: Bulirsch's `cel`, arithmetic-geometric means;
- from T to infinity: one symmetric integral R_J, whose logarithm is inverted in two or three steps.

No formula has branches but for the half-angles (which of sine and cosine is found by the root, at 45
degrees).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.math.vectors import Floats
from renderer.spherical.elliptic import complete, symmetric
from scenes.arrays import Index

# The search stops at steps in asinh(T) below this; Halley's error is then its cube, 1e-11 of the share of u.
STEP = 2e-4
SEARCHES = 12  # 3 are the most that was ever seen
# Cosines below this are taken as this: their squares would underflow where the ellipse is a hemisphere to the
# last digit.
FLAT = 1e-30


@dataclass(frozen=True, eq=False)
class DiskView:
    """The view of a disk, in arrays (n,). Lengths are in radii; the cone's axis lies `tilt` from the disk's
    axis.
    """

    height: Floats
    offset: Floats
    near: Floats
    far: Floats
    sin_tilt: Floats
    cos_tilt: Floats
    sin_minor: Floats
    cos_minor: Floats
    sin_major: Floats
    cos_major: Floats


def disk_view(height: Floats, offset: Floats, radius: Floats) -> DiskView:
    """The view of a disk from a point at `height` over its plane, of either sign, and `offset` from its axis.

    height, offset (>= 0), radius: (n,), or (1,) to be broadcast, in one unit of length. In the plane (height
    0) the minor angle is 0 outside the rim, 90 degrees inside it, and NaN at the rim.
    """
    h, o = np.abs(height) / radius, offset / radius
    inner, outer = (offset - radius) / radius, (offset + radius) / radius
    near, far = np.sqrt(h * h + inner * inner), np.sqrt(h * h + outer * outer)
    both, ends = near * far, inner * outer
    hh = h * h
    with np.errstate(invalid="ignore", divide="ignore"):
        cos_minor, sin_minor = _half_angle(hh + ends, h, both)
        cos_tilt, sin_tilt = _half_angle(hh - ends, o * h, both)
        total = near + far
        cos_major = cos_minor * (2.0 * np.sqrt(both) / total)
    return DiskView(h, o, near, far, sin_tilt, cos_tilt, sin_minor, cos_minor, 2.0 / total, cos_major)


def _half_angle(cosine: Floats, half_sine: Floats, scale: Floats) -> tuple[Floats, Floats]:
    """cos x and sin x, where cos 2x = cosine / scale and sin 2x = 2 half_sine / scale, x in [0, 90]
    degrees.
    """
    larger = np.sqrt((0.5 * (scale + np.abs(cosine))) / scale)
    smaller = half_sine / scale / larger
    acute = cosine >= 0
    return np.where(acute, larger, smaller), np.where(acute, smaller, larger)


def solid_angle(view: DiskView) -> Floats:
    """Solid angle (n,) in sr. Relative error below 2e-15 from 1e-300 sr to 2 pi; 0 in the disk's plane."""
    cos_minor = np.maximum(view.cos_minor, FLAT)
    ratio = np.maximum(view.cos_major, FLAT) / cos_minor
    with np.errstate(invalid="ignore"):
        omega = 4.0 * view.sin_minor * view.sin_major * (complete(ratio, 1.0 / cos_minor) / cos_minor)
    return np.where(view.height > 0, omega, 0.0)


def sample(view: DiskView, omega: Floats, u: Floats) -> Floats:
    """Unit directions (3, n), uniform in the solid angle `omega` (n,), along three axes: towards the disk's
    axis, across that, and to the disk's plane.

    u: (2, n) in [0, 1). u[0] goes from the near end to the far one, u[1] across. Rows with omega = 0 give NaN
    or anything. The third component keeps its relative accuracy at grazing incidence: height over it is the
    distance to the disk.
    """
    tail = 2.0 * np.minimum(u[0], 1.0 - u[0])
    right = u[0] >= 0.5
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        t = _search(view, omega, np.maximum(tail, 1e-30))
        cos_s = 1.0 / np.sqrt(1.0 + t * t)
        sin_s = t * cos_s
        cos_phi = np.sqrt(view.cos_minor**2 + (view.sin_minor * cos_s) ** 2)
        # sin(minor +- phi), the angles to the two ends; their product is sin^2(minor) cos_s^2
        wide = cos_phi + sin_s * view.cos_minor
        narrow = cos_s * cos_s / wide
        from_near, from_far = np.where(right, wide, narrow), np.where(right, narrow, wide)
        down = 0.5 * view.sin_minor * (view.far * from_far + view.near * from_near)
        along = (
            view.sin_tilt * cos_phi + np.where(right, 1.0, -1.0) * (view.cos_tilt * view.sin_minor) * sin_s
        )
        # The latitude y is v times its largest; 1 - y^2 = (1 - v^2) y_max^2 + (1 - y_max^2)
        band = 1.0 / (cos_s * cos_s + (view.cos_major * sin_s) ** 2)
        across = (view.sin_major * cos_s) ** 2 * band
        level = np.sqrt(4.0 * u[1] * (1.0 - u[1]) * across + view.cos_major**2 * band)
        return np.stack([level * along, (2.0 * u[1] - 1.0) * np.sqrt(across), level * down])


def invert(view: DiskView, omega: Floats, wi: Floats) -> Floats:
    """The u (2, n) that `sample` maps to directions wi (3, n) of its frame, not necessarily unit. Directions
    off the disk give its border.

    Rounding of wi, some 1e-16, shows divided by the half-angles of the ellipse.
    """
    along, across, down = wi
    inner, outer = view.offset - 1.0, view.offset + 1.0
    with np.errstate(invalid="ignore", divide="ignore"):
        from_near = (view.height * along - inner * down) / view.near
        from_far = (outer * down - view.height * along) / view.far
        # The two have the length of the direction's part in the plane of symmetry, squared, as a factor.
        cos2 = np.maximum(from_near, 0.0) * np.maximum(from_far, 0.0)
        sine = along * view.cos_tilt - down * view.sin_tilt
        square = cos2 + sine * sine  # = sin^2(minor) times the same factor
        t = np.abs(sine) / np.sqrt(cos2)
        share = 0.5 * np.where(
            cos2 > 0, _tail(np.minimum(t, 1e30), *_squares(view)) / _total(view, omega), 0.0
        )
        latitude = across / np.sqrt(along * along + across * across + down * down)
        cos2, sin2 = cos2 / square, sine * sine / square
        largest = view.sin_major * np.sqrt(cos2 / (cos2 + view.cos_major**2 * sin2))
        v = np.where(largest > 0, latitude / largest, 0.0)
    share = np.minimum(share, 0.5)
    return np.stack([np.where(sine < 0, share, 1.0 - share), np.clip(0.5 + 0.5 * v, 0.0, 1.0)])


def _total(view: DiskView, omega: Floats) -> Floats:
    """The integral from T = 0: a quarter of the solid angle without its factor."""
    return omega / (4.0 * view.sin_minor * view.sin_major)


def _squares(view: DiskView) -> tuple[Floats, Floats, Floats]:
    """A and B, cos^2 of the major and of the minor half-angle, and the product of the sines."""
    a, b = np.maximum(view.cos_major, FLAT) ** 2, np.maximum(view.cos_minor, FLAT) ** 2
    return a, b, view.sin_minor * view.sin_major


def _tail(t: Floats, a: Floats, b: Floats, sines: Floats) -> Floats:
    """The integral from t (n,) to infinity: R_J(t^2, t^2 + 1/A, t^2 + 1/B, t^2 + 1) / (3 sqrt(A B)).

    The four arguments are multiplied by A B lest they overflow.
    """
    ab = a * b
    start = ab * t * t
    return (ab / 3.0) * symmetric(start, start + b, start + a, start + ab, ab * sines)


def _search(view: DiskView, omega: Floats, share: Floats) -> Floats:
    """The T (n,) right of which lies a share (n,), in (0, 1], of the integral from 0.

    Halley's steps in asinh(T) on the logarithm of the tail. The integrand is log-concave there, hence so is
    the tail, and Newton's steps would converge from anywhere; Halley's are capped at twice Newton's. A row
    stops when its own step is small.
    """
    total = _total(view, omega)
    t = _guess(view, total, 1.0 / share - 1.0)
    a, b, sines = _squares(view)
    goal = share * total
    rows: Index = np.flatnonzero(omega > 0)
    for _ in range(SEARCHES):
        at, aa, bb = t[rows], a[rows], b[rows]
        tail = _tail(at, aa, bb, sines[rows])
        square = at * at
        c, ca, cb = 1.0 + square, 1.0 + aa * square, 1.0 + bb * square
        root = np.sqrt(c)
        slope = -1.0 / (root * np.sqrt(ca * cb) * tail)
        newton = np.log(tail / goal[rows]) / slope
        bend = -at * root * (1.0 / c + aa / ca + bb / cb) - slope
        step = newton / np.maximum(1.0 - 0.5 * newton * bend, 0.5)
        t[rows] = np.maximum(np.sinh(np.arcsinh(at) - step), 0.0)
        rows = rows[np.abs(step) > STEP]
        if not rows.size:
            break
    return t


def _guess(view: DiskView, total: Floats, odds: Floats) -> Floats:
    """A first T: the tail taken as 1 / (1/total + T/total^2 + 2 cos(a) T^2 + 3 cos(a) cos(b) T^3), right at
    both ends.

    The cubic equation for T is solved by its smallest bound and two steps of Newton in the logarithm.
    """
    c1, c2 = 1.0 / total, 2.0 * total * view.cos_minor
    c3 = 1.5 * c2 * view.cos_major
    t = np.minimum(np.minimum(odds * total, np.sqrt(odds / c2)), np.cbrt(odds / c3))
    for _ in range(2):
        f = t * (c1 + t * (c2 + t * c3))
        slope = t * (c1 + t * (2.0 * c2 + t * (3.0 * c3)))
        t = np.where(t > 0, t * (odds / f) ** (f / slope), 0.0)
    return t
