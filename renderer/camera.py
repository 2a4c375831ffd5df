"""pbrt's cameras: left-handed space, pixel (0, 0) at the top left, a pinhole, a thin lens, parallel rays or
rays all around.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, singledispatch

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats, combine, normalize
from renderer.math.warp import concentric_disk
from renderer.pixel_filter import offsets
from renderer.spherical.octahedral import around_edges, square_to_sphere
from scenes.description.scene import Camera as CameraDescription
from scenes.description.scene import Film, OrthographicCamera, PerspectiveCamera, SphericalCamera


@dataclass(frozen=True, eq=False)
class Camera:
    """The film point (x, y), in pixels, lies at origin + p with p = corner + x du + y dv.

    origin, corner, du, dv: (3, 1). offsets: from u (2, n) to places (2, n) about a pixel, see `pixel_filter`.
    forward: (3, 1), along which parallel rays leave the film; None where rays go from the origin through it.
    lens: (3, 2), two radii of the lens, across and up; None without one. focus: how far the sharp plane is,
    in distances of the film from the pinhole, or in lengths of `forward`.
    """

    origin: Floats
    corner: Floats
    du: Floats
    dv: Floats
    width: int
    height: int
    offsets: Callable[[Floats], Floats]
    forward: Floats | None = None
    lens: Floats | None = None
    focus: float = 1.0

    @property
    def dimensions(self) -> int:
        """How many random numbers a ray takes: two on the film, two more on a lens."""
        return 2 if self.lens is None else 4

    def rays(self, pixel: NDArray[np.int64], u: Floats) -> tuple[Floats, Floats]:
        """Origins (3, n), or (3, 1) where all are the same, and unit directions (3, n), through points of
        pixels as the pixel filter has them.

        pixel: (n,) row-major indices. u: (dimensions, n) in [0, 1).
        """
        dx, dy = self.offsets(u[:2])
        x = pixel % self.width + dx
        y = pixel // self.width + dy
        if self.lens is None:
            return self.through(x, y)
        start = self.lens @ concentric_disk(u[2:])
        return self.origin + start, normalize(self._ahead(x, y, self.focus) - start)

    def through(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """As `rays`, through film points in pixels (n,) and without the lens."""
        p = self._film(x, y)
        if self.forward is None:
            return self.origin, normalize(p)
        return self.origin + p, normalize(np.repeat(self.forward, p.shape[1], axis=1))

    def screen(self, x: Floats, y: Floats, distance: float) -> Floats:
        """Where those rays meet the plane across the view at a distance, in units of `focus`: (3, n)."""
        return self.origin + self._ahead(x, y, distance)

    def _film(self, x: Floats, y: Floats) -> Floats:
        p = self.du * x
        p += self.dv * y
        p += self.corner
        return p

    def _ahead(self, x: Floats, y: Floats, distance: float) -> Floats:
        p = self._film(x, y)
        return p * distance if self.forward is None else p + self.forward * distance

    @cached_property
    def _edges(self) -> tuple[Floats, Floats]:
        """The corners of the film in pixels, x and y (4,) in turn about it, with the filter's reach."""
        low, high = self.offsets(np.zeros((2, 1)))[:, 0], self.offsets(np.ones((2, 1)))[:, 0]
        right, bottom = self.width - 1 + high[0], self.height - 1 + high[1]
        return np.array([low[0], right, right, low[0]]), np.array([low[1], low[1], bottom, bottom])

    @cached_property
    def eyes(self) -> Floats:
        """Points (3, m) whose convex hull holds the origins of all rays."""
        if self.lens is not None:
            return self.origin + self.lens @ np.array([[1.0, 1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0]])
        return self.origin if self.forward is None else self.origin + self._film(*self._edges)

    @cached_property
    def _sides(self) -> tuple[Floats, Floats]:
        """Planes about the view: inward normals n (5, m, 3) and limits c (5, m), so that what a ray from eye
        m meets has n . (p - origin) >= c; four sides, and the plane of the film or the lens.

        A volume of four points is affine in each, so that the corners of a lens speak for all of it.
        """
        ahead = np.cross(self.dv[:, 0], self.du[:, 0])
        parallel = self.forward is not None and self.lens is None
        at = self._ahead(*self._edges, 0.0 if parallel else self.focus).T  # (4, 3)
        eyes = (self.eyes - self.origin).T
        eyes = at if parallel else eyes
        after, middle = np.roll(at, -1, axis=0), at.mean(axis=0)
        if self.forward is not None and parallel:
            base = np.repeat(at[:, None], len(eyes), axis=1)
            normal = np.cross(after - at, self.forward[:, 0])[:, None].repeat(len(eyes), axis=1)
        else:
            base = np.repeat(eyes[None], 4, axis=0)
            normal = np.cross(at[:, None] - base, after[:, None] - base)
        inside = np.einsum("sek,sek->se", normal, middle - base) > 0
        normal = np.where(inside[..., None], normal, -normal)
        front = self._ahead(*self._edges, 1.0).mean(axis=1) - self._ahead(*self._edges, 0.0).mean(axis=1)
        ahead = ahead if ahead @ front > 0 else -ahead
        normal = np.concatenate([normal, np.broadcast_to(ahead, (1, len(eyes), 3))])
        base = np.concatenate([base, eyes[None]])
        return normal, np.einsum("sek,sek->se", normal, base)

    def sees(self, points: Floats) -> bool:
        """Whether a convex hull of points (3, m) may be in view, as `sees_each`."""
        return bool(self.sees_each(points[None])[0])

    def sees_each(self, points: Floats) -> NDArray[np.bool_]:
        """(s,) whether convex hulls of points (s, 3, m) may be in view: False only where one lies wholly
        outside one side of it.
        """
        normal, limit = self._sides
        out = np.ones(len(points), dtype=np.bool_)
        for eyes, least in zip(normal, limit, strict=True):  # (eyes, 3) and (eyes,) of each side
            height = eyes @ (points - self.origin)  # (s, eyes, m)
            out &= ~np.all(height < least[:, None], axis=(1, 2))
        return out


