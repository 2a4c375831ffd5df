"""A closed-form image put together: the light's share of each pixel, and the receivers' light over the rest.

Every array here is over pieces, (n, v, 3) film polygons with the pixel they lie in, or over `owners`:
receiver times pixels plus pixel, so that one quadrature serves receivers of any albedo.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.references.closed_form.emitters import own_plane
from pipeline.references.closed_form.film import (
    FilmPlane,
    Silhouette,
    areas,
    classify,
    clip_by_planes,
    inside_light,
    outside_planes,
    silhouette,
)
from pipeline.references.closed_form.floor import Floor, front_plane, make_floor
from pipeline.references.closed_form.quadrature import Cells, Integrand, Totals, integrate, sums, trapezoids
from pipeline.references.closed_form.radiometry import clip_polygon_by_plane
from pipeline.references.closed_form.scene import ClosedFormScene
from pipeline.references.protocol import ReferenceImage
from scenes.description.scene import Film

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Pieces = list[tuple[Array, Index]]

_ARC_RULES = tuple(np.polynomial.legendre.leggauss(order) for order in (5, 3))


@dataclass(frozen=True, eq=False)
class PixelImage:
    """mean, bound: (h w, 3), radiance averaged over each pixel and the bound of its error.

    cells: how many the quadrature evaluated.
    """

    mean: Array
    bound: Array
    cells: int


def to_reference(image: PixelImage, film: Film, provenance: dict[str, str], start: float) -> ReferenceImage:
    """The reference that an image makes: no samples, the bound's square as variance.

    start: by time.perf_counter().
    """
    shape = (film.height, film.width, 3)
    known = {
        "variance": "square of the quadrature's error bound",
        "largest_bound": f"{image.bound.max():.3g}",
        "cells": str(image.cells),
    }
    seconds = time.perf_counter() - start
    return ReferenceImage(
        image.mean.reshape(shape), image.bound.reshape(shape) ** 2, 0, 0, seconds, provenance | known
    )


def closed_form_image(scene: ClosedFormScene, film: FilmPlane, tolerance: float) -> PixelImage:
    """Average radiance over every pixel, to `tolerance` relative to the greater of its value and a hundredth
    of the receivers' mean.
    """
    outline, floor = silhouette(scene, film), make_floor(scene, film)
    arc_area, arc_light, arc_error = _segments(scene, film, floor, outline)
    share = (outline.covered * film.pixel_area + _cut_area(film, outline) + arc_area) / film.pixel_area
    mean = np.multiply.outer(share, emitted(scene)) - arc_light / film.pixel_area
    bound, cells = arc_error / film.pixel_area, 0
    if floor is not None:
        totals = _floor_light(scene, film, floor, outline, tolerance)
        mean = mean + _reflected(scene, totals.value) / film.pixel_area
        bound, cells = bound + _reflected(scene, totals.bound) / film.pixel_area, totals.cells
    return PixelImage(mean, bound, cells)


def radiance_at(scene: ClosedFormScene, film: FilmPlane, points: Array) -> Array:
    """Exact radiance (n, 3) seen at film points (n, 3)."""
    light = inside_light(scene, film, points)
    floor = make_floor(scene, film)
    return np.where(light[:, None], emitted(scene), _floor_radiance(scene, film, floor, points))


def emitted(scene: ClosedFormScene) -> Array:
    """Radiance (3,) of the light towards the camera: 0 from behind a light of one side."""
    own = own_plane(scene.light)
    seen = own is None or scene.two_sided or own.height(scene.eye) > 0
    return scene.radiance if seen else np.zeros(3)


def _reflected(scene: ClosedFormScene, irradiance: Array) -> Array:
    """Radiance (pixels, 3) reflected in all, from irradiance (owners,) per unit radiance."""
    albedo = np.stack([receiver.reflectance for receiver in scene.receivers])
    return irradiance.reshape(len(scene.receivers), -1).T @ albedo * scene.radiance / np.pi


def _cut_area(film: FilmPlane, outline: Silhouette) -> Array:
    """Area (pixels,) of the light's polygon in the pixels that it covers in part."""
    inside = areas(clip_by_planes(film.squares(outline.mixed), outline.planes))
    return sums(outline.mixed, inside, film.pixels)


def _floor_light(
    scene: ClosedFormScene, film: FilmPlane, floor: Floor, outline: Silhouette, tolerance: float
) -> Totals:
    """Integrals over the film of the irradiance per unit radiance, (owners,)."""
    pieces: Pieces = []
    for number, receiver in enumerate(scene.receivers):
        seen = _in_view(film, film.planes(receiver.patch.outline))
        for polygons, pixel in _lit(scene, film, _not_behind(film, outline, seen)):
            pieces.append((floor.coordinates(polygons), pixel + number * film.pixels))
    cells = _all_cells([trapezoids(*piece) for piece in pieces if piece[1].size])
    rough = sums(cells.owner, floor.roughly(cells), len(scene.receivers) * film.pixels)
    lit = rough[rough > 0]
    scale = np.maximum(rough, 0.01 * lit.mean() if lit.size else 1.0)
    return integrate(cells, Integrand(floor.value, floor.most, floor.resolved), scale, tolerance)


