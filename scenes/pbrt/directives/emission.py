"""What an `AreaLightSource` makes of each shape: its radiance, a power spread over it, an image laid on
it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.shapes import BilinearMesh, Disk, Emission, Geometry, Sphere, TriangleMesh
from scenes.errors import Location, Report
from scenes.pbrt.directives.emission_images import pictured
from scenes.pbrt.directives.lights import RADIANCE_LIMIT
from scenes.pbrt.spectra import LUMINANCE
from scenes.pbrt.state import AreaLight

Array = NDArray[np.float64]

PARTS = 256  # of one mesh by the areas of its faces
SAME_AREA = 1e-9  # relative


def lit(
    geometry: Geometry, light: AreaLight, where: Location, report: Report
) -> list[tuple[Geometry, Emission]]:
    """The shape with its emission, in parts where its faces differ in radiance; what is not supported is
    reported.

    In pbrt each triangle and each patch is a light of its own, so that a `power` is that of each of them.
    """
    power = light.power
    if light.emission.image is not None:
        rectangles = pictured(geometry)
        if rectangles is None:
            report.add(
                (
                    "an image on an area light is supported on rectangles only: patches, or pairs of triangles "  # noqa: E501
                    "with uv, each with the whole image"
                ),
                where,
            )
            return []
        if power is not None and isinstance(geometry, TriangleMesh):
            power *= 2  # that of each half
        geometry = rectangles
    if power is None:
        return [(geometry, light.emission)]
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
