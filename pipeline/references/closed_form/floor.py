"""The receivers' plane as an integrand: exact irradiance, its measure on the film, and where it is singular.

Coordinates on the plane are (x, s): s along the line where the light's plane meets it, x away from that line,
which is where a light that nearly touches makes the irradiance vary fastest, and then in x alone. An area dA
there covers
|det M| H / z^3 dA of the film, M being the map from world directions to camera space, H the eye's height, z
the depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.references.closed_form.film import FilmPlane
from pipeline.references.closed_form.quadrature import Cells
from pipeline.references.closed_form.radiometry import disk_irradiance, polygon_irradiance, sphere_irradiance
from pipeline.references.closed_form.scene import ClosedFormScene, Patch, Plane, light_points
from scenes.description.lights import PointLight
from scenes.description.shapes import Disk, Sphere

Array = NDArray[np.float64]

# sine below which a light's plane counts as parallel to the receivers', an edge as parallel to an axis
PARALLEL = 1e-9
DEPTH_STEP = 2.0  # a cell's depths may differ by this many times its smallest
_SHARES = (grid.ravel() for grid in np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0]))
_U, _V = _SHARES


@dataclass(frozen=True, eq=False)
class Floor:
    """origin, x_axis, s_axis: (3,), world, orthonormal axes in the plane."""

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
        """Where the plane is seen at film points (..., 3): world points (..., 3)."""
        d = film_points @ self.film.to_world.T
        down = d @ self.plane.normal
        t = -self.height / np.where(down < 0, down, -np.inf)
        return self.film.eye + t[..., None] * d

    def coordinates(self, film_points: Array) -> Array:
        """(x, s) (..., 2) of what is seen at film points (..., 3)."""
        d = film_points @ self.film.to_world.T
        t = -self.height / (d @ self.plane.normal)
        to_eye = self.film.eye - self.origin
        return np.stack([to_eye @ axis + t * (d @ axis) for axis in (self.x_axis, self.s_axis)], axis=-1)

    def irradiance(self, points: Array) -> Array:
        """Irradiance (n,) per unit radiance, or intensity, at points (n, 3) of the plane, on the camera's
        side.
        """
        light, two_sided = self.scene.light, self.scene.two_sided
        if isinstance(light, PointLight):
            return self.plane.height(light.position) / np.linalg.norm(points - light.position, axis=-1) ** 3
        if isinstance(light, Patch):
            return polygon_irradiance(points, self.plane.normal, light.outline, two_sided=two_sided)
        if isinstance(light, Sphere):
            return sphere_irradiance(points, self.plane.normal, light.center, light.radius)
        return disk_irradiance(
            points, self.plane.normal, light.center, light.normal, light.radius, two_sided=two_sided
        )

    def value(self, x: Array, s: Array) -> Array:
        """Irradiance per unit radiance times film area per area of the plane, at (x, s) (...)."""
        points = self.origin + x.reshape(-1, 1) * self.x_axis + s.reshape(-1, 1) * self.s_axis
        return self.irradiance(points).reshape(x.shape) * self._density(self._depth(x, s))

    def most(self, cells: Cells) -> Array:
        """Upper bound (n,) of `value` in the cells: irradiance is at most pi, and under a point that at its
        foot.
        """
        light = self.scene.light
        highest = 1 / self.plane.height(light.position) ** 2 if isinstance(light, PointLight) else np.pi
        return highest * self._density(self._depth(*cells.at(_U, _V)).min(axis=1))

    def roughly(self, cells: Cells) -> Array:
        """About the integral (n,) of `value` over cells; under a point no more than over the whole plane, 2
        pi: its foot may be the middle.
        """
        middle = cells.at(np.array([0.5]), np.array([0.5]))
        rough = self.value(*middle)[:, 0] * cells.area
        if isinstance(self.scene.light, PointLight):
            return np.minimum(rough, 2 * np.pi * self._density(self._depth(*middle))[:, 0])
        return rough

    def resolved(self, cells: Cells) -> tuple[Array, Array]:
        """Each direction's extent over the distance to the nearest singularity across it: the light's
        boundary, or depth 0.

        The irradiance is analytic away from the boundary of the light, so that a cell no longer than its
        distance to it lies well inside the region of convergence. An edge parallel to an axis does no harm
        along that axis.
        """
        x, s = cells.at(_U, _V)
        points = self.origin + x[..., None] * self.x_axis + s[..., None] * self.s_axis
        near_x, near_s = (np.maximum(d.min(axis=1), 1e-300) for d in self._boundary(points))
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

    def _boundary(self, points: Array) -> tuple[Array, Array]:
        """Distances (...) of points (..., 3) to what is singular along x and along s."""
        light = self.scene.light
        if isinstance(light, Sphere | PointLight):
            d = np.linalg.norm(
                points - (light.center if isinstance(light, Sphere) else light.position), axis=-1
            )
            return d, d
        if isinstance(light, Disk):
            d = _rim_distance(points, light)
            return d, d
        edges = np.roll(light.outline, -1, axis=0) - light.outline
        d = _edge_distance(points, light.outline, edges)
        length = np.linalg.norm(edges, axis=1)
        across = [
            np.linalg.norm(np.cross(edges, axis), axis=1) > PARALLEL * length
            for axis in (self.x_axis, self.s_axis)
        ]
        return d[..., across[0]].min(axis=-1), d[..., across[1]].min(axis=-1)


def make_floor(scene: ClosedFormScene, film: FilmPlane) -> Floor | None:
    """The plane of the receivers with axes that suit the light; None if there is none, or the eye is in
    it.
    """
    plane = scene.plane
    if plane is None or plane.height(film.eye) <= 0:
        return None
    lowest = light_points(scene.light, -plane.normal)
    foot = lowest - plane.height(lowest) * plane.normal
    if isinstance(scene.light, Sphere | PointLight):
        x_axis = _in_plane(np.eye(3)[np.argmin(np.abs(plane.normal))], plane)
        return Floor(scene, plane, film, foot, x_axis, np.cross(x_axis, plane.normal))
    towards = scene.light.normal - (scene.light.normal @ plane.normal) * plane.normal
    if float(np.linalg.norm(towards)) < PARALLEL:
        edge = (
            scene.light.outline[1] - scene.light.outline[0]
            if isinstance(scene.light, Patch)
            else np.eye(3)[np.argmin(np.abs(plane.normal))]
        )
        s_axis = _in_plane(edge, plane)
        return Floor(scene, plane, film, foot, np.cross(plane.normal, s_axis), s_axis)
    x_axis = _in_plane(towards, plane)
    origin = foot - x_axis * (scene.light.normal @ (foot - lowest)) / (scene.light.normal @ x_axis)
    return Floor(scene, plane, film, origin, x_axis, np.cross(x_axis, plane.normal))


def front_plane(scene: ClosedFormScene, film: FilmPlane) -> Array | None:
    """The film's half-space (3,) in which the plane's points are seen that lie before the light; None:
    nothing separates them.
    """
    if scene.plane is None or isinstance(scene.light, Sphere | PointLight):
        return None
    light = scene.light
    point = light.outline[0] if isinstance(light, Patch) else light.center
    height, side = scene.plane.height(film.eye), light.normal @ (film.eye - point)
    return film.to_world.T @ (height * light.normal - side * scene.plane.normal)


def _in_plane(v: Array, plane: Plane) -> Array:
    v = v - (v @ plane.normal) * plane.normal
    return v / np.linalg.norm(v)


def _edge_distance(points: Array, start: Array, edge: Array) -> Array:
    """Distances (..., e) of points (..., 3) to segments (e, 3)."""
    v = points[..., None, :] - start
    t = np.clip((v * edge).sum(axis=-1) / (edge * edge).sum(axis=-1), 0.0, 1.0)
    return np.linalg.norm(v - t[..., None] * edge, axis=-1)


def _rim_distance(points: Array, disk: Disk) -> Array:
    v = points - disk.center
    height = v @ disk.normal
    return np.hypot(np.linalg.norm(v - height[..., None] * disk.normal, axis=-1) - disk.radius, height)
