"""Alpha cutouts: a ray hits a point of a shape with the probability that the shape's alpha has there.

As in pbrt-v4's GeometricPrimitive::Intersect [pharr2023, sec. 7.1.1] a hash of the ray's origin and direction
decides, so that one ray always has one outcome. A ray that passes goes on behind the surface. Camera rays and
shadow rays follow the same rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.geometry.analytic import AnalyticPrimitives
from renderer.geometry.primitives import on_surfaces
from renderer.geometry.triangles import Triangles
from renderer.geometry.uv import Coordinates
from renderer.math.hashing import hash_vectors, to_unit
from renderer.math.vectors import Floats, dot
from renderer.textures import Places, evaluate
from scenes.arrays import Index, Mask
from scenes.description.shapes import ShapeDescription
from scenes.description.textures import Texture


@dataclass(frozen=True, eq=False)
class Cutouts:
    """The shapes with an alpha. some: (s,) which they are. alphas: theirs, by shape."""

    some: Mask
    alphas: tuple[tuple[int, Texture], ...]
    coordinates: Coordinates | None

    def passed(
        self,
        o: Floats,
        d: Floats,
        p: Floats,
        n: Floats,
        shape: Index,
        triangle: Index,
        primitive: Index,
    ) -> Mask:
        """(n,): whether rays from o along d (3, n) go through the points p (3, n) of their shapes (n,), with
        normals n (3, n).
        """
        alpha = np.ones(shape.size)
        for number, texture in self.alphas:
            rows = np.flatnonzero(shape == number)
            if rows.size:
                uv = self._uv(p, triangle, primitive, rows)
                at = Places(uv, p.take(rows, axis=1), n.take(rows, axis=1))
                alpha[rows] = evaluate(texture, at)[0]
        return to_unit(hash_vectors(o, d)) >= alpha

    def _uv(self, p: Floats, triangle: Index, primitive: Index, rows: Index) -> Floats:
        if self.coordinates is None:
            return np.zeros((2, rows.size))
        return self.coordinates.at(p.take(rows, axis=1), triangle[rows], primitive[rows])


def cutouts(shapes: Sequence[ShapeDescription], coordinates: Coordinates | None) -> Cutouts | None:
    """The cutouts of a scene in which some shape has an alpha, else None."""
    alphas = tuple((i, s.alpha) for i, s in enumerate(shapes) if s.alpha is not None)
    if not alphas:
        return None
    return Cutouts(np.array([s.alpha is not None for s in shapes]), alphas, coordinates)


@dataclass(frozen=True, eq=False)
class CutoutBlockers:
    """The shapes with an alpha among those that may shade: their triangles and analytic primitives."""

    cutouts: Cutouts
    triangles: Triangles | None
    analytic: Index
    all: AnalyticPrimitives

    def occluded(
        self,
        p: Floats,
        n: Floats,
        triangle: Index,
        primitive: Index,
        wi: Floats,
        reach: Floats,
    ) -> Mask:
        """(n,): whether rays wi (3, n) from points p with normals n (3, n), on their side, are stopped within
        the distance `reach` (n,). triangle, primitive: (n,) what the points lie on, -1 for none.
        """
        out = np.zeros(reach.size, dtype=np.bool_)
        rows, left = np.arange(reach.size), reach
        while rows.size:
            t, triangle, primitive = self._closest(p, n, triangle, primitive, wi)
            met = np.flatnonzero(t < left)
            rows, left, t = rows[met], left[met] - t[met], t[met]
            triangle, primitive = triangle[met], primitive[met]
            o, wi = p.take(met, axis=1), wi.take(met, axis=1)
            p = o + wi * t
            p, n = on_surfaces(self.triangles, self.all, p, triangle, primitive)
            n = np.where(dot(n, wi) < 0, -n, n)
            shape = self._shape(triangle, primitive)
            passed = self.cutouts.passed(o, wi, p, n, shape, triangle, primitive)
            out[rows[~passed]] = True
            on = np.flatnonzero(passed)
            rows, left, triangle, primitive = rows[on], left[on], triangle[on], primitive[on]
            p, n, wi = p.take(on, axis=1), n.take(on, axis=1), wi.take(on, axis=1)
        return out

    def _closest(
        self, p: Floats, n: Floats, triangle: Index, primitive: Index, wi: Floats
    ) -> tuple[Floats, Index, Index]:
        t, analytic = self.all.closest(self.analytic, p, wi, primitive)
        if self.triangles is None:
            return t, np.full_like(analytic, -1), analytic
        far, index = self.triangles.closest_from(p, n, triangle, wi)
        nearer = far < t
        return np.where(nearer, far, t), np.where(nearer, index, -1), np.where(nearer, -1, analytic)

    def _shape(self, triangle: Index, primitive: Index) -> Index:
        shape = self.all.shape.take(primitive) if len(self.all) else primitive
        return (
            shape
            if self.triangles is None
            else np.where(triangle >= 0, self.triangles.shape[triangle], shape)
        )
