"""Texture coordinates of points on shapes, as pbrt-v4 defines them.

On triangles and parallelograms they are affine in the point. On spheres and disks they are angles about the
shape's own axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.geometry.analytic import SPHERE, AnalyticPrimitives
from renderer.geometry.primitives import is_analytic
from renderer.geometry.quadrics import texture_coordinates, to_world
from renderer.math.vectors import Floats, cross, dot
from scenes.arrays import Index
from scenes.description.materials import is_oriented
from scenes.description.shapes import Mesh, ShapeDescription


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Texture coordinates of the t triangles and the k analytic primitives of a scene, in their order.

    origin: (2, m) and along: (2, 3, m); on face j, uv = origin + along . p. of_triangle: (t,) and
    of_primitive: (k,) the face of each, -1 for none. frames: (3, 3, k) whose columns are the axes of spheres
    and disks. oriented: whether a surface of the scene scatters by the direction of dp/du.
    """

    origin: Floats
    along: Floats
    of_triangle: Index
    of_primitive: Index
    frames: Floats
    analytic: AnalyticPrimitives
    oriented: bool

    def at(self, p: Floats, triangle: Index, primitive: Index) -> Floats:
        """(2, n) coordinates of points p (3, n) on their primitives."""
        face = self._face(triangle, primitive)
        out = np.zeros((2, p.shape[1]))
        rows = np.flatnonzero(face >= 0)
        if rows.size:
            mine, own = p.take(rows, axis=1), face[rows]
            for i in range(2):
                out[i, rows] = self.origin[i, own] + dot(self.along[i].take(own, axis=1), mine)
        rows = np.flatnonzero((triangle < 0) & (primitive >= 0) & (face < 0))
        if rows.size:
            out[:, rows] = self._round(p.take(rows, axis=1), primitive[rows])
        return out

    def tangent(self, p: Floats, triangle: Index, primitive: Index) -> Floats:
        """A vector (3, n) along dp/du or against it, of any length, at points p (3, n) on their primitives; 0
        where the coordinates are degenerate.

        On an affine face it lies in the face, normal to the gradient of v. On spheres and disks it turns
        about their axis.
        """
        face = self._face(triangle, primitive)
        out = np.zeros_like(p)
        rows = np.flatnonzero(face >= 0)
        if rows.size:
            du, dv = (self.along[i].take(face[rows], axis=1) for i in range(2))
            out[:, rows] = cross(dv, cross(du, dv))
        rows = np.flatnonzero((triangle < 0) & (primitive >= 0) & (face < 0))
        if rows.size:
            which = primitive[rows]
            away = p.take(rows, axis=1) - self.analytic.origin.take(which, axis=1)
            out[:, rows] = cross(np.ascontiguousarray(self.frames[:, 2].take(which, axis=1)), away)
            for _, some in self.analytic.quadrics_among(which):
                own = which[some]
                local = self.analytic.in_object(own, p.take(rows[some], axis=1))
                turn = np.stack([-local[1], local[0], np.zeros(own.size)])
                out[:, rows[some]] = to_world(*self.analytic.axes(own), turn)
        return out

    def differentials(
        self, p: Floats, triangle: Index, primitive: Index
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """dp/du, dp/dv, dn/du and dn/dv (3, n) of points p (3, n) on faces, whole spheres and whole disks.

        They are not finite where the coordinates are degenerate.
        """
        face = self._face(triangle, primitive)
        dpdu, dpdv, dndu, dndv = (np.zeros_like(p) for _ in range(4))
        rows = np.flatnonzero(face >= 0)
        if rows.size:
            du, dv = (self.along[i].take(face[rows], axis=1) for i in range(2))
            normal = cross(du, dv)
            with np.errstate(divide="ignore", invalid="ignore"):
                square = dot(normal, normal)
                dpdu[:, rows], dpdv[:, rows] = cross(dv, normal) / square, cross(normal, du) / square
        rows = np.flatnonzero((triangle < 0) & (primitive >= 0) & (face < 0))
        if rows.size:
            which = primitive[rows]
            away = p.take(rows, axis=1) - self.analytic.origin.take(which, axis=1)
            x, y, z = np.ascontiguousarray(self.frames.take(which, axis=2).transpose(1, 0, 2))
            a, b, c = (dot(axis, away) for axis in (x, y, z))
            ring, radius = np.sqrt(a * a + b * b), self.analytic.radius[which]
            sphere = self.analytic.kind[which] == SPHERE
            dpdu[:, rows] = 2 * np.pi * (y * a - x * b)
            with np.errstate(divide="ignore", invalid="ignore"):
                outwards = (x * a + y * b) / ring
            dpdv[:, rows] = np.where(sphere, np.pi * (z * ring - outwards * c), -outwards * radius)
            dndu[:, rows] = np.where(sphere, dpdu[:, rows] / radius, 0.0)
            dndv[:, rows] = np.where(sphere, dpdv[:, rows] / radius, 0.0)
        return dpdu, dpdv, dndu, dndv

    def _face(self, triangle: Index, primitive: Index) -> Index:
        return np.where(triangle >= 0, _of(self.of_triangle, triangle), _of(self.of_primitive, primitive))

    def _round(self, p: Floats, which: Index) -> Floats:
        """Coordinates of spheres and disks. On a sphere u is the angle about z and v = 1 - theta/pi; on a
        disk v falls from 1 at the centre to 0 at the rim.
        """
        away, frame = p - self.analytic.origin.take(which, axis=1), self.frames.take(which, axis=2)
        x, y, z = (dot(frame[:, i], away) for i in range(3))
        phi = np.arctan2(y, x)
        u = np.where(phi < 0, phi + 2 * np.pi, phi) / (2 * np.pi)
        theta = np.arctan2(np.sqrt(x * x + y * y), z)
        flat = 1.0 - np.sqrt(x * x + y * y) / self.analytic.radius[which]
        out = np.stack([u, np.where(self.analytic.kind[which] == SPHERE, 1.0 - theta / np.pi, flat)])
        for form, rows in self.analytic.quadrics_among(which):
            own = which[rows]
            local = self.analytic.in_object(own, p.take(rows, axis=1))
            out[:, rows] = texture_coordinates(form, self.analytic.part(own), local)
        return out


def _of(table: Index, row: Index) -> Index:
    return table[row] if table.size else np.full_like(row, -1)


def coordinates(shapes: Sequence[ShapeDescription], analytic: AnalyticPrimitives) -> Coordinates | None:
    """The coordinates of a scene in which a surface varies, else None. analytic: the primitives of these
    shapes, of whose varying patches all are parallelograms.
    """
    if not any(s.needs_uv for s in shapes):
        return None
    corners: list[Floats] = [np.zeros((0, 3, 3))]
    uv: list[Floats] = [np.zeros((0, 3, 2))]
    triangles: list[int] = []
    primitives: list[int] = []
    frames: list[Floats] = []
    faces = 0
    for s in shapes:
        g = s.geometry
        if not isinstance(g, Mesh):
            primitives.append(-1)
            frames.append(np.eye(3) if g.frame is None else g.frame)
            continue
        own, own_uv = _faces(s, g)
        corners.append(own)
        uv.append(own_uv)
        numbers = range(faces, faces + len(own))
        if is_analytic(s):
            primitives.extend(numbers)
            frames.extend(np.eye(3) for _ in numbers)
        else:
            triangles.extend(numbers)
        faces += len(own)
    origin, along = affine(np.concatenate(corners), np.concatenate(uv))
    return Coordinates(
        origin,
        along,
        np.array(triangles, dtype=np.int64),
        np.array(primitives, dtype=np.int64),
        np.stack(frames or [np.eye(3)], axis=2),
        analytic,
        any(is_oriented(s.material) for s in shapes),
    )


def _faces(s: ShapeDescription, mesh: Mesh) -> tuple[Floats, Floats]:
    """Corners (m, 3, 3) of faces and their coordinates (m, 3, 2), three corners a face. An analytic patch is
    one face, any other patch two.
    """
    if is_analytic(s):
        return mesh.vertices[mesh.faces[:, :3]], mesh.corner_uv()[:, :3]
    return mesh.vertices[mesh.triangulated().faces], mesh.triangle_uv()


def affine(corners: Floats, values: Floats) -> tuple[Floats, Floats]:
    """The affine functions with values (m, 3, k) at corners (m, 3, 3): origin (k, m) and along (k, 3, m) of
    origin + along . p. A face without area takes the value of its first corner.
    """
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(a, b)
    square = (normal * normal).sum(axis=1, keepdims=True)
    square = np.where(square > 0, square, np.inf)
    x, y = np.cross(b, normal) / square, np.cross(normal, a) / square
    du, dv = values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]
    along = du[:, :, None] * x[:, None, :] + dv[:, :, None] * y[:, None, :]  # (m, k, 3)
    origin = values[:, 0] - (along * corners[:, None, 0]).sum(axis=2)
    return np.ascontiguousarray(origin.T), np.ascontiguousarray(along.transpose(1, 2, 0))
