"""pbrt's cameras: perspective, with a thin lens, orthographic and spherical. Space is left-handed; pixel (0,
0) is at the top left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, singledispatch

import numpy as np

from renderer.math.vectors import Floats, combine, dot, normalize
from renderer.math.warp import concentric_disk
from renderer.pixel_filter import offsets
from renderer.spherical.octahedral import around_edges, square_to_sphere
from scenes.arrays import Index, Mask
from scenes.description.scene import Camera as CameraDescription
from scenes.description.scene import Film, OrthographicCamera, PerspectiveCamera, SphericalCamera


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera whose film point (x, y), in pixels, lies at origin + p, where p = corner + x du + y dv.

    origin, corner, du, dv: (3, 1). offsets: the pixel filter's map from u (2, n) to places (2, n) about a
    pixel. forward: (3, 1) the direction of parallel rays, None where all rays go through the origin. lens:
    (3, 2) two radii of the lens, across and up, None without a lens. focus: distance of the sharp plane, in
    distances of the film from the pinhole, or in lengths of `forward`.
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
        """The number of random numbers that a ray takes: two on the film, two more on a lens."""
        return 2 if self.lens is None else 4

    def rays(self, pixel: Index, u: Floats) -> tuple[Floats, Floats]:
        """Origins (3, n), or (3, 1) for a common one, and unit directions (3, n) of rays through pixels.

        pixel: (n,) row-major indices. u: (dimensions, n) in [0, 1); the pixel filter places the film point.
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
        """The points (3, n) where rays through film points (n,) meet the plane across the view at `distance`,
        in units of `focus`.
        """
        return self.origin + self._ahead(x, y, distance)

    def distance(self, p: Floats) -> Floats:
        """(n,) of points p (3, n) from where their rays start: pinhole, middle of the lens, or film."""
        away = p - self.origin
        if self.forward is None or self.lens is not None:
            return np.sqrt(dot(away, away))
        inward = np.linalg.inv(np.hstack([self.du, self.dv, self.forward]))[2]
        return np.abs(dot(inward[:, None], away - self.corner)) * float(np.linalg.norm(self.forward))

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
        """The film's corners in pixels, x and y (4,) in turn about it, widened by the filter's reach."""
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
        """Planes about the view: inward normals n (5, m, 3) and limits c (5, m). A ray from eye m only meets
        points p with n . (p - origin) >= c, for four sides and the plane of the film or the lens.

        A volume of four points is affine in each of them, so that the corners of a lens speak for all of it.
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
        """Whether a convex hull of points (3, m) may be in view; see `sees_each`."""
        return bool(self.sees_each(points[None])[0])

    def sees_each(self, points: Floats) -> Mask:
        """(s,) whether convex hulls of points (s, 3, m) may be in view. False is certain: the hull lies
        wholly outside one side of the view.
        """
        normal, limit = self._sides
        out = np.ones(len(points), dtype=np.bool_)
        for eyes, least in zip(normal, limit, strict=True):  # (eyes, 3) and (eyes,) of each side
            height = eyes @ (points - self.origin)  # (s, eyes, m)
            out &= ~np.all(height < least[:, None], axis=(1, 2))
        return out


@dataclass(frozen=True, eq=False, kw_only=True)
class SphericalRays(Camera):
    """Rays from one origin in all directions.

    A film point (u, v) is a place on a map of the sphere. axes: (3, 3, 1), column j is the j-th axis of
    camera space in the world. direction: the map from places (2, n) to unit vectors (3, n) about z, which is
    the y of camera space.
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

    def sees_each(self, points: Floats) -> Mask:
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
    """Directions by the equal-area map of environments, continued beyond its edges for wide filters."""
    return square_to_sphere(around_edges(place))


def _equirectangular(place: Floats) -> Floats:
    """Rows by the angle from z, columns by that from x towards y."""
    angle, polar = 2 * np.pi * place[0], np.pi * place[1]
    sine = np.sin(polar)
    return np.stack([sine * np.cos(angle), sine * np.sin(angle), np.cos(polar)])


def _projective(
    description: PerspectiveCamera | OrthographicCamera, film: Film, middle: Floats, forward: Floats | None
) -> Camera:
    """A camera with a flat film. middle: (3, 1), from the origin to the film's centre."""
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