@dataclass(frozen=True, eq=False, kw_only=True)
class SphericalRays(Camera):
    """Rays from the origin all around. The film point is a place (u, v, 0) on a map of the sphere.

    axes: (3, 3, 1), [:, j] of camera space in the world. direction: from places (2, n) to unit vectors (3, n)
    about z, which camera space has in its y.
    """

    axes: Floats
    direction: Callable[[Floats], Floats]

    def through(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        return self.origin, normalize(self._ahead(x, y, 1.0))

    def _ahead(self, x: Floats, y: Floats, distance: float) -> Floats:
        right, ahead, up = self.direction(self._film(x, y)[:2])
        axes = self.axes
        return combine((axes[:, 0], axes[:, 1], axes[:, 2]), right, up, ahead) * distance

    @cached_property
    def eyes(self) -> Floats:
        return self.origin

    def sees_each(self, points: Floats) -> NDArray[np.bool_]:
        return np.ones(len(points), dtype=np.bool_)


@singledispatch
def make_camera(description: CameraDescription, film: Film) -> Camera:
    """The camera of a description; a perspective one has its film at distance 1."""
    raise TypeError(f"no rays of a {type(description).__name__}")


@make_camera.register
def _(description: PerspectiveCamera, film: Film) -> Camera:
    return _projective(description, film, description.camera_to_world[:3, 2:3], None)


@make_camera.register
def _(description: OrthographicCamera, film: Film) -> Camera:
    return _projective(description, film, np.zeros((3, 1)), description.camera_to_world[:3, 2:3])


@make_camera.register
def _(description: SphericalCamera, film: Film) -> Camera:
    left, top, dx, dy = description.film_plane(film)
    m = description.camera_to_world
    return SphericalRays(
        m[:3, 3:4].copy(),
        np.array([[left], [top], [0.0]]),
        np.array([[dx], [0.0], [0.0]]),
        np.array([[0.0], [-dy], [0.0]]),
        film.width,
        film.height,
        offsets(film.pixel_filter),
        axes=m[:3, :3, None].copy(),
        direction=_equal_area if description.mapping == "equalarea" else _equirectangular,
    )


def _equal_area(place: Floats) -> Floats:
    """Directions by the map of environments, which a filter may reach beyond."""
    return square_to_sphere(around_edges(place))


def _equirectangular(place: Floats) -> Floats:
    """Rows by the angle from z, columns by that from x towards y."""
    angle, polar = 2 * np.pi * place[0], np.pi * place[1]
    sine = np.sin(polar)
    return np.stack([sine * np.cos(angle), sine * np.sin(angle), np.cos(polar)])


def _projective(
    description: PerspectiveCamera | OrthographicCamera, film: Film, middle: Floats, forward: Floats | None
) -> Camera:
    """middle: (3, 1), from the origin to the film."""
    left, top, dx, dy = description.film_plane(film)
    m, lens = description.camera_to_world, description.lens
    right, up = m[:3, 0:1], m[:3, 1:2]
    return Camera(
        m[:3, 3:4].copy(),
        middle + right * left + up * top,
        right * dx,
        -up * dy,
        film.width,
        film.height,
        offsets(film.pixel_filter),
        forward,
        None if lens is None else m[:3, :2] * lens.radius,
        1.0 if lens is None else lens.distance,
    )
