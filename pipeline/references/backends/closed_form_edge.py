"""Reference images of a straight edge's penumbra in closed form: a flat light, a sheet with one edge before
it, a floor.

Every point's light is Lambert's formula for the part of the light that the edge leaves, and a pixel is its
integral. What is seen in a pixel is cut exactly: the sheet, the floor, and on the floor the lines where a
corner of the light comes into sight, at which the radiance has kinks. In each piece it is smooth, and Gauss's
rules converge fast.

`variance` of the image is the square of the error bound, `batches` and `spp` are 0: nothing was sampled.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.references.closed_form.edge_scene import EdgeScene, analyse_edge
from pipeline.references.closed_form.film import (
    FilmPlane,
    classify,
    clip_by_planes,
    film_plane,
    outside_planes,
)
from pipeline.references.closed_form.image import PixelImage, to_reference
from pipeline.references.closed_form.quadrature import Cells, Integrand, Totals, integrate, sums, trapezoids
from pipeline.references.closed_form.radiometry import (
    clip_polygon_by_plane,
    knife_edge_irradiance,
    polygon_irradiance,
)
from pipeline.references.closed_form.scene import Plane, Receiver
from pipeline.references.protocol import (
    BACKENDS,
    Continuation,
    Progress,
    Quantity,
    ReferenceImage,
    ReferenceRequest,
    require,
)
from pipeline.store.keys import imported_code
from scenes.description.scene import SceneDescription
from scenes.errors import SceneError

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Pieces = list[tuple[Array, Index]]

TOLERANCE = 1e-7  # error bound wanted for a pixel, relative to its value or to a hundredth of the mean


class EdgeBackend:
    """A straight edge before a flat light: the penumbra by formula and quadrature."""

    name = "closed-form-edge"

    def version(self) -> str:
        """A hash of the sources that make the image."""
        return imported_code(Path(__file__))

    def refuses(self, scene: SceneDescription, quantity: Quantity = "radiance") -> str | None:
        """What keeps the scene from being an edge over a floor, in one sentence."""
        if quantity != "radiance":
            return f"there is no closed form of {quantity} here"
        try:
            analyse_edge(scene)
        except SceneError as error:
            return str(error)
        return None

    def render(
        self,
        scene: SceneDescription,
        request: ReferenceRequest,
        progress: Progress | None = None,
        continuation: Continuation | None = None,
    ) -> ReferenceImage:
        """The image; of `request` only the quantity has a bearing. PenumbraError if the scene is refused."""
        require(self, scene, request.quantity)
        start = time.perf_counter()
        film = film_plane(scene.camera, scene.film)
        image = edge_image(analyse_edge(scene), film)
        if progress:
            progress(1.0)
        provenance = {"backend": self.name, "version": self.version(), "tolerance": f"{TOLERANCE:g}"}
        return to_reference(image, scene.film, provenance, start)


def edge_image(scene: EdgeScene, film: FilmPlane) -> PixelImage:
    """Radiance averaged over each pixel, with the bound of its error."""
    sheet = film.planes(scene.sheet.patch.outline)
    on_sheet = _in_view(film, sheet)
    on_floor = _not_behind(film, sheet, _in_view(film, film.planes(scene.floor.patch.outline)))
    for plane in _kinks(scene, film):
        on_floor = _cut(on_floor, plane)
    mean, bound, cells = np.zeros((film.pixels, 3)), np.zeros((film.pixels, 3)), 0
    surfaces = ((on_sheet, scene.sheet, scene.sheet_plane), (on_floor, scene.floor, scene.floor_plane))
    for pieces, receiver, plane in surfaces:
        totals = _light(scene, film, pieces, plane)
        factor = receiver.reflectance * scene.radiance / (np.pi * film.pixel_area)
        mean += np.multiply.outer(totals.value, factor)
        bound += np.multiply.outer(totals.bound, factor)
        cells += totals.cells
    return PixelImage(mean, bound, cells)


def irradiance(scene: EdgeScene, plane: Plane, points: Array) -> Array:
    """Irradiance (n,) per unit radiance at points (n, 3) of the floor or of the sheet."""
    if plane is scene.sheet_plane:
        return polygon_irradiance(points, plane.normal, scene.light.outline)
    return knife_edge_irradiance(points, plane.normal, scene.light.outline, scene.edge, scene.blocked)


def unshadowed(scene: EdgeScene, points: Array) -> Array:
    """Irradiance (n,) per unit radiance at points (n, 3) of the floor if there were no sheet."""
    return polygon_irradiance(points, scene.floor_plane.normal, scene.light.outline)


def floor_points(scene: EdgeScene, film: FilmPlane) -> tuple[Index, Array]:
    """The pixels (m,) that lie wholly on the floor, and where their middles see it, (m, 3)."""
    floor, _ = classify(film, film.planes(scene.floor.patch.outline))
    sheet, mixed = classify(film, film.planes(scene.sheet.patch.outline))
    floor[mixed] = False
    pixels = np.flatnonzero(floor & ~sheet)
    return pixels, _project(film, scene.floor_plane, film.centers()[pixels])


def seen_radiance(scene: EdgeScene, film: FilmPlane, points: Array) -> Array:
    """Exact radiance (n, 3) seen at film points (n, 3)."""
    total, free = np.zeros_like(points), np.ones(len(points), dtype=np.bool_)
    surfaces: tuple[tuple[Receiver, Plane], ...] = (
        (scene.sheet, scene.sheet_plane),
        (scene.floor, scene.floor_plane),
    )
    for receiver, plane in surfaces:
        seen = np.flatnonzero(free & np.all(points @ film.planes(receiver.patch.outline).T > 0, axis=1))
        e = irradiance(scene, plane, _project(film, plane, points[seen]))
        total[seen] = e[:, None] * (receiver.reflectance * scene.radiance / np.pi)
        free[seen] = False
    return total


def _project(film: FilmPlane, plane: Plane, points: Array) -> Array:
    """Where a plane is seen at film points (n, 3): world points (n, 3)."""
    d = points @ film.to_world.T
    t = -float(plane.height(film.eye)) / (d @ plane.normal)
    return film.eye + t[:, None] * d


def _in_view(film: FilmPlane, planes: Array) -> Pieces:
    """The pixels cut by a convex outline's planes."""
    whole, mixed = classify(film, planes)
    inside = np.flatnonzero(whole)
    cut = clip_by_planes(film.squares(mixed), np.broadcast_to(planes, (mixed.size, *planes.shape)))
    return [(film.squares(inside), inside), (cut, mixed)]


