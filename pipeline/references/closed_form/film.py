"""The film of a closed-form image: the exact part of each pixel that the light covers.

Film points are homogeneous, (x, y, 1) in camera space (x right, y up, z forward, left-handed as pbrt's), so
that a plane through the camera is a half-space test m . (x, y, 1) > 0 and polygons are clipped without any
division.

The light's outline is a convex polygon on the film. A patch's is exact. A disk's or a sphere's is an ellipse:
it is cut where it crosses the pixel grid, each piece again in ARC_PIECES, into chords that lie in one pixel
each, and the thin segments between chord and arc are kept apart as `Arcs`, to be integrated as they are.
Within one pixel the polygon is the pixel cut by its own chords alone: a point of the pixel beyond none of
them but outside the polygon would be separated from the polygon's part of that (convex) pixel by another
chord inside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.references.closed_form.cone import Cone
from pipeline.references.closed_form.emitters import cone_of
from pipeline.references.closed_form.patches import Patch
from pipeline.references.closed_form.radiometry import clip_polygon_by_plane
from pipeline.references.closed_form.scene import ClosedFormScene
from scenes.arrays import Array, Index
from scenes.description.scene import Camera, Film

Pieces = list[tuple[Array, Index]]  # film polygons (n, v, 3) and the pixels (n,) that they lie in

ARC_PIECES = 4
MIN_ARCS = 64  # where the outline crosses no grid line at all
FLAT_CONE = 1e-12  # a disk seen edge-on more sharply than this covers nothing


@dataclass(frozen=True, eq=False)
class FilmPlane:
    """The plane z = 1 of camera space. eye: (3,), world. x: (w+1,), y: (h+1,): pixel edges.

    to_world: (3, 3), camera directions to world; to_camera: its inverse.
    """

    eye: Array
    to_world: Array
    to_camera: Array
    x: Array
    y: Array

    @property
    def pixel_area(self) -> float:
        """Area of one pixel on the film plane."""
        return float((self.x[1] - self.x[0]) * (self.y[0] - self.y[1]))

    @property
    def pixels(self) -> int:
        """The number of pixels."""
        return (self.x.size - 1) * (self.y.size - 1)

    def squares(self, pixel: Index) -> Array:
        """Corners (n, 4, 3) of pixels (n,), row-major from the top left, counter-clockwise in (x, y)."""
        row, column = np.divmod(pixel, self.x.size - 1)
        x, y = self.x[column[:, None] + np.array([0, 1, 1, 0])], self.y[row[:, None] + np.array([1, 1, 0, 0])]
        return np.stack((x, y, np.ones_like(x)), axis=2)

    def centers(self) -> Array:
        """Film points (h w, 3) of the pixels' centres."""
        return self.squares(np.arange(self.pixels)).mean(axis=1)

    def pixel_of(self, points: Array) -> Index:
        """Pixels (n,) of film points (n, 3); -1 outside the image."""
        column = np.floor((points[:, 0] - self.x[0]) / (self.x[1] - self.x[0]))
        row = np.floor((points[:, 1] - self.y[0]) / (self.y[1] - self.y[0]))
        width, height = self.x.size - 1, self.y.size - 1
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        return np.where(inside, row * width + column, -1).astype(np.int64)

    def planes(self, outline: Array) -> Array:
        """Planes (m, 3) through the eye and the edges of a convex outline (m, 3); inside is positive.

        The planes are in camera space, the outline in world space.
        """
        v = (outline - self.eye) @ self.to_camera.T
        m = np.cross(v, np.roll(v, -1, axis=0))
        inside = m @ v.mean(axis=0)
        return m * np.copysign(1.0, inside[np.argmax(np.abs(inside))])


def film_plane(camera: Camera, film: Film) -> FilmPlane:
    """The film plane at z = 1."""
    left, top, dx, dy = camera.pinhole("the closed form").film_plane(film)
    x: Array = left + dx * np.arange(film.width + 1, dtype=np.float64)
    y: Array = top - dy * np.arange(film.height + 1, dtype=np.float64)
    to_world = np.array(camera.camera_to_world[:3, :3])
    eye, to_camera = np.array(camera.camera_to_world[:3, 3]), np.linalg.inv(to_world).astype(np.float64)
    return FilmPlane(eye, to_world, to_camera, x, y)


