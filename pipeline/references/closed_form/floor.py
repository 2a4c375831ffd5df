"""The receivers' plane as an integrand: exact irradiance, its measure on the film, and its singularities.

Coordinates on the plane are (x, s): s runs along the line where the light's plane meets it, x away from it.
Near that line a light that almost touches makes the irradiance vary fastest, and then in x alone. An area dA
of the plane covers |det M| H / z^3 dA of the film, where M maps world directions to camera space, H is the
eye's height and z the depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.references.closed_form import emitters
from pipeline.references.closed_form.emitters import PARALLEL
from pipeline.references.closed_form.film import FilmPlane
from pipeline.references.closed_form.patches import Plane
from pipeline.references.closed_form.quadrature import Cells
from pipeline.references.closed_form.scene import ClosedFormScene
from scenes.arrays import Array

DEPTH_STEP = 2.0  # a cell's depths may differ by this many times its smallest
_U, _V = (grid.ravel() for grid in np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0]))


@dataclass(frozen=True, eq=False)
class Floor:
    """The receivers' plane with orthonormal axes. origin, x_axis, s_axis: (3,), world space."""

    scene: ClosedFormScene
    plane: Plane
    film: FilmPlane
    origin: Array
    x_axis: Array
    s_axis: Array

    @property
    def height(self) -> float:
        """The eye's height over the plane."""
        return float(self.plane.height(self.film.eye))

    def project(self, film_points: Array) -> Array:
        """World points (..., 3) of the plane that are seen at film points (..., 3)."""
        d = film_points @ self.film.to_world.T
        down = d @ self.plane.normal
        t = -self.height / np.where(down < 0, down, -np.inf)
        return self.film.eye + t[..., None] * d

    def coordinates(self, film_points: Array) -> Array:
        """Coordinates (x, s), (..., 2), of the plane's points that are seen at film points (..., 3)."""
        d = film_points @ self.film.to_world.T
        t = -self.height / (d @ self.plane.normal)
        to_eye = self.film.eye - self.origin
        return np.stack([to_eye @ axis + t * (d @ axis) for axis in (self.x_axis, self.s_axis)], axis=-1)

    def irradiance(self, points: Array) -> Array:
        """Irradiance (n,) per unit radiance, or intensity, at points (n, 3), on the camera's side."""
        return emitters.irradiance(self.scene.light, points, self.plane, self.scene.two_sided)

    def value(self, x: Array, s: Array) -> Array:
        """Irradiance per unit radiance times film area per area of the plane, at (x, s) (...)."""
        points = self.origin + x.reshape(-1, 1) * self.x_axis + s.reshape(-1, 1) * self.s_axis
        return self.irradiance(points).reshape(x.shape) * self._density(self._depth(x, s))

    def most(self, cells: Cells) -> Array:
        """Upper bound (n,) of `value` in the cells."""
        highest = emitters.most_irradiance(self.scene.light, self.plane)
        return highest * self._density(self._depth(*cells.at(_U, _V)).min(axis=1))

    def roughly(self, cells: Cells) -> Array:
        """Estimate (n,) of the integral of `value` over cells, by the midpoint rule.

        It is capped by the flux over the whole plane: the middle may be a point light's foot.
        """
        middle = cells.at(np.array([0.5]), np.array([0.5]))
        rough, most = self.value(*middle)[:, 0] * cells.area, emitters.most_flux(self.scene.light)
        return rough if most is None else np.minimum(rough, most * self._density(self._depth(*middle))[:, 0])

    def resolved(self, cells: Cells) -> tuple[Array, Array]:
        """Each direction's extent over the distance to the nearest singularity: light boundary or depth 0.

        The irradiance is analytic away from the boundary of the light, so that a cell no longer than its
        distance to it lies well inside the region of convergence.
        """
        x, s = cells.at(_U, _V)
        points = self.origin + x[..., None] * self.x_axis + s[..., None] * self.s_axis
        boundary = emitters.boundary(self.scene.light, points, self.x_axis, self.s_axis)
        near_x, near_s = (np.maximum(d.min(axis=1), 1e-300) for d in boundary)
        depth = self._depth(x, s).reshape(-1, 3, 3)  # (n, across, along)
        deepest = DEPTH_STEP * depth.min(axis=(1, 2))
        x0, x1, l0, l1, r0, r1 = cells.shape
        slant = np.maximum(np.abs(l1 - l0), np.abs(r1 - r0))
        along = np.maximum.reduce(
            [(x1 - x0) / near_x, slant / near_s, np.ptp(depth, axis=2).max(axis=1) / deepest]
        )
        across = np.maximum(
            np.maximum(r0 - l0, r1 - l1) / near_s, np.ptp(depth, axis=1).max(axis=1) / deepest
        )
        return along, across

    def _depth(self, x: Array, s: Array) -> Array:
        forward = self.film.to_camera[2]
        return (
            forward @ (self.origin - self.film.eye)
            + x * (forward @ self.x_axis)
            + s * (forward @ self.s_axis)
        )

    def _density(self, depth: Array) -> Array:
        return np.abs(np.linalg.det(self.film.to_camera)) * self.height / np.maximum(depth, 1e-300) ** 3


def make_floor(scene: ClosedFormScene, film: FilmPlane) -> Floor | None:
    """The receivers' plane with axes that suit the light; None without receivers, or if the eye is in it."""
    plane, own = scene.plane, emitters.own_plane(scene.light)
    if plane is None or plane.height(film.eye) <= 0:
        return None
    lowest = emitters.farthest(scene.light, -plane.normal)
    foot = lowest - plane.height(lowest) * plane.normal
    if own is None:
        x_axis = _in_plane(np.eye(3)[np.argmin(np.abs(plane.normal))], plane)
        return Floor(scene, plane, film, foot, x_axis, np.cross(x_axis, plane.normal))
    towards = own.normal - (own.normal @ plane.normal) * plane.normal
    if float(np.linalg.norm(towards)) < PARALLEL:
        edge = emitters.straight_edge(scene.light)
        s_axis = _in_plane(np.eye(3)[np.argmin(np.abs(plane.normal))] if edge is None else edge, plane)
        return Floor(scene, plane, film, foot, np.cross(plane.normal, s_axis), s_axis)
    x_axis = _in_plane(towards, plane)
    origin = foot - x_axis * (own.normal @ (foot - lowest)) / (own.normal @ x_axis)
    return Floor(scene, plane, film, origin, x_axis, np.cross(x_axis, plane.normal))


def front_plane(scene: ClosedFormScene, film: FilmPlane) -> Array | None:
    """The half-space (3,) of the film that shows points of the plane before a flat light; None for others."""
    own = emitters.own_plane(scene.light)
    if scene.plane is None or own is None:
        return None
    height, side = scene.plane.height(film.eye), own.normal @ (film.eye - own.point)
    return film.to_world.T @ (height * own.normal - side * scene.plane.normal)


def _in_plane(v: Array, plane: Plane) -> Array:
    v = v - (v @ plane.normal) * plane.normal
    return v / np.linalg.norm(v)
