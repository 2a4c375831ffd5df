"""Rectangular lights: `area`, and `solid-angle` by the spherical rectangle of Urena, Fajardo and King.

The published formulas take angles as acos of nearly parallel normals and the solid angle as a difference from
2 pi. Both lose every digit for small or edge-on lights. What is used here is the same map, rearranged:

- Solid angle: two triangles, tan(O/2) = |z| lx ly / denominator [vanoosterom1983, eq. 8]. The numerator is a product,
  so a small solid angle keeps its relative accuracy: no branch, no threshold, exact 0 on the light's plane.
- With b(y) = y / sqrt(y^2 + z^2) and c(x) = x / sqrt(x^2 + z^2), the solid angle of [0, x] x [0, y] is asin(b c), so
  the x that splits off a solid angle t obeys asin(b1 c) - asin(b0 c) = t, whence
  c = sin t / sqrt((b1 - b0)^2 + 4 b0 b1 sin^2(t/2)): [urena2013] without the 2 pi.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.arrays import Floats, combine, cross, dot, gather, normalize
from renderer.lights.protocol import LIGHTS, AreaSampling, DirectionSampler, Emitters, Index, LightExample, receivers
from renderer.records import LightSample
from scenes.description import BilinearMesh, Diffuse, Emission, ShapeDescription
from scenes.errors import SceneError

# Corners given as decimal text are right-angled to some 1e-16 of their size; a sheared patch is off by far more.
RIGHT_ANGLE = 1e-9
# Where the closed form only starts a search: |x| / |z| beyond which it loses 1e-10, and the sr below which it loses 1e-8.
GRAZING, SMALL = 30.0, 1e-8


@dataclass(frozen=True, eq=False)
class RectangleLights:
    """corner, x, y, normal: (3, k), x and y unit vectors along the edges; lx, ly: (k,) edge lengths."""

    emitters: Emitters
    corner: Floats
    x: Floats
    y: Floats
    normal: Floats
    lx: Floats
    ly: Floats

    @property
    def shape(self) -> NDArray[np.int64]:
        """(k,) indices of the scene's shapes."""
        return self.emitters.shape

    @property
    def area(self) -> Floats:
        """(k,) areas."""
        return self.lx * self.ly

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        """`area` and `solid-angle`."""
        return {"area": AreaSampling(self), "solid-angle": RectangleSolidAngle(self)}

    @staticmethod
    def missing(technique: str) -> str | None:
        """See `LightKind`."""
        return None if technique in ("area", "solid-angle") else f"rectangles have no {technique} sampling"

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        """Every emitting planar patch; `make` refuses those that are no rectangles."""
        return shape.emission is not None and isinstance(shape.geometry, BilinearMesh)

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription], index: Sequence[int]) -> RectangleLights:
        """One light a patch; the patches of a mesh share its shape."""
        parts = [_patches(s) for s in shapes]
        points = np.concatenate(parts, axis=2)
        each = [part.shape[2] for part in parts]
        corner, ex, ey = points[:, 0], points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
        lx, ly = np.sqrt(dot(ex, ex)), np.sqrt(dot(ey, ey))
        turn = np.repeat([_turn(s) for s in shapes], each)
        emitters = Emitters.of(shapes, index).repeat(each)
        return cls(emitters, corner, ex / lx, ey / ly, normalize(cross(ex, ey)) * turn, lx, ly)

    def position(self, index: Index, u: Floats) -> tuple[Floats, Floats]:
        """See `Surface`."""
        x, y = (gather(self.x, index), gather(self.y, index))
        p = gather(self.corner, index) + x * (u[0] * gather(self.lx, index))
        p += y * (u[1] * gather(self.ly, index))
        return p, gather(self.normal, index)

    def emits(self, index: Index, ref_p: Floats, cos_light: Floats) -> NDArray[np.bool_]:
        """See `Surface`."""
        return self.emitters.emits(index, cos_light)

    def meet(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """See `Surface`."""
        x, y, z = self.local(index, origin)
        normal = gather(self.normal, index)
        cos_light = -dot(wi, normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            dist = z / cos_light
            along_x = dist * dot(wi, gather(self.x, index)) - x
            along_y = dist * dot(wi, gather(self.y, index)) - y
            inside = (along_x >= 0) & (along_x <= gather(self.lx, index))
            inside &= (along_y >= 0) & (along_y <= gather(self.ly, index))
            hit = inside & (dist > 0) & self.emitters.emits(index, cos_light)
        return np.where(hit, dist, np.inf), cos_light

    def local(self, index: Index, p: Floats) -> tuple[Floats, Floats, Floats]:
        """The corner as seen from p along the edges, and p's height over the emitting side: x0, y0, z, each (n,)."""
        d = gather(self.corner, index) - p
        return dot(d, gather(self.x, index)), dot(d, gather(self.y, index)), -dot(d, gather(self.normal, index))

    @classmethod
    def examples(cls) -> list[LightExample]:
        """See `LightKind`."""
        patch = BilinearMesh(
            np.array([[-1.0, 2.0, -0.5], [1.0, 2.0, -0.5], [-1.0, 2.0, 0.5], [1.0, 2.0, 0.5]]), np.array([[0, 1, 2, 3]])
        )
        shape = ShapeDescription(patch, Diffuse(np.zeros(3)), Emission(np.array([3.0, 2.0, 1.0])))
        return [LightExample("a rectangle facing down", shape, *receivers(np.array([0.0, 2.0, 0.0]), 0.5))]


@dataclass(frozen=True, eq=False)
class RectangleSolidAngle:
    """Uniform in the solid angle of the rectangle: weights stay bounded however close it comes [urena2013]."""

    lights: RectangleLights

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        """See `DirectionSampler`."""
        li = self.lights
        x0, y0, z = li.local(index, ref_p)
        x1, y1 = x0 + gather(li.lx, index), y0 + gather(li.ly, index)
        omega = solid_angle(x0, x1, y0, y1, z)
        valid = omega > 0
        if not li.emitters.two_sided.all():
            valid &= li.emitters.emits(index, z)
        with np.errstate(invalid="ignore", divide="ignore"):
            x, y = invert(u, omega, x0, x1, y0, y1, z)
            dist = np.sqrt(x * x + y * y + z * z)
            scale = 1.0 / dist
            frame = (gather(li.x, index), gather(li.y, index), gather(li.normal, index))
            wi = combine(frame, x * scale, y * scale, -z * scale)
            pdf = 1.0 / omega
        return LightSample(wi, dist, frame[2], gather(li.emitters.radiance, index), pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        """See `DirectionSampler`."""
        li = self.lights
        x0, y0, z = li.local(index, ref_p)
        omega = solid_angle(x0, x0 + gather(li.lx, index), y0, y0 + gather(li.ly, index), z)
        hit = (li.meet(index, ref_p, wi)[0] < np.inf) & (omega > 0)
        return np.where(hit, 1.0 / np.where(hit, omega, 1.0), 0.0)


def solid_angle(x0: Floats, x1: Floats, y0: Floats, y1: Floats, z: Floats) -> Floats:
    """Solid angle (n,) in sr of the rectangle [x0, x1] x [y0, y1] at height z, from the origin [vanoosterom1983, eq. 8].

    Relative error below 1e-14 from 1e-17 sr up to a hemisphere, except right above an edge or the diagonal, where it
    is 1e-16 of the size over the distance (1e-8 at 1e-8 of the size); 0 at z = 0.
    """
    xx0, xx1, yy0, yy1, zz = x0 * x0, x1 * x1, y0 * y0, y1 * y1, z * z
    r00, r10 = np.sqrt(xx0 + yy0 + zz), np.sqrt(xx1 + yy0 + zz)
    r01, r11 = np.sqrt(xx0 + yy1 + zz), np.sqrt(xx1 + yy1 + zz)
    across = x0 * x1 + y0 * y1 + zz  # p00 . p11 and p10 . p01 are both this
    volume = np.abs(z) * (x1 - x0) * (y1 - y0)
    bottom, top = x0 * x1 + yy0 + zz, x0 * x1 + yy1 + zz
    left, right = xx0 + y0 * y1 + zz, xx1 + y0 * y1 + zz
    lower = r00 * r10 * r11 + bottom * r11 + right * r00 + across * r10
    upper = r00 * r11 * r01 + across * r01 + top * r00 + left * r11
    return 2.0 * (np.arctan2(volume, lower) + np.arctan2(volume, upper))


def invert(
    u: Floats, omega: Floats, x0: Floats, x1: Floats, y0: Floats, y1: Floats, z: Floats
) -> tuple[Floats, Floats]:
    """The point (x, y) that u (2, n) picks, uniform in solid angle. Rows with omega = 0 give NaN or an edge.

    1 - c^2 loses eps (x/z)^4 of x, and t loses eps / omega of its range: beyond GRAZING and below SMALL the closed form
    only starts a root search. Error of the solid angle left of x, relative to the whole: below 1e-7 wherever tested.
    """
    zz = z * z
    b0, b1 = y0 / np.sqrt(y0 * y0 + zz), y1 / np.sqrt(y1 * y1 + zz)
    c0 = x0 / np.sqrt(x0 * x0 + zz)
    t = np.arcsin(b1 * c0) - np.arcsin(b0 * c0) + u[0] * omega
    half = np.sin(0.5 * t)
    sine = np.sin(t)
    gap = _difference(y0, y1, b0, b1, zz)
    square = gap * gap + 4.0 * b0 * b1 * half * half
    c = sine / np.sqrt(np.maximum(square, sine * sine))
    x = np.abs(z) * c / np.sqrt(np.maximum((1.0 - c) * (1.0 + c), 1e-300))
    x = np.minimum(np.maximum(x, x0), x1)
    grazing = np.flatnonzero(((np.abs(x) > GRAZING * np.abs(z)) | (omega < SMALL)) & (omega > 0))
    if grazing.size:
        x[grazing] = _search(x[grazing], (u[0] * omega)[grazing], *(v[grazing] for v in (x0, x1, y0, y1, z)))
    dd = x * x + zz
    h0, h1 = y0 / np.sqrt(dd + y0 * y0), y1 / np.sqrt(dd + y1 * y1)
    h = h0 + u[1] * _difference(y0, y1, h0, h1, dd)
    y = h * np.sqrt(dd) / np.sqrt(np.maximum((1.0 - h) * (1.0 + h), 1e-300))
    return x, np.minimum(np.maximum(y, y0), y1)


def _search(x: Floats, target: Floats, x0: Floats, x1: Floats, y0: Floats, y1: Floats, z: Floats) -> Floats:
    """The x (n,) left of which lies a solid angle of target (n,): Newton's steps, halving where one leaves the bracket.

    A row stops when its own step no longer moves it, so that its bits do not depend on the other rows.
    """
    x, low, high = x.copy(), x0.copy(), x1.copy()
    rows = np.arange(x.size)
    for _ in range(60):
        at, bottom, top, height = x[rows], y0[rows], y1[rows], z[rows]
        excess = solid_angle(x0[rows], at, bottom, top, height) - target[rows]
        low[rows], high[rows] = np.where(excess < 0, at, low[rows]), np.where(excess < 0, high[rows], at)
        dd = at * at + height * height
        h0, h1 = bottom / np.sqrt(dd + bottom * bottom), top / np.sqrt(dd + top * top)
        step = excess * dd / (np.abs(height) * _difference(bottom, top, h0, h1, dd))
        moved = at - step
        inside = (moved >= low[rows]) & (moved <= high[rows])
        x[rows] = np.where(inside, moved, 0.5 * (low[rows] + high[rows]))
        rows = rows[np.abs(x[rows] - at) > 1e-14 * (x1[rows] - x0[rows])]
        if not rows.size:
            break
    return x


def _difference(y0: Floats, y1: Floats, b0: Floats, b1: Floats, dd: Floats) -> Floats:
    """b1 - b0 for b = y / sqrt(y^2 + dd). Where the signs agree it is rationalised, since the difference would cancel."""
    # b1^2 - b0^2 = dd (y1^2 - y0^2) / ((y1^2 + dd)(y0^2 + dd))
    same = b0 * b1 > 0
    total = np.where(same, b0 + b1, 1.0)
    stable = dd * ((y1 - y0) * (y1 + y0)) / ((y1 * y1 + dd) * (y0 * y0 + dd) * total)
    return np.where(same, stable, b1 - b0)


def _patches(shape: ShapeDescription) -> Floats:
    """The corners (3, 4, q) of all patches of an emitting mesh; SceneError where one is no rectangle."""
    mesh = shape.geometry
    assert isinstance(mesh, BilinearMesh)
    corners = np.ascontiguousarray(mesh.vertices[mesh.faces].transpose(2, 1, 0))
    ex, ey = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    size = np.sqrt(dot(ex, ex) * dot(ey, ey))
    skew = np.abs(dot(ex, ey)) > RIGHT_ANGLE * size
    opposite = np.abs(corners[:, 3] - corners[:, 1] - ey).max(axis=0) > RIGHT_ANGLE * np.abs(corners).max()
    if ((size == 0) | skew | opposite).any():
        raise SceneError("an emitting bilinearmesh must be a rectangle with area; this patch is not", shape.where)
    return corners


def _turn(shape: ShapeDescription) -> float:
    return -1.0 if isinstance(shape.geometry, BilinearMesh) and shape.geometry.reverse else 1.0


LIGHTS.add("rectangle", RectangleLights)
