"""Irradiance from an elliptic cone of constant radiance, clipped at the receiver's horizon: disks, and
spheres from outside.

With half-angles a <= b, (x, y, z) the receiver's normal along the minor axis, the major axis and the cone's
own axis:
- wholly above the horizon: pi sin a sin b z, the vector irradiance lying along the axis by symmetry;
- cut by it: the contour integral 1/2 n . oint (w x dw) / |w|^2 [lambert1760] over the visible arc of the
border and the
  arc of the horizon that closes it, both elementary (`_contour`);
- cut, and narrow or mostly below: the terms of the contour are of the size of the cone, the result of its
cube. Then a
  product rule over the visible segment, of positive terms only (`_cubature`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.math.vectors import Floats
from renderer.spherical.disk import DiskView
from scenes.arrays import Index

# Where the contour hands over to the cubature: the tangent of the major half-angle times the half-width of
# the visible
# segment in units of the ellipse. There the contour's error is some 1e-16 of a result of the size of NARROW
# cubed.
NARROW = 0.2
ACROSS, ALONG = np.polynomial.legendre.leggauss(16), np.polynomial.legendre.leggauss(8)
# A circular cone divides 0 by 0 at the foci: this is small enough to change no digit.
ROUND = 1e-30


def disk_irradiance(view: DiskView, along: Floats, across: Floats, down: Floats) -> Floats:
    """Irradiance (n,) per unit of radiance, W/m^2 per W/(m^2 sr), from a disk that emits towards the point; 0
    in the disk's plane.

    view: `disk_view` of the disk. along, across, down: (n,) components of the receiver's unit normal in the
    frame of `disk.sample`: towards the disk's axis, across that, and to the disk's plane.
    """
    minor = along * view.cos_tilt - down * view.sin_tilt
    axis = along * view.sin_tilt + down * view.cos_tilt
    foci = view.sin_major * view.sin_tilt
    e = _cone((minor, across, axis), (view.sin_minor, view.sin_major), (view.cos_minor, view.cos_major), foci)
    return np.where(view.height > 0, e, 0.0)


def sphere_irradiance(sine: Floats, cosine: Floats, facing: Floats) -> Floats:
    """Irradiance (n,) per unit of radiance from a sphere seen from outside. Wholly above the horizon it is pi
    sine^2 facing.

    sine, cosine: (n,) of the cone's half-angle, sine = radius / distance. facing: (n,) cosine between the
    receiver's normal and the direction of the centre.
    """
    level = np.sqrt(np.maximum((1.0 - facing) * (1.0 + facing), 0.0))
    zero = np.zeros_like(sine)
    return _cone((level, zero, facing), (sine, sine), (cosine, cosine), zero)


@dataclass(frozen=True, eq=False)
class _Cut:
    """A cone that the horizon cuts, in arrays (n,).

    Border points are (sin a ratio cos t, sin b sin t, cos b), not of unit length, with ratio = cos b / cos a;
    there n . w ~ cos(t - turn) + depth. `size` is the length of the normal along the ellipse's axes, (x sin a
    ratio, y sin b).
    """

    normal: tuple[Floats, Floats, Floats]
    sin_minor: Floats
    sin_major: Floats
    cos_minor: Floats
    cos_major: Floats
    ratio: Floats
    foci: Floats
    p: Floats
    q: Floats
    size: Floats
    depth: Floats

    def take(self, rows: Index) -> _Cut:
        """Some of the rows."""
        x, y, z = self.normal
        return _Cut(
            (x[rows], y[rows], z[rows]),
            *(
                v[rows]
                for v in (
                    self.sin_minor,
                    self.sin_major,
                    self.cos_minor,
                    self.cos_major,
                    self.ratio,
                    self.foci,
                )
            ),
            *(v[rows] for v in (self.p, self.q, self.size, self.depth)),
        )


def _cone(
    normal: tuple[Floats, Floats, Floats],
    sines: tuple[Floats, Floats],
    cosines: tuple[Floats, Floats],
    foci: Floats,
) -> Floats:
    """Irradiance by one of the three cases. foci: sqrt(sin^2 b - sin^2 a), given since the difference would
    cancel.
    """
    x, y, z = normal
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(cosines[0] > 0, cosines[1] / cosines[0], 1.0)
        p, q = x * sines[0] * ratio, y * sines[1]
        size = np.sqrt(p * p + q * q)
        depth = z * cosines[1] / size
    e = np.where(depth >= 1, np.pi * sines[0] * sines[1] * z, 0.0)
    rows = np.flatnonzero(np.abs(depth) < 1)
    if rows.size:
        cut = _Cut(normal, *sines, *cosines, ratio, np.maximum(foci, ROUND), p, q, size, depth).take(rows)
        e[rows] = _clipped(cut)
    return e


def _clipped(cut: _Cut) -> Floats:
    """By the contour or, where that would cancel, by the cubature."""
    half = np.where(cut.depth < 0, np.sqrt((1.0 - cut.depth) * (1.0 + cut.depth)), 1.0)
    narrow = cut.sin_major * half < NARROW * cut.cos_major
    e = np.zeros_like(half)
    for rows, rule in ((np.flatnonzero(~narrow), _contour), (np.flatnonzero(narrow), _cubature)):
        if rows.size:
            e[rows] = rule(cut.take(rows))
    return np.maximum(e, 0.0)


def _contour(cut: _Cut) -> Floats:
    """The visible arc of the border, from turn - D to turn + D with cos D = -depth, and the horizon between
    its ends.

    The arc's three integrals, of the solid angle's longitude and along the two foci, are an angle, an arc
    tangent and an inverse hyperbolic sine.
    """
    x, y, z = cut.normal
    sin_d = np.sqrt((1.0 - cut.depth) * (1.0 + cut.depth))
    cos_turn, sin_turn = cut.p / cut.size, cut.q / cut.size
    cos0, sin0 = sin_turn * sin_d - cos_turn * cut.depth, -cos_turn * sin_d - sin_turn * cut.depth
    cos1, sin1 = -sin_turn * sin_d - cos_turn * cut.depth, cos_turn * sin_d - sin_turn * cut.depth
    turned = np.arctan2(-2.0 * cut.ratio * sin_d * cut.depth, cut.ratio**2 * cos0 * cos1 + sin0 * sin1)
    turned = np.where(turned < 0, turned + 2 * np.pi, turned)
    swept = np.arctan2(cut.foci * sin1, cut.cos_major) - np.arctan2(cut.foci * sin0, cut.cos_major)
    grown = _focal(cut, cos1, sin1) - _focal(cut, cos0, sin0)
    a, b, c = cut.sin_minor * cut.ratio, cut.sin_major, cut.cos_major
    # n . (end x start) of the border points is 2 sin(D) a b c / size: never negative, which rounding could
    # hide
    horizon = np.arctan2(
        2.0 * sin_d * (a * b * c / cut.size), a * a * cos0 * cos1 + b * b * sin0 * sin1 + c * c
    )
    e = z * cut.sin_minor * b * turned + horizon
    e -= x * b * cut.cos_minor**2 * (swept / cut.foci)
    e += y * cut.sin_minor * c**2 * (grown / cut.foci)
    return 0.5 * e


def _focal(cut: _Cut, cosine: Floats, sine: Floats) -> Floats:
    """artanh(foci cos t / cos a), written as an inverse sine lest its argument round to 1."""
    norm = np.sqrt((cut.ratio * cosine) ** 2 + sine * sine)
    return np.arcsinh(cut.foci * cosine / (cut.cos_minor * norm))


def _cubature(cut: _Cut) -> Floats:
    """Gauss over the visible segment of the ellipse, projected to a unit disk: (cos t, v sin t), t in [0, D],
    v in [-1, 1].

    The integrand is n . w / |w|^4, and n . w ~ cos t - cos D = 2 sin((D + t) / 2) sin((D - t) / 2).
    """
    wide = 2.0 * np.arctan2(np.sqrt(1.0 + cut.depth), np.sqrt(1.0 - cut.depth))
    tan_a, tan_b = cut.sin_minor / cut.cos_minor, cut.sin_major / cut.cos_major
    # Rows of the turned and stretched frame
    ax, ay = tan_a * cut.p / cut.size, tan_b * cut.q / cut.size
    bx, by = -tan_a * cut.q / cut.size, tan_b * cut.p / cut.size
    e = np.zeros_like(wide)
    for node, weight in zip(*ACROSS, strict=True):
        t = (0.5 + 0.5 * node) * wide
        cosine, sine = np.cos(t), np.sin(t)
        inner = np.zeros_like(wide)
        for v, share in zip(*ALONG, strict=True):
            right, up = ax * cosine + bx * (sine * v), ay * cosine + by * (sine * v)
            inner += share / (1.0 + right * right + up * up) ** 2
        lift = 2.0 * np.sin(0.5 * (wide + t)) * np.sin((0.25 - 0.25 * node) * wide)
        e += weight * (sine * sine * lift * inner)
    return e * (0.5 * wide) * (tan_a * tan_b * cut.size / cut.cos_major)