@dataclass(frozen=True, eq=False)
class Arcs:
    """Arcs of the light's elliptic outline, each in one pixel.

    pixel: (n,). t: (n, 2), the ends as angles of `cone`, whose apex is the eye.
    """

    pixel: Index
    t: Array
    cone: Cone | None

    def points(self, film: FilmPlane, t: Array) -> Array:
        """Film points (..., 3) at angles t (...) of the outline."""
        if self.cone is None:
            return np.zeros((*t.shape, 3))
        v = (film.to_camera @ self.cone.direction(t.reshape(-1))).T
        return (v / v[:, 2:]).reshape(*t.shape, 3)

    def velocity(self, film: FilmPlane, t: Array) -> Array:
        """Derivative (..., 3) of `points` by t (...)."""
        if self.cone is None:
            return np.zeros((*t.shape, 3))
        v = (film.to_camera @ self.cone.direction(t.reshape(-1))).T
        dv = (film.to_camera @ self.cone.derivative(t.reshape(-1))).T
        return ((dv - v / v[:, 2:] * dv[:, 2:]) / v[:, 2:]).reshape(*t.shape, 3)


@dataclass(frozen=True, eq=False)
class Silhouette:
    """The light on the film.

    covered: (w h,), the pixels that it covers wholly. mixed: (n,), those that it may cover in part. planes:
    (n, k, 3), of a mixed pixel; the light is on the positive side of all. arcs: the rest of a round outline.
    """

    covered: NDArray[np.bool_]
    mixed: Index
    planes: Array
    arcs: Arcs


def silhouette(scene: ClosedFormScene, film: FilmPlane) -> Silhouette:
    """The pixels that the light covers, wholly or in part."""
    if isinstance(scene.light, Patch):
        return patch_silhouette(scene.light, film)
    arcs = _arcs(film, _cone(scene, film))
    if arcs.cone is None:
        return Silhouette(np.zeros(film.pixels, dtype=bool), arcs.pixel, np.zeros((0, 0, 3)), arcs)
    mixed, planes = _own_chords(film, arcs)
    covered = _inside_cone(film, arcs.cone, film.centers())
    covered[mixed] = False
    return Silhouette(covered, mixed, planes, arcs)


def patch_silhouette(patch: Patch, film: FilmPlane) -> Silhouette:
    """The pixels that a patch covers, and the planes through its edges."""
    planes = film.planes(patch.outline)
    covered, mixed = classify(film, planes)
    return Silhouette(covered, mixed, np.broadcast_to(planes, (mixed.size, *planes.shape)), _arcs(film, None))


def in_view(film: FilmPlane, planes: Array) -> Pieces:
    """The pixels cut by a convex outline's planes (m, 3)."""
    whole, mixed = classify(film, planes)
    inside = np.flatnonzero(whole)
    cut = clip_by_planes(film.squares(mixed), np.broadcast_to(planes, (mixed.size, *planes.shape)))
    left = np.flatnonzero(areas(cut) > 0)  # an empty polygon has corners that are nowhere on the plane
    return [(film.squares(inside), inside), (cut[left], mixed[left])]


def not_behind(film: FilmPlane, outline: Silhouette, pieces: Pieces) -> Pieces:
    """The pieces without the parts that lie inside the silhouette."""
    place = np.full(film.pixels, -1)
    place[outline.mixed] = np.arange(outline.mixed.size)
    rest: Pieces = []
    for polygons, pixel in pieces:
        clear, mixed = ~outline.covered[pixel] & (place[pixel] < 0), np.flatnonzero(place[pixel] >= 0)
        rest.append((polygons[clear], pixel[clear]))
        rest += outside_planes(polygons[mixed], pixel[mixed], outline.planes[place[pixel[mixed]]])
    return rest


def classify(film: FilmPlane, planes: Array) -> tuple[NDArray[np.bool_], Index]:
    """The pixels (w h,) wholly inside all `planes` (m, 3), and the indices of those that may be cut."""
    x, y = np.meshgrid(film.x, film.y)
    side = x[..., None] * planes[:, 0] + y[..., None] * planes[:, 1] + planes[:, 2]
    corners = np.stack((side[:-1, :-1], side[:-1, 1:], side[1:, :-1], side[1:, 1:]))
    inside = np.all(corners > 0, axis=(0, 3))
    outside = np.any(np.all(corners <= 0, axis=0), axis=2)
    return inside.ravel(), np.flatnonzero(~inside & ~outside)


def clip_by_planes(polygons: Array, planes: Array) -> Array:
    """Clip polygons (n, v, 3) to the inside of their planes (n, k, 3); empty ones have no area."""
    for k in range(planes.shape[1]):
        polygons = _cut(polygons, planes[:, k])[0]
    return polygons


def outside_planes(polygons: Array, owner: Index, planes: Array) -> Pieces:
    """Convex pieces of polygons (n, v, 3) outside at least one of their planes (n, k, 3), with their owners.

    The k-th piece is inside the planes before the k-th and outside of it, so that the pieces do not overlap.
    """
    pieces: Pieces = []
    for k in range(planes.shape[1]):
        beyond, count = _cut(polygons, -planes[:, k])
        pieces.append((beyond[count > 2], owner[count > 2]))
        polygons, count = _cut(polygons, planes[:, k])
        kept = count > 2
        polygons, owner, planes = polygons[kept], owner[kept], planes[kept]
    return pieces


