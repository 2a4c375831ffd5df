"""A closed-form image put together: the light's share of each pixel, and the receivers' light over the rest.

Every array here is over pieces, (n, v, 3) film polygons with the pixel they lie in, or over `owners`:
receiver times pixels plus pixel, so that one quadrature serves receivers of any albedo.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.references.closed_form.emitters import own_plane
from pipeline.references.closed_form.film import (
    FilmPlane,
    Pieces,
    Silhouette,
    areas,
    clip_by_planes,
    in_view,
    inside_light,
    not_behind,
    silhouette,
)
from pipeline.references.closed_form.floor import Floor, front_plane, make_floor
from pipeline.references.closed_form.quadrature import Cells, Integrand, Totals, integrate, sums, trapezoids
from pipeline.references.closed_form.radiometry import clip_polygon_by_plane
from pipeline.references.closed_form.scene import ClosedFormScene
from pipeline.references.protocol import (
    Progress,
    ReferenceBackend,
    ReferenceImage,
    ReferenceRequest,
    require,
)
from scenes.arrays import Array
from scenes.description.scene import SceneDescription

_ARC_RULES = tuple(np.polynomial.legendre.leggauss(order) for order in (5, 3))


@dataclass(frozen=True, eq=False)
class PixelImage:
    """Radiance averaged over each pixel, and the bound of its error: mean, bound (h w, 3).

    cells: the number that the quadrature evaluated.
    """

    mean: Array
    bound: Array
    cells: int


def render_reference(
    backend: ReferenceBackend,
    scene: SceneDescription,
    request: ReferenceRequest,
    progress: Progress | None,
    tolerance: float,
    draw: Callable[[], PixelImage],
) -> ReferenceImage:
    """Draw a closed-form image as a reference; its variance is the square of its error bound.

    PenumbraError if the backend refuses the scene.
    """
    require(backend, scene, request.quantity)
    start = time.perf_counter()
    image = draw()
    if progress:
        progress(1.0)
    shape = (scene.film.height, scene.film.width, 3)
    provenance = {
        "backend": backend.name,
        "version": backend.version(),
        "tolerance": f"{tolerance:g}",
        "variance": "square of the quadrature's error bound",
        "largest_bound": f"{image.bound.max():.3g}",
        "cells": str(image.cells),
    }
    seconds = time.perf_counter() - start
    return ReferenceImage(
        image.mean.reshape(shape), image.bound.reshape(shape) ** 2, 0, 0, seconds, provenance
    )


def closed_form_image(scene: ClosedFormScene, film: FilmPlane, tolerance: float) -> PixelImage:
    """Average the radiance over every pixel.

    tolerance: of the error, relative to the pixel's value or, if that is greater, a hundredth of their mean.
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
        seen = in_view(film, film.planes(receiver.patch.outline))
        for polygons, pixel in _lit(scene, film, not_behind(film, outline, seen)):
            pieces.append((floor.coordinates(polygons), pixel + number * film.pixels))
    cells = Cells.joined(*(trapezoids(*piece) for piece in pieces if piece[1].size))
    rough = sums(cells.owner, floor.roughly(cells), len(scene.receivers) * film.pixels)
    return integrate(cells, Integrand(floor.value, floor.most, floor.resolved), rough, tolerance)


def _lit(scene: ClosedFormScene, film: FilmPlane, pieces: Pieces) -> Pieces:
    """Cut the pieces into parts before and behind the light, between which there is a kink.

    Parts behind a light of one side are dropped: they are dark.
    """
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
    """The segments between chord and arc of an elliptic outline, where the light covers the receivers.

    Returns their area (pixels,), the receivers' radiance there (pixels, 3), and its error (pixels, 3).
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
