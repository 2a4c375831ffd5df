"""Emission of a shape under an `AreaLightSource`: radiance, a power spread over the shape, an image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.shapes import (
    PATCH_UV,
    BilinearMesh,
    Emission,
    Geometry,
    Mesh,
    TriangleMesh,
    vertex_normals,
)
from scenes.errors import Location, Report
from scenes.pbrt.directives.lights import RADIANCE_LIMIT
from scenes.pbrt.spectra import LUMINANCE
from scenes.pbrt.state import AreaLight

Array = NDArray[np.float64]
Lit = list[tuple[Geometry, Emission]]

PARTS = 256  # of one mesh by the areas of its faces
SAME_AREA = 1e-9  # relative
SAME_POINT = 1e-6  # of a rectangle's diagonal: where two triangles share a corner


def apply_area_light(geometry: Geometry, light: AreaLight, where: Location, report: Report) -> Lit:
    """The shape with its emission, split where its faces differ in radiance. Reports what is not supported.

    In pbrt each triangle and each patch is a light of its own, so that each of them emits the whole `power`.
    """
    power = light.power
    if light.emission.image is not None:
        rectangles = image_rectangles(geometry)
        if rectangles is None:
            report.add(
                "an image on an area light is supported on rectangles only: patches, or pairs of triangles "
                "with uv, each with the whole image",
                where,
            )
            return []
        if power is not None:
            power *= len(geometry.areas()) // len(rectangles.faces)  # each half of a rectangle has its own
        geometry = rectangles
    if power is None:
        return [(geometry, light.emission)]
    return _spread(geometry, light, power, report)


def _spread(geometry: Geometry, light: AreaLight, power: float, report: Report) -> Lit:
    """The shape in parts of one radiance, of which each face emits `power`, in W."""
    parts = _by_area(geometry)
    if len(parts) > PARTS:
        report.add(
            f"power over a mesh of more than {PARTS} different areas is not supported: give L", light.where
        )
        return []
    bright = 1.0 if light.emission.image is None else float((light.emission.image @ LUMINANCE).mean())
    sides = 2 if light.emission.two_sided else 1
    with np.errstate(all="ignore"):
        made = [
            (part, light.emission.radiance * (power / (bright * sides * np.pi * area)))
            for part, area in parts
        ]
    if not all(np.all(radiance <= RADIANCE_LIMIT) for _, radiance in made):
        report.add(
            "power: the radiance is beyond 1e30, the largest that float32 images can average", light.where
        )
        return []
    return [(part, replace(light.emission, radiance=radiance)) for part, radiance in made]


def _by_area(geometry: Geometry) -> list[tuple[Geometry, float]]:
    """The geometry in parts whose faces share one area, each with that area."""
    areas = geometry.areas()
    order = np.argsort(areas, kind="stable")
    steps = np.diff(areas[order]) > SAME_AREA * areas[order][1:]
    groups = np.split(order, np.flatnonzero(steps) + 1)
    if len(groups) == 1 or not isinstance(geometry, Mesh):
        return [(geometry, float(areas.mean()))]
    return [
        (replace(geometry, faces=geometry.faces[np.sort(group)]), float(areas[group].mean()))
        for group in groups[: PARTS + 1]
    ]


def image_rectangles(geometry: Geometry) -> BilinearMesh | None:
    """The same surface as rectangles whose own parameters are the image's coordinates; None where it is none.

    Each must show the whole image once: its corners have the coordinates 0 and 1, in whatever order. Of a
    triangle mesh, faces 0 and 1 are a rectangle, 2 and 3 the next. The side that emits stays.
    """
    if vertex_normals(geometry) is not None:
        return None
    if isinstance(geometry, BilinearMesh):
        uv, points = geometry.corner_uv(), geometry.vertices[geometry.faces]
    elif isinstance(geometry, TriangleMesh) and geometry.uv is not None and len(geometry.faces) % 2 == 0:
        pairs = geometry.faces.reshape(-1, 6)
        uv, points = geometry.uv[pairs], geometry.vertices[pairs]
        agree = np.sum(_normals(points[:, :3]) * _normals(points[:, 3:]), axis=1) > 0
        if not (_are_halves(uv) and np.all(agree)):
            return None
    else:
        return None
    normal, corners = _normals(points), _at_image_corners(points, uv)
    if corners is None:
        return None
    faces = np.arange(4 * len(corners), dtype=np.int64).reshape(-1, 4)
    made = BilinearMesh(corners.reshape(-1, 3), faces)
    if not made.are_rectangles():
        return None
    if isinstance(geometry, BilinearMesh) and np.array_equal(corners, points):
        return geometry.untextured()
    against = np.sum(_normals(corners) * normal, axis=1) < 0
    if np.any(against != against[0]):
        return None
    return replace(made, reverse=geometry.reverse != bool(against[0]))


def _normals(points: Array) -> Array:
    """Normals (q, 3), of any length, by the first three of points (q, k, 3)."""
    return np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])


def _are_halves(uv: Array) -> bool:
    """Whether the two triangles of each pair, uv (q, 6, 2), are the halves of the image on both sides of a
    diagonal.
    """
    here = _is_image_corner(uv)
    first, second = here[:, :3].any(axis=1), here[:, 3:].any(axis=1)  # (q, 4): which corners each has
    three = (first.sum(axis=1) == 3) & (second.sum(axis=1) == 3)
    # Each lacks one corner; those two lie across from each other: in a patch's order 0 and 3, or 1 and 2.
    return bool(np.all(three) and np.all(np.argmin(first, axis=1) + np.argmin(second, axis=1) == 3))


def _is_image_corner(uv: Array) -> NDArray[np.bool_]:
    """(q, k, 4): whether coordinates (q, k, 2) are those of the image's four corners, in a patch's order."""
    return np.all(uv[:, :, None, :] == PATCH_UV, axis=-1)


def _at_image_corners(points: Array, uv: Array) -> Array | None:
    """The points (q, 4, 3) at the image's corners, of points (q, k, 3) with uv (q, k, 2); None if a corner
    has no point or several.
    """
    here = _is_image_corner(uv)
    if not (np.all(here.any(axis=2)) and np.all(here.any(axis=1))):
        return None
    found = np.take_along_axis(points, np.argmax(here, axis=1)[:, :, None], axis=1)
    expected = np.take_along_axis(found, np.argmax(here, axis=2)[:, :, None], axis=1)
    size = np.linalg.norm(found[:, 3] - found[:, 0], axis=1)
    return found if np.all(np.linalg.norm(expected - points, axis=2) <= SAME_POINT * size[:, None]) else None
