"""Shapes that rays meet by formula, in float64: spheres, disks and their parts, cylinders, emitting
rectangles and small emitting meshes.

Nothing here is tessellated or rounded to float32: a light 1e-12 above a floor is still above it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from renderer.geometry import quadrics
from renderer.geometry.quadrics import sphere_roots
from renderer.math.vectors import Floats, dot
from scenes.arrays import Index, Mask
from scenes.description.shapes import BilinearMesh, Disk, Geometry, Quadric, Sphere, TriangleMesh

RECTANGLE, DISK, SPHERE, TRIANGLE, QUADRIC = 0, 1, 2, 3, 4  # QUADRIC and above: one for each form
BLOCK = 8  # primitives tested at once: bounds the (block, n) temporaries


@dataclass(frozen=True, eq=False)
class AnalyticPrimitives:
    """All k analytic primitives of a scene. Parameters that a kind does not use are 0.

    kind: (k,) RECTANGLE, DISK, SPHERE, TRIANGLE or QUADRIC + a form. shape: (k,). origin: (3, k) a corner or
    a centre. normal: (3, k) the emitting side of flat ones. radius: (k,). side: (k,) -1 for a sphere whose
    normal points inwards.

    x, y (3, k) and lx, ly (k,): unit edges and their lengths of a rectangle. Of a triangle, x and y dotted
    with a point's offset give its coordinates along the two edges. Of a quadric, x, y, z (3, k) are the rows
    of the map to object space; zmin, zmax, inner, phimax: (k,) as in `Part`.
    """

    kind: NDArray[np.int8]
    shape: Index
    origin: Floats
    x: Floats
    y: Floats
    lx: Floats
    ly: Floats
    normal: Floats
    radius: Floats
    side: Floats
    z: Floats
    zmin: Floats
    zmax: Floats
    inner: Floats
    phimax: Floats

    def __len__(self) -> int:
        return self.shape.size

    def closest(self, among: Index, o: Floats, d: Floats, own: Index | None = None) -> tuple[Floats, Index]:
        """Nearest hit of rays o (3, n) or (3, 1), d (3, n) with the primitives `among`: its distance (n,),
        inf for none, and its primitive (n,).

        own: (n,) the primitive that each ray leaves, -1 for none, as in `occluded`.
        """
        n = d.shape[1]
        best, which = np.full(n, np.inf), np.full(n, -1, dtype=np.int64)
        for kind, block in self._blocks(among):
            near, far = self._roots(kind, block, o, d)
            if own is not None:
                near, far = self._leave(kind, block, o, d, near, far, own)
            t = np.where(near > 0, near, np.where(far > 0, far, np.inf))
            j = t.argmin(axis=0)
            t = np.take_along_axis(t, j[None], axis=0)[0]
            closer = t < best
            best = np.where(closer, t, best)
            which = np.where(closer, block[j], which)
        return best, which

    def occluded(
        self,
        among: Index,
        o: Floats,
        d: Floats,
        tmin: Floats,
        tmax: Floats,
        own: Index,
        goal: Index,
    ) -> Mask:
        """(n,): whether a primitive of `among` lies on the ray between tmin and tmax, (n,) each.

        own, goal: (n,) the primitives at the start and at the end of the ray, -1 for none. The goal never
        blocks; the start blocks only as a sphere that the ray leaves inwards. Both are known by their numbers
        and need no tolerance. tmin and tmax keep out other primitives that touch either end.
        """
        blocked = np.zeros(d.shape[1], dtype=np.bool_)
        for kind, block in self._blocks(among):
            near, far = self._roots(kind, block, o, d)
            near, far = self._leave(kind, block, o, d, near, far, own)
            hit = ((near > tmin) & (near < tmax)) | ((far > tmin) & (far < tmax))
            blocked |= (hit & (block[:, None] != goal)).any(axis=0)
        return blocked

    def surface(self, which: Index, p: Floats) -> tuple[Floats, Floats]:
        """Points p (3, n) moved onto their primitives, and the unit normals there (3, n)."""
        origin, sphere = self.origin[:, which], self.kind[which] == SPHERE
        away = p - origin
        with np.errstate(invalid="ignore", divide="ignore"):
            radial = away / np.sqrt(dot(away, away))
        on_sphere = origin + radial * self.radius[which]
        height = dot(away, self.normal[:, which])
        on_plane = p - self.normal[:, which] * height
        out = np.where(sphere, on_sphere, on_plane)
        normal = np.where(sphere, radial * self.side[which], self.normal[:, which])
        for form, rows in self.quadrics_among(which):
            own = which[rows]
            out[:, rows], n = self._on_quadric(form, own, p.take(rows, axis=1))
            normal[:, rows] = n * self.side[own]
        return out, normal

    def _on_quadric(self, form: str, which: Index, p: Floats) -> tuple[Floats, Floats]:
        """Points p (3, n) moved onto quadrics of one form, and the outward unit normals there."""
        axes, local = self.axes(which), self.in_object(which, p)
        moved, normal = quadrics.onto(form, self.part(which), local)
        return p + quadrics.to_world(*axes, moved - local), quadrics.normal_to_world(*axes, normal)

    def quadrics_among(self, which: Index) -> Iterator[tuple[str, Index]]:
        """Each form of quadric among primitives (n,), with its rows (m,)."""
        kind = self.kind[which]
        if kind.max(initial=0) >= QUADRIC:
            for i, form in enumerate(quadrics.FORMS):
                rows = np.flatnonzero(kind == QUADRIC + i)
                if rows.size:
                    yield form, rows

    def axes(self, which: Index) -> tuple[Floats, Floats, Floats]:
        """The rows x, y and z (3, n) of quadrics (n,)."""
        return self.x.take(which, axis=1), self.y.take(which, axis=1), self.z.take(which, axis=1)

    def in_object(self, which: Index, p: Floats) -> Floats:
        """Points p (3, n) in the object spaces of quadrics (n,)."""
        return quadrics.to_object(*self.axes(which), p - self.origin.take(which, axis=1))

    def part(self, which: Index) -> quadrics.Part:
        """The parts of quadrics (n,)."""
        return quadrics.Part(self.radius, self.zmin, self.zmax, self.inner, self.phimax).take(which)

    def _blocks(self, among: Index) -> Iterator[tuple[int, Index]]:
        for kind in range(QUADRIC + len(quadrics.FORMS)):
            members = among[self.kind[among] == kind]
            for start in range(0, members.size, BLOCK):
                yield kind, members[start : start + BLOCK]

    def _leave(
        self,
        kind: int,
        block: Index,
        o: Floats,
        d: Floats,
        near: Floats,
        far: Floats,
        own: Index,
    ) -> tuple[Floats, Floats]:
        """The roots (b, n) with -inf for the surface that the ray leaves, unless it leaves a sphere
        inwards.
        """
        leaves = block[:, None] == own
        inwards = np.zeros_like(leaves)
        if kind == SPHERE:
            inwards = dot(o[:, None, :] - self.origin[:, block, None], d[:, None, :]) < 0
        elif kind >= QUADRIC:
            inwards = quadrics.leaves_inwards(quadrics.FORMS[kind - QUADRIC], *self._local(block, o, d))
        # From a point on the sphere the roots are 0 and -2 f.d; the first is rounding, the second counts if
        # ahead.
        return np.where(leaves, -np.inf, near), np.where(leaves & ~inwards, -np.inf, far)

    def _roots(self, kind: int, block: Index, o: Floats, d: Floats) -> tuple[Floats, Floats]:
        """Distances (b, n) of the nearer and the farther intersection. NaN and -inf stand for none; a flat
        primitive has only the nearer.
        """
        if kind >= QUADRIC:
            part = self.part(block[:, None])
            return quadrics.roots(quadrics.FORMS[kind - QUADRIC], part, *self._local(block, o, d))
        to_origin = self.origin[:, block, None] - o[:, None, :]
        d = d[:, None, :]
        if kind == SPHERE:
            return sphere_roots(to_origin, d, self.radius[block, None])
        normal = self.normal[:, block, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = dot(to_origin, normal) / dot(d, normal)
            on = d * t - to_origin
            if kind == DISK:
                inside = dot(on, on) <= self.radius[block, None] ** 2
            else:
                a, b = dot(on, self.x[:, block, None]), dot(on, self.y[:, block, None])
                inside = (a >= 0) & (b >= 0)
                if kind == RECTANGLE:
                    inside &= (a <= self.lx[block, None]) & (b <= self.ly[block, None])
                else:
                    inside &= a + b <= 1
        t = np.where(inside, t, -np.inf)
        return t, np.full_like(t, -np.inf)

    def _local(self, block: Index, o: Floats, d: Floats) -> tuple[Floats, Floats]:
        """Origins and directions (3, b, n) of rays in the object spaces of quadrics."""
        x, y, z = self.x[:, block, None], self.y[:, block, None], self.z[:, block, None]
        away = o[:, None, :] - self.origin[:, block, None]
        return quadrics.to_object(x, y, z, away), quadrics.to_object(x, y, z, d[:, None, :])


Row = tuple[float, ...]  # one primitive's numbers, in the order of the fields of AnalyticPrimitives
VECTORS = ("origin", "x", "y", "normal", "z")  # the fields of three numbers
NOWHERE = (0.0, 0.0, 0.0)


@singledispatch
def primitives_of(geometry: Geometry, shape: int) -> list[Row]:
    """The primitives of a shape: one, or one for each face of a mesh. shape: its number in the scene.

    A face without area gets NaN; as a light it is refused.
    """
    raise TypeError(f"no formula for rays and {type(geometry).__name__}")


@primitives_of.register
def _(geometry: Sphere, shape: int) -> list[Row]:
    side = -1.0 if geometry.reverse else 1.0
    return [_row(SPHERE, shape, geometry.center, radius=geometry.radius, side=side)]


@primitives_of.register
def _(geometry: Disk, shape: int) -> list[Row]:
    return [_row(DISK, shape, geometry.center, radius=geometry.radius, normal=geometry.normal)]


@primitives_of.register
def _(geometry: Quadric, shape: int) -> list[Row]:
    g, side = geometry, -1.0 if geometry.reverse else 1.0
    kind, axes = QUADRIC + quadrics.FORMS.index(g.form), quadrics.inverse_rows(g)
    part = (g.zmin, g.zmax, g.inner, float(np.radians(g.phimax)))
    return [_row(kind, shape, g.matrix[:, 3], list(axes), radius=float(g.radius), side=side, part=part)]


@primitives_of.register
def _(geometry: BilinearMesh, shape: int) -> list[Row]:
    return [_rectangle(shape, corners, geometry.reverse) for corners in geometry.vertices[geometry.faces]]


@primitives_of.register
def _(geometry: TriangleMesh, shape: int) -> list[Row]:
    return [_triangle(shape, corners, geometry.reverse) for corners in geometry.vertices[geometry.faces]]


def _rectangle(shape: int, corners: Floats, reverse: bool) -> Row:
    """A rectangle by its corners (4, 3) in the order p00 p10 p01 p11."""
    ex, ey = corners[1] - corners[0], corners[2] - corners[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        lx, ly = float(np.linalg.norm(ex)), float(np.linalg.norm(ey))
        normal = np.cross(ex, ey)
        normal = normal / np.linalg.norm(normal) * (-1.0 if reverse else 1.0)
        return _row(RECTANGLE, shape, corners[0], (ex / lx, ey / ly), (lx, ly), normal)


def _triangle(shape: int, corners: Floats, reverse: bool) -> Row:
    """A triangle by its corners (3, 3), a corner a row."""
    a, b = corners[1] - corners[0], corners[2] - corners[0]
    normal = np.cross(a, b)
    with np.errstate(invalid="ignore", divide="ignore"):
        square = normal @ normal
        x, y = np.cross(b, normal) / square, np.cross(normal, a) / square
        normal = normal / np.sqrt(square) * (-1.0 if reverse else 1.0)
    return _row(TRIANGLE, shape, corners[0], (x, y), normal=normal)


def _row(
    kind: int,
    shape: int,
    origin: Floats,
    axes: Sequence[Floats] = (),
    lengths: Row = (0.0, 0.0),
    normal: Floats | None = None,
    radius: float = 0.0,
    side: float = 1.0,
    part: Row = (0.0, 0.0, 0.0, 0.0),
) -> Row:
    n = NOWHERE if normal is None else normal.tolist()
    x, y, z = (*(axis.tolist() for axis in axes), NOWHERE, NOWHERE, NOWHERE)[:3]
    return (float(kind), float(shape), *origin.tolist(), *x, *y, *lengths, *n, radius, side, *z, *part)


def join(rows: Sequence[Row]) -> AnalyticPrimitives:
    """All primitives of a list in one object, in order."""
    names = [field.name for field in fields(AnalyticPrimitives)]
    sizes = [3 if name in VECTORS else 1 for name in names]
    table = np.array(rows, dtype=np.float64).reshape(-1, sum(sizes)).T
    parts = np.split(table, np.cumsum(sizes)[:-1])
    found = {
        name: np.ascontiguousarray(part if len(part) == 3 else part[0])
        for name, part in zip(names, parts, strict=True)
    }
    kind, shape = found.pop("kind").astype(np.int8), found.pop("shape").astype(np.int64)
    return AnalyticPrimitives(kind, shape, **found)
