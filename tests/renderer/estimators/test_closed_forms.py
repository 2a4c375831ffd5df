"""Estimates at exact points against closed forms: unoccluded floor points, and the penumbra of a knife edge.

The points carry no pixel and no camera: what is tested is light sampling, shading and, at the knife edge,
shadow rays. Each test asks for 4 standard errors at a relative standard error below 0.2 %: a bias of 0.8 %
fails at every point in half of all cases, one of 1.2 % in 97 of 100, and each light has several points.
"""

from __future__ import annotations

import numpy as np
import pytest

import scenes
from pipeline.references.closed_form.radiometry import (
    disk_irradiance,
    knife_edge_irradiance,
    polygon_irradiance,
    sphere_irradiance,
)
from renderer import build
from scenes.description.shapes import BilinearMesh, Disk, Sphere, TriangleMesh
from tests.kit.scenes import floor, light, patch, reflect, scene

REFLECTANCE, RADIANCE = 0.5, np.array([3.0, 2.0, 1.0])
UP = [0.0, 1.0, 0.0]
POINTS = np.array([[0.0, 0, 0], [0.7, 0, -0.4], [1.5, 0, 1.0], [-2.5, 0, 0.3]])
CORNER, EX, EY = [-0.6, 1.5, -0.3], [1.2, 0.0, 0.0], [0.0, 0.0, 0.8]
TILTED_X, TILTED_Y = [1.0, 0.5, 0.0], [0.0, 0.0, 1.2]
DISK = Disk(np.array([0.2, 1.2, 0.1]), np.array([0.6, -0.8, 0.0]), 0.7)
SPHERE = Sphere(np.array([0.3, 0.9, -0.2]), 0.5)
LOW_SPHERE = Sphere(np.array([0.3, 0.2, -0.2]), 0.5)  # half sunk: it crosses every horizon


def rectangle(corner, ex, ey) -> np.ndarray:
    c, x, y = (np.array(v) for v in (corner, ex, ey))
    return np.stack([c, c + x, c + x + y, c + y])


LIGHTS = {
    "rectangle": (
        patch(CORNER, EX, EY, RADIANCE),
        polygon_irradiance(POINTS, np.array(UP), rectangle(CORNER, EX, EY)),
    ),
    "tilted rectangle through the floor": (
        patch([-1.6, -0.2, -0.3], TILTED_Y, TILTED_X, RADIANCE, reverse=True),
        polygon_irradiance(POINTS, np.array(UP), rectangle([-1.6, -0.2, -0.3], TILTED_X, TILTED_Y)),
    ),
    "disk": (light(DISK), disk_irradiance(POINTS, np.array(UP), DISK.center, DISK.normal, DISK.radius)),
    "sphere": (light(SPHERE), sphere_irradiance(POINTS, np.array(UP), SPHERE.center, SPHERE.radius)),
    "sunken sphere": (
        light(LOW_SPHERE),
        sphere_irradiance(POINTS, np.array(UP), LOW_SPHERE.center, LOW_SPHERE.radius),
    ),
}
TECHNIQUES = ("area", "solid-angle")
CASES = [(name, technique) for technique in TECHNIQUES for name in LIGHTS]


def check(mean, se, truth, most=0.002):
    """Within 4 standard errors, which are small enough to mean something."""
    assert (se < most * truth).all(), f"relative standard error {np.max(se / truth):.5f}"
    assert (np.abs(mean - truth) < 4 * se).all(), (
        f"off by {np.max(np.abs(mean - truth) / se):.2f} standard errors"
    )


@pytest.mark.parametrize(("name", "technique"), CASES)
@pytest.mark.usefixtures("statistical")
def test_unoccluded_floor_points_agree_with_the_closed_form(name, technique):
    shape, irradiance = LIGHTS[name]
    built = build(scene([floor(), shape]))
    use = irradiance > 1e-3 * irradiance.max()
    truth = REFLECTANCE / np.pi * irradiance[use, None] * RADIANCE
    for point, value in zip(POINTS[use], truth, strict=True):
        # As many samples as a pilot run says are needed for a relative standard error of 0.18 %.
        _, pilot = reflect(built, point[None], UP, 0, technique, 20_000, seed=1)
        rounds = int(np.ceil((np.max(pilot / value) / 0.0018) ** 2 / 5))
        assert rounds <= 200, "a harder point than this test can afford"
        parts = [reflect(built, point[None], UP, 0, technique, 100_000, seed=2 + i) for i in range(rounds)]
        mean, se = (
            np.mean([m for m, _ in parts], axis=0),
            np.sqrt(np.mean([s**2 for _, s in parts], axis=0) / rounds),
        )
        check(mean, se, value[None])


@pytest.mark.parametrize("technique", ["area", "solid-angle"])
@pytest.mark.usefixtures("statistical")
def test_the_knife_edge_profile_agrees_with_its_closed_form(technique):
    """Across the penumbra at exact points, from full light to the umbra, where not one sample may leak."""
    description = scenes.load("knife-edge", {"xresolution": 16, "yresolution": 12})
    built = build(description)
    lamp = next(s for s in description.shapes if s.emission is not None)
    assert isinstance(lamp.geometry, BilinearMesh) and lamp.emission is not None
    p00, p10, p01, p11 = lamp.geometry.vertices[lamp.geometry.faces[0]]
    sheet = description.shapes[1].geometry
    assert isinstance(sheet, TriangleMesh)
    height, depth, top = sheet.vertices[0, 1], p01[2] - p00[2], p00[1]
    assert sheet.vertices[:, 2].min() == 0 and p01[2] == -p00[2]
    width = (
        depth / 2 * height / (top - height)
    )  # the penumbra is |z| < width; under the sheet, z > 0, is the umbra
    z = np.concatenate([np.linspace(-1.5 * width, 0.98 * width, 24), [width * (1 + 1e-9), 1.5 * width]])
    points = np.stack([np.full_like(z, 0.2), np.zeros_like(z), z], axis=1)
    truth = knife_edge_irradiance(
        points,
        np.array(UP),
        np.stack([p00, p10, p11, p01]),
        np.array([[-1.0, height, 0], [1.0, height, 0]]),
        np.array([0.0, 0, 1]),
    )
    assert truth[-2:].max() == 0 and truth[23] > 0
    mean, se = reflect(built, points, UP, 0, technique, 100_000)
    expected = REFLECTANCE / np.pi * truth[:, None] * lamp.emission.radiance
    assert (mean[-2:] == 0).all()
    bright = truth > 0.05 * truth.max()
    assert (se[bright] < 0.015 * expected[bright]).all() and (se[:8] < 0.002 * expected[:8]).all()
    lit = truth > 0
    assert (np.abs(mean - expected)[lit] < 4.5 * se[lit]).all()
    # All points pooled: a penumbra shifted by 0.2 % of its width, or 0.3 % too bright, would show.
    pooled = (mean - expected)[lit].sum(axis=0)
    assert (np.abs(pooled) < 4 * np.sqrt((se[lit] ** 2).sum(axis=0))).all()
