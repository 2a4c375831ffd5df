"""Lights in one place count once each, on their own side: closed forms, for every choice of directions."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.references.closed_form.radiometry import polygon_irradiance, sphere_irradiance
from pipeline.references.mitsuba.limits import reason
from renderer import render
from renderer.build import build
from scenes.description.coincidence import ambiguous, coinciding
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Disk, Geometry, Quadric, ShapeDescription, Sphere, TriangleMesh
from scenes.pbrt.parser import parse
from tests.kit.scenes import floor, light, patch, scene

pytestmark = pytest.mark.usefixtures("thorough")

# From the side of each estimator: directions by light, by BSDF, and both.
ESTIMATORS = ("solid-angle", "area", "bsdf", "cosine", "mis", "mis-balance")
SQUARE = np.array([[-1.0, 1.5, -1], [1, 1.5, -1], [1, 1.5, 1], [-1, 1.5, 1]])
UP = np.array([[0, 2, 1], [0, 3, 2]])
DOWN = UP[:, ::-1]
L = 2.0


def mesh(faces: np.ndarray) -> ShapeDescription:
    return light(TriangleMesh(SQUARE, faces), (L, L, L))


def panel(reverse: bool) -> ShapeDescription:
    return patch((-1, 1.5, -1), (2, 0, 0), (0, 0, 2), (L, L, L), reverse=reverse)


def looking_at_origin(*lights: ShapeDescription) -> SceneDescription:
    """A pixel or so about the origin of a floor of albedo 1/2."""
    return scene(
        [floor(), *lights], eye=(0.0, 1.0, -3.0), target=(0.0, 0.0, 0.0), width=4, height=4, fov=0.05
    )


def square_irradiance() -> float:
    up = np.array([0.0, 1.0, 0.0])
    return float(polygon_irradiance(np.zeros((1, 3)), up, SQUARE[::-1], L, two_sided=True)[0])


@pytest.mark.parametrize(
    ("lights", "times"),
    [
        ([mesh(np.concatenate([UP, DOWN]))], 1),
        ([panel(False), panel(True)], 1),
        ([mesh(UP), mesh(DOWN)], 1),
        ([panel(False), panel(False)], 2),
        ([mesh(np.concatenate([DOWN, DOWN]))], 2),
        ([mesh(np.tile(np.concatenate([UP, DOWN]), (20, 1)))], 20),  # through Embree
    ],
    ids=["both windings", "panels", "meshes", "same panel", "same faces", "many faces"],
)
def test_a_square_shines_on_the_floor_as_often_as_it_is_there(lights, times):
    """Within 4.5 standard errors, below 3 % but for chance: half of the light or twice of it is far off."""
    e = square_irradiance()
    for i, estimator in enumerate(ESTIMATORS):
        result = render(looking_at_origin(*lights), estimator=estimator, spp=400, seed=i)
        truth = 0.5 / np.pi * e * times
        error = np.sqrt(result.variance[..., 0].mean() / 16)
        assert error < 0.04 * max(truth, 1e-3), (estimator, error, truth)
        assert abs(result.image[..., 0].mean() - truth) < 4.5 * error + 1e-5 * truth, (estimator, truth)


def test_a_sphere_that_shines_both_ways_and_is_there_twice():
    center = np.array([0.0, 2.0, 0.0])
    balls = [light(Sphere(center, 0.7, reverse), (L, L, L)) for reverse in (False, True, False)]
    up = np.array([0.0, 1.0, 0.0])
    truth = 2 * L * 0.5 / np.pi * float(sphere_irradiance(np.zeros((1, 3)), up, center, 0.7)[0])
    for i, estimator in enumerate(ESTIMATORS):
        result = render(looking_at_origin(*balls), estimator=estimator, spp=400, seed=i)
        error = np.sqrt(result.variance[..., 0].mean() / 16)
        assert error < 0.04 * truth
        assert abs(result.image[..., 0].mean() - truth) < 4.5 * error + 1e-5 * truth, estimator


def test_a_camera_sees_all_that_shine_towards_it():
    """Two sides of unlike radiance, one of them twice."""
    lights = [panel(False), panel(True), mesh_panel(1.0, False), mesh_panel(3.0, True)]
    above = scene(
        [floor(), *lights], eye=(0.0, 4.0, -0.01), target=(0.0, 1.5, 0.0), width=4, height=4, fov=1.0
    )
    below = scene(
        [floor(), *lights], eye=(0.0, 0.5, -0.01), target=(0.0, 1.5, 0.0), width=4, height=4, fov=1.0
    )
    seen = sorted(float(render(s, spp=1).image[0, 0, 0]) for s in (above, below))
    np.testing.assert_allclose(seen, [L + 1, L + 3])


def mesh_panel(radiance: float, reverse: bool) -> ShapeDescription:
    return patch((-1, 1.5, -1), (2, 0, 0), (0, 0, 2), (radiance,) * 3, reverse=reverse)


def test_light_on_a_panel_is_not_its_own_back():
    """A white panel back to back with another, under a sphere: as the one that faces it alone.

    From its points the other lies at a distance of 0, and must not stand for the first light along a ray.
    """
    ball = light(Sphere(np.array([0.0, 3.0, 0.0]), 0.5), (L, L, L))
    white = floor().material
    both = [ShapeDescription(p.geometry, white, p.emission) for p in (panel(False), panel(True))]
    images = []
    for panels in (both, both[1:]):
        view = scene(
            [*panels, ball], eye=(0.0, 4.0, -2.0), target=(0.0, 1.5, 0.0), width=4, height=4, fov=1.0
        )
        images.append([render(view, estimator=e, spp=4096, seed=3) for e in ("bsdf", "mis")])
    for one, other in zip(*images, strict=True):
        error = np.sqrt((one.variance.mean() + other.variance.mean()) / 16)
        assert error < 0.01
        assert other.image.mean() - L > 0.05  # of the sphere's light
        assert abs(one.image.mean() - other.image.mean()) < 4.5 * error


@pytest.mark.parametrize(
    "geometry",
    [
        Sphere(np.array([0.1, 2.0, 0.3]), 0.5),
        Disk(np.array([0.1, 2.0, 0.3]), np.array([0.0, 0.6, -0.8]), 0.5),
        Quadric("cylinder", np.eye(4)[:3], 0.5, 0.0, 1.0),
        TriangleMesh(SQUARE, UP),
    ],
)
def test_faces_are_told_from_all_but_themselves(geometry: Geometry):
    one, turned = light(geometry), light(geometry.flipped())
    for pair, same in (((one, one), True), ((one, turned), False)):
        found = coinciding(pair)
        assert found is not None and found.same_side.reshape(2, -1)[1].all() == same
        assert "another light" in (ambiguous(pair) or "")
        assert "another light" in (reason(looking_at_origin(*pair)) or "")
    assert coinciding([one]) is None
    assert coinciding([one, light(Sphere(np.zeros(3), 0.25))]) is None
    dark = ShapeDescription(geometry, one.material)
    assert coinciding([one, dark, dark]) is None


def test_a_panel_turned_by_half_a_turn_is_in_the_same_place():
    """Its corners come out of cosines, and are off by rounding."""
    text = 'Shape "bilinearmesh" "point3 P" [ -.3 -1 0  .7 -1 0  -.3 1.1 0  .7 1.1 0 ]'
    head = 'Camera "perspective" WorldBegin AreaLightSource "diffuse" Translate .1 .2 .3 Rotate 33 1 2 3 '
    made = parse(f"{head} {text} Translate .2 0 0 Rotate 180 0 1 0 Translate -.2 0 0 {text}")
    found = coinciding(made.shapes)
    assert found is not None and not found.same_side.all()


def test_other_scenes_do_no_more_than_before():
    assert build(looking_at_origin(panel(True))).lights.coincident is None