def _all_cells(parts: list[Cells]) -> Cells:
    shape = [np.zeros((6, 0)), *(part.shape for part in parts)]
    owner = [np.zeros(0, dtype=np.int64), *(part.owner for part in parts)]
    return Cells(np.concatenate(shape, axis=1), np.concatenate(owner))


def _in_view(film: FilmPlane, planes: Array) -> Pieces:
    """The pixels cut by a convex outline's planes."""
    whole, mixed = classify(film, planes)
    inside = np.flatnonzero(whole)
    cut = clip_by_planes(film.squares(mixed), np.broadcast_to(planes, (mixed.size, *planes.shape)))
    left = np.flatnonzero(areas(cut) > 0)  # what is empty has corners that are nowhere on the plane
    return [(film.squares(inside), inside), (cut[left], mixed[left])]


def _not_behind(film: FilmPlane, outline: Silhouette, pieces: Pieces) -> Pieces:
    """The pieces without what the light covers."""
    place = np.full(film.pixels, -1)
    place[outline.mixed] = np.arange(outline.mixed.size)
    rest: Pieces = []
    for polygons, pixel in pieces:
        clear, mixed = ~outline.covered[pixel] & (place[pixel] < 0), np.flatnonzero(place[pixel] >= 0)
        rest.append((polygons[clear], pixel[clear]))
        rest += outside_planes(polygons[mixed], pixel[mixed], outline.planes[place[pixel[mixed]]])
    return rest


def _lit(scene: ClosedFormScene, film: FilmPlane, pieces: Pieces) -> Pieces:
    """The parts before the light, and apart from them those behind a two-sided one: a kink lies between."""
    plane = front_plane(scene, film)
    if plane is None:
        return pieces
    lit: Pieces = []
    for m in (plane, -plane) if scene.two_sided else (plane,):
        for polygons, pixel in pieces:
            side = polygons @ m
            whole = np.flatnonzero(side.min(axis=1) >= 0)
            cut = np.flatnonzero((side.min(axis=1) < 0) & (side.max(axis=1) > 0))
            clipped, count = clip_polygon_by_plane(polygons[cut], m)
            lit += [(polygons[whole], pixel[whole]), (clipped[count > 2], pixel[cut[count > 2]])]
    return lit


def _floor_radiance(scene: ClosedFormScene, film: FilmPlane, floor: Floor | None, points: Array) -> Array:
    """Radiance (n, 3) of the receivers alone at film points (n, 3)."""
    total = np.zeros_like(points)
    if floor is None:
        return total
    for receiver in scene.receivers:
        seen = np.flatnonzero(np.all(points @ film.planes(receiver.patch.outline).T > 0, axis=1))
        irradiance = floor.irradiance(floor.project(points[seen]))
        total[seen] = irradiance[:, None] * (receiver.reflectance * scene.radiance / np.pi)
    return total


def _segments(
    scene: ClosedFormScene, film: FilmPlane, floor: Floor | None, outline: Silhouette
) -> tuple[Array, Array, Array]:
    """Area (pixels,) between chord and arc of an elliptic outline, the receivers' radiance there, its error.

    The latter two are (pixels, 3). The light is seen there, but the receivers' cut pieces cover it.
    """
    arcs = outline.arcs
    fine, coarse = (_over_segments(scene, film, floor, outline, rule) for rule in _ARC_RULES)
    columns = [sums(arcs.pixel, column, film.pixels) for column in fine.T]
    errors = [sums(arcs.pixel, column, film.pixels) for column in np.abs(fine - coarse).T]
    return (
        columns[0],
        np.stack(columns[1:], axis=1),
        np.stack(errors[1:], axis=1) + np.multiply.outer(errors[0], emitted(scene)),
    )


def _over_segments(
    scene: ClosedFormScene,
    film: FilmPlane,
    floor: Floor | None,
    outline: Silhouette,
    rule: tuple[Array, Array],
) -> Array:
    """Area and receivers' radiance (n, 4) over each segment: chord + u (arc - chord), Gauss in both."""
    nodes, weights = (rule[0] + 1) / 2, rule[1] / 2
    arcs = outline.arcs
    share, u = (grid.ravel() for grid in np.meshgrid(nodes, nodes, indexing="ij"))
    step = np.diff(arcs.t, axis=1)
    ends = arcs.points(film, arcs.t)[:, :, None]
    chord, along = ends[:, 0] + (ends[:, 1] - ends[:, 0]) * share[:, None], (ends[:, 1] - ends[:, 0])
    t = arcs.t[:, :1] + step * share
    arc, velocity = arcs.points(film, t), arcs.velocity(film, t)
    sag = arc - chord
    tangent = along + u[:, None] * (velocity * step[..., None] - along)
    jacobian = np.abs(tangent[..., 0] * sag[..., 1] - tangent[..., 1] * sag[..., 0])
    points = (chord + u[:, None] * sag).reshape(-1, 3)
    radiance = _floor_radiance(scene, film, floor, points).reshape(*jacobian.shape, 3)
    weighted = jacobian * np.outer(weights, weights).ravel()
    return np.concatenate(
        (weighted.sum(axis=1)[:, None], np.einsum("nk,nkc->nc", weighted, radiance)), axis=1
    )
