"""The image of a straight edge's penumbra: a flat light, a sheet with one edge before it, a floor.

Lambert's formula for the part of the light that the edge leaves gives the irradiance at every point; a pixel
is its integral. The surfaces in a pixel are cut exactly: the sheet, the floor, and on the floor the lines
where a corner of the light comes into sight, at which the radiance has kinks. Each piece is smooth, so that
Gauss's rules converge fast.
"""

from __future__ import annotations

import numpy as np

from pipeline.references.closed_form.edge_scene import EdgeScene
from pipeline.references.closed_form.film import (
    FilmPlane,
    Pieces,
    classify,
    in_view,
    not_behind,
    patch_silhouette,
)
from pipeline.references.closed_form.image import PixelImage
from pipeline.references.closed_form.patches import Plane
from pipeline.references.closed_form.quadrature import Cells, Integrand, Totals, integrate, sums, trapezoids
from pipeline.references.closed_form.radiometry import (
    clip_polygon_by_plane,
    knife_edge_irradiance,
    polygon_irradiance,
)
from scenes.arrays import Array, Index

TOLERANCE = 1e-7  # error bound wanted for a pixel, relative to its value or to a hundredth of the mean


def edge_image(scene: EdgeScene, film: FilmPlane) -> PixelImage:
    """Radiance averaged over each pixel, with the bound of its error."""
    sheet = scene.sheet.patch
    on_sheet = in_view(film, film.planes(sheet.outline))
    on_floor = in_view(film, film.planes(scene.floor.patch.outline))
    on_floor = not_behind(film, patch_silhouette(sheet, film), on_floor)
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
    """The pixels (m,) that show only the floor, and the points (m, 3) seen in their middles."""
    floor, _ = classify(film, film.planes(scene.floor.patch.outline))
    sheet, mixed = classify(film, film.planes(scene.sheet.patch.outline))
    floor[mixed] = False
    pixels = np.flatnonzero(floor & ~sheet)
    return pixels, project(film, scene.floor_plane, film.centers()[pixels])


def project(film: FilmPlane, plane: Plane, points: Array) -> Array:
    """World points (n, 3) of a plane that film points (n, 3) show."""
    d = points @ film.to_world.T
    t = -float(plane.height(film.eye)) / (d @ plane.normal)
    return film.eye + t[:, None] * d


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
    """Cut every piece in two along a plane (3,)."""
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
    cells = Cells.joined(*(trapezoids(polygons[..., :2], pixel) for polygons, pixel in pieces if pixel.size))

    def value(x: Array, y: Array) -> Array:
        points = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
        return irradiance(scene, plane, project(film, plane, points)).reshape(x.shape)

    middle = np.array([0.5])
    rough = sums(cells.owner, value(*cells.at(middle, middle))[:, 0] * cells.area, film.pixels)
    # `analyse_edge` keeps the light far away: no cell is near a singularity.
    everywhere = Integrand(
        value,
        lambda part: np.full(part.owner.size, np.pi),
        lambda part: (np.zeros(part.owner.size), np.zeros(part.owner.size)),
    )
    return integrate(cells, everywhere, rough, TOLERANCE)