def _cut(polygons: Array, plane: Array) -> tuple[Array, Index]:
    """Clip polygons (n, v, 3) by a plane each, and drop the vertices that none needs any more."""
    clipped, count = clip_polygon_by_plane(polygons, plane)
    return np.where((count > 0)[:, None, None], clipped, 0.0)[:, : max(3, int(count.max(initial=0)))], count


def areas(polygons: Array) -> Array:
    """Areas (n,) of film polygons (n, v, 3)."""
    p = polygons[..., :2] - polygons[:, :1, :2]
    return np.abs((p[:, 1:-1, 0] * p[:, 2:, 1] - p[:, 1:-1, 1] * p[:, 2:, 0]).sum(axis=1)) / 2


def _cone(scene: ClosedFormScene, film: FilmPlane) -> Cone | None:
    """The light's cone from the eye; None for a light without one, seen edge-on, or behind the camera."""
    cone = cone_of(scene.light, film.eye, film.to_camera[2])
    return cone if cone and cone.a[0] > FLAT_CONE * cone.c[0] else None


def _arcs(film: FilmPlane, cone: Cone | None) -> Arcs:
    if cone is None:
        return Arcs(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), None)
    cuts = np.concatenate((_crossings(film, cone), np.linspace(0, 2 * np.pi, MIN_ARCS, endpoint=False)))
    cuts = np.unique(np.mod(cuts, 2 * np.pi))
    cuts = np.append(cuts, cuts[0] + 2 * np.pi)
    t = cuts[:-1, None] + np.diff(cuts)[:, None] * np.arange(ARC_PIECES + 1) / ARC_PIECES
    t = np.stack((t[:, :-1], t[:, 1:]), axis=2).reshape(-1, 2)
    arcs = Arcs(np.zeros(0, dtype=np.int64), t, cone)
    pixel = film.pixel_of(arcs.points(film, t.mean(axis=1)))
    return Arcs(pixel[pixel >= 0], t[pixel >= 0], cone)


def _crossings(film: FilmPlane, cone: Cone) -> Array:
    """Angles at which the outline meets the lines of the pixel grid."""
    vertical = np.stack((np.ones_like(film.x), np.zeros_like(film.x), -film.x), axis=1)
    horizontal = np.stack((np.zeros_like(film.y), np.ones_like(film.y), -film.y), axis=1)
    m = np.concatenate((vertical, horizontal)) @ film.to_camera
    along = np.concatenate((cone.a * cone.e1, cone.b * cone.e2, cone.c * cone.e3), axis=1)
    p, q, k = (m @ along).T
    size = np.hypot(p, q)
    hit = np.abs(k) < size
    middle, half = np.arctan2(q[hit], p[hit]), np.arccos(-k[hit] / size[hit])
    return np.concatenate((middle - half, middle + half))


def _own_chords(film: FilmPlane, arcs: Arcs) -> tuple[Index, Array]:
    """The pixels that the outline crosses, (n,), and the planes (n, k, 3) of their own chords, padded."""
    v = arcs.points(film, arcs.t)
    m = np.cross(v[:, 0], v[:, 1])
    opposite = np.stack((arcs.t.mean(axis=1), arcs.t.mean(axis=1) + np.pi), axis=1)
    middle = arcs.points(film, opposite).mean(axis=1)
    m = m * np.copysign(1.0, (m * middle).sum(axis=1))[:, None]
    order = np.argsort(arcs.pixel, kind="stable")
    pixel, start, count = np.unique(arcs.pixel[order], return_index=True, return_counts=True)
    planes = np.tile(np.array([0.0, 0.0, 1.0]), (pixel.size, int(count.max(initial=0)), 1))
    rank = np.arange(order.size) - np.repeat(start, count)
    planes[np.repeat(np.arange(pixel.size), count), rank] = m[order]
    return pixel, planes


def inside_light(scene: ClosedFormScene, film: FilmPlane, points: Array) -> NDArray[np.bool_]:
    """Whether the light is seen at film points (n, 3), from either side."""
    if isinstance(scene.light, Patch):
        return np.all(points @ film.planes(scene.light.outline).T > 0, axis=1)
    cone = _cone(scene, film)
    return np.zeros(len(points), dtype=bool) if cone is None else _inside_cone(film, cone, points)


def _inside_cone(film: FilmPlane, cone: Cone, points: Array) -> NDArray[np.bool_]:
    """Whether film points (n, 3) lie inside the elliptic cone."""
    d = film.to_world @ points.T
    x, y, z = (axis[:, 0] @ d for axis in (cone.e1, cone.e2, cone.e3))
    return (z > 0) & ((x / cone.a) ** 2 + (y / cone.b) ** 2 < (z / cone.c) ** 2)
