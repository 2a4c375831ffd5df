"""What an `AreaLightSource` makes of each shape: its radiance, a power spread over it, an image laid on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenes.builder import AreaLight
from scenes.description import BilinearMesh, Disk, Emission, Geometry, Sphere, TriangleMesh
from scenes.errors import Location, Report
from scenes.lights import RADIANCE_LIMIT
from scenes.spectra import LUMINANCE

Array = NDArray[np.float64]

PARTS = 256  # of one mesh by the areas of its faces
SAME_AREA = 1e-9  # relative
RIGHT_ANGLE = 1e-5  # cosine up to which a patch counts as a rectangle, and relative error of its fourth corner


def lit(geometry: Geometry, light: AreaLight, where: Location, report: Report) -> list[tuple[Geometry, Emission]]:
    """The shape with its emission, in parts where its faces differ in radiance; what is not supported is reported.

    In pbrt each triangle and each patch is a light of its own, so that a `power` is that of each of them.
    """
    if light.emission.image is not None and not _takes_image(geometry):
        report.add("an image on an area light is supported on rectangles only: a bilinearmesh with its own uv", where)
        return []
    if light.power is None:
        return [(geometry, light.emission)]
    parts = _by_area(geometry)
    if len(parts) > PARTS:
        report.add(f"power over a mesh of more than {PARTS} different areas is not supported: give L", light.where)
        return []
    bright = 1.0 if light.emission.image is None else float((light.emission.image @ LUMINANCE).mean())
    sides = 2 if light.emission.two_sided else 1
    with np.errstate(all="ignore"):
        made = [
            (part, light.emission.radiance * (light.power / (bright * sides * np.pi * area))) for part, area in parts
        ]
    if not all(np.all(radiance <= RADIANCE_LIMIT) for _, radiance in made):
        report.add("power: the radiance is beyond 1e30, the largest that float32 images can average", light.where)
        return []
    return [(part, replace(light.emission, radiance=radiance)) for part, radiance in made]


def _by_area(geometry: Geometry) -> list[tuple[Geometry, float]]:
    """The geometry in parts whose faces have one area, with that area."""
    if isinstance(geometry, Sphere):
        return [(geometry, 4 * np.pi * geometry.radius**2)]
    if isinstance(geometry, Disk):
        return [(geometry, np.pi * geometry.radius**2)]
    areas = _areas(geometry)
    order = np.argsort(areas, kind="stable")
    steps = np.diff(areas[order]) > SAME_AREA * areas[order][1:]
    groups = np.split(order, np.flatnonzero(steps) + 1)
    if len(groups) == 1:
        return [(geometry, float(areas.mean()))]
    kind = type(geometry)
    return [
        (
            kind(geometry.vertices, geometry.faces[np.sort(group)], geometry.reverse, geometry.uv),
            float(areas[group].mean()),
        )
        for group in groups[: PARTS + 1]
    ]


def _areas(geometry: TriangleMesh | BilinearMesh) -> Array:
    corners = np.moveaxis(geometry.vertices[geometry.faces], 1, 0)
    if isinstance(geometry, TriangleMesh):
        twice = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    else:
        twice = np.cross(corners[3] - corners[0], corners[2] - corners[1])
    return np.linalg.norm(twice, axis=1) / 2


def _takes_image(geometry: Geometry) -> bool:
    """Whether these are rectangles on which the image lies by the patch's own parameters."""
    if not isinstance(geometry, BilinearMesh):
        return False
    if geometry.uv is not None and not np.array_equal(geometry.uv[geometry.faces], _own_uv(len(geometry.faces))):
        return False
    p00, p10, p01, p11 = np.moveaxis(geometry.vertices[geometry.faces], 1, 0)
    u, v = p10 - p00, p01 - p00
    lengths = np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)
    square = np.abs(np.sum(u * v, axis=1)) <= RIGHT_ANGLE * lengths[0] * lengths[1]
    closed = np.linalg.norm(p00 + u + v - p11, axis=1) <= RIGHT_ANGLE * (lengths[0] + lengths[1])
    return bool(np.all(square & closed))


def _own_uv(count: int) -> Array:
    return np.tile(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]), (count, 1, 1))