def _not_behind(film: FilmPlane, planes: Array, pieces: Pieces) -> Pieces:
    """The pieces without what lies inside all planes (m, 3)."""
    covered, mixed = classify(film, planes)
    cut = np.zeros(film.pixels, dtype=np.bool_)
    cut[mixed] = True
    rest: Pieces = []
    for polygons, pixel in pieces:
        clear, some = ~covered[pixel] & ~cut[pixel], np.flatnonzero(cut[pixel])
        rest.append((polygons[clear], pixel[clear]))
        rest += outside_planes(
            polygons[some], pixel[some], np.broadcast_to(planes, (some.size, *planes.shape))
        )
    return rest


def _kinks(scene: EdgeScene, film: FilmPlane) -> Array:
    """Film planes (v, 3) of the floor's lines from which a corner of the light is seen right at the edge.

    Such a plane, through edge and corner, meets the floor at p = eye - height d / (d . n); m . (p - edge) = 0
    is linear in d.
    """
    start, end = scene.edge
    m = np.cross(end - start, scene.light.outline - start)
    m = m / np.linalg.norm(m, axis=1, keepdims=True)
    height, n = float(scene.floor_plane.height(film.eye)), scene.floor_plane.normal
    return np.asarray((np.multiply.outer(m @ (film.eye - start), n) - height * m) @ film.to_world)


def _cut(pieces: Pieces, plane: Array) -> Pieces:
    """The pieces cut in two along a plane (3,)."""
    parts: Pieces = []
    for polygons, pixel in pieces:
        side = polygons @ plane
        mixed = (side.min(axis=1, initial=0) < 0) & (side.max(axis=1, initial=0) > 0)
        parts.append((polygons[~mixed], pixel[~mixed]))
        for way in (plane, -plane):
            clipped, count = clip_polygon_by_plane(polygons[mixed], way)
            parts.append((clipped[count > 2], pixel[mixed][count > 2]))
    return parts


def _light(scene: EdgeScene, film: FilmPlane, pieces: Pieces, plane: Plane) -> Totals:
    """Integrals over the film of the irradiance per unit radiance, (pixels,)."""
    parts = [trapezoids(polygons[..., :2], pixel) for polygons, pixel in pieces if pixel.size]
    shape = np.concatenate([np.zeros((6, 0)), *(part.shape for part in parts)], axis=1)
    cells = Cells(shape, np.concatenate([np.zeros(0, dtype=np.int64), *(part.owner for part in parts)]))

    def value(x: Array, y: Array) -> Array:
        points = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
        return irradiance(scene, plane, _project(film, plane, points)).reshape(x.shape)

    middle = np.array([0.5])
    rough = sums(cells.owner, value(*cells.at(middle, middle))[:, 0] * cells.area, film.pixels)
    lit = rough[rough > 0]
    scale = np.maximum(rough, 0.01 * lit.mean() if lit.size else 1.0)
    everywhere = Integrand(
        value,
        lambda part: np.full(part.owner.size, np.pi),
        lambda part: (
            np.zeros(part.owner.size),
            np.zeros(part.owner.size),
        ),  # the light is far: `analyse_edge`
    )
    return integrate(cells, everywhere, scale, TOLERANCE)


BACKENDS.add("closed-form-edge", EdgeBackend())
