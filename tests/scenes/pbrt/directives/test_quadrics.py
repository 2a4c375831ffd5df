"""Parts of spheres and disks, cylinders, and all of them stretched: as pbrt reads them, and written back."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.description.shapes import Disk, Quadric, Sphere
from scenes.pbrt.write.scene import export
from tests.kit.scene_texts import parse, world

SHEAR = "ConcatTransform [ 1 .1 0 0  .3 1.5 0 0  0 .2 .7 0  .1 .2 .3 1 ]"
LIGHT = 'AreaLightSource "diffuse" "rgb L" [ 3 2 1 ]'
PARTS = {
    "sphere": '"float radius" .7 "float zmin" .6 "float zmax" -.31 "float phimax" 271.3',
    "disk": '"float radius" .7 "float innerradius" .13 "float height" -.2 "float phimax" 123',
    "cylinder": '"float radius" .31 "float zmin" -.4 "float zmax" 1.7 "float phimax" 300.1',
}


def quadric(body: str) -> Quadric:
    (shape,) = world(body).shapes
    assert isinstance(shape.geometry, Quadric)
    return shape.geometry


@pytest.mark.parametrize("kind", PARTS)
@pytest.mark.parametrize(
    "before", ["", "Rotate 31 1 2 3", SHEAR, f"{SHEAR} {LIGHT}", f"Scale -1 1 1 {SHEAR}"]
)
def test_the_text_of_a_quadric_reads_back_bitwise(kind: str, before: str) -> None:
    """And of an area light, whose side a mirror would leave undefined."""
    scene = world(f'{before} ReverseOrientation Shape "{kind}" {PARTS[kind]}')
    assert parse(export(scene, "scene").text).content_hash() == scene.content_hash()


def test_bounds_are_ordered_and_brought_back_to_the_shape() -> None:
    sphere = quadric('Shape "sphere" "float radius" 2 "float zmin" 1 "float zmax" -9 "float phimax" 400')
    assert (sphere.zmin, sphere.zmax, sphere.phimax) == (-2.0, 1.0, 360.0)
    tube = quadric('Shape "cylinder"')
    assert (tube.radius, tube.zmin, tube.zmax, tube.phimax) == (1.0, -1.0, 1.0, 360.0)
    tube = quadric('Shape "cylinder" "float zmin" 5 "float zmax" -3')
    assert (tube.zmin, tube.zmax) == (-3.0, 5.0)


def test_what_keeps_a_sphere_round_keeps_it_a_sphere_and_the_scale_goes_to_the_lengths() -> None:
    whole, part = world('Scale 2 2 2 Shape "sphere" Scale 1 1 3 Shape "disk"').shapes
    assert isinstance(whole.geometry, Sphere) and isinstance(part.geometry, Disk)
    tube = quadric('Scale 2 2 2 Shape "cylinder" "float zmax" .5')
    assert (tube.radius, tube.zmin, tube.zmax) == (2.0, -2.0, 1.0)
    assert np.array_equal(tube.matrix, np.eye(4)[:3])


def test_an_instance_is_the_shape_under_both_transformations() -> None:
    for kind in ('"sphere"', '"disk"', '"cylinder"', f'"sphere" {PARTS["sphere"]}'):
        once = quadric(f"Scale 1 2 1 Translate 1 2 3 Shape {kind}")
        (used,) = world(
            f'ObjectBegin "o" Translate 1 2 3 Shape {kind} ObjectEnd Scale 1 2 1 ObjectInstance "o"'
        ).shapes
        assert isinstance(used.geometry, Quadric)
        np.testing.assert_allclose(used.geometry.matrix, once.matrix, rtol=1e-15)
        assert used.geometry.reverse == once.reverse


def test_a_mirror_and_reverse_orientation_turn_the_side() -> None:
    for words, reverse in (("", False), ("ReverseOrientation", True), ("Scale 1 1 -2", True)):
        assert quadric(f'{words} Shape "sphere" "float zmin" 0').reverse is reverse


@pytest.mark.parametrize(
    "body", [f'{LIGHT} Shape "sphere" "float zmin" 0', f'{LIGHT} Scale 1 2 1 Shape "disk"']
)
def test_a_light_that_pbrt_takes_for_the_whole_one_gets_a_note(body: str) -> None:
    notes = world(body).notes
    assert any("whole" in str(note) for note in notes), notes
    assert not world(f'{LIGHT} Shape "cylinder"').notes


@pytest.mark.parametrize(
    ("quadric", "area"),
    [
        (Quadric("sphere", np.eye(4)[:3], 2.0, -1.0, 0.5, phimax=90.0), np.pi / 2 * 2.0 * 1.5),
        (Quadric("disk", np.eye(4)[:3], 2.0, 0.0, 0.0, 1.0, 90.0), np.pi / 4 * 3),
        # An oblate spheroid, a = 2, c = 1: 2 pi a^2 (1 + (1 - e^2) / e artanh e), e^2 = 3/4
        (
            Quadric("sphere", np.diag([2.0, 2.0, 1.0, 1.0])[:3], 1.0, -1.0, 1.0),
            8 * np.pi * (1 + 0.25 / np.sqrt(0.75) * np.arctanh(np.sqrt(0.75))),
        ),
        # The perimeter of an ellipse of 3 and 1, 4 a E(e), times its height
        (Quadric("cylinder", np.diag([3.0, 1.0, 2.0, 1.0])[:3], 1.0, 0.0, 1.0), 2 * 13.364893220555258),
    ],
)
def test_areas_are_those_of_closed_forms(quadric: Quadric, area: float) -> None:
    """Of a grid of triangles too, to 1.3e-4: what chords of 512 steps leave out."""
    np.testing.assert_allclose(quadric.areas(), area, rtol=1e-9)
    np.testing.assert_allclose(quadric.triangulated().areas().sum(), area, rtol=2e-4)


def test_bounds_touch_what_they_hold() -> None:
    """Of whole ones: no slack but for the grid's chords, and nothing outside."""
    matrix = np.array([[0.7, 0.2, 0.1, 1.0], [0.1, 0.5, -1.0, 2.0], [0.0, 0.6, 0.3, 3.0]])
    directions = np.random.default_rng(1).normal(size=(20, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for form, low, high in (("sphere", -0.6, 0.6), ("disk", 0.2, 0.2), ("cylinder", -0.2, 0.9)):
        shape = Quadric(form, matrix, 0.6, low, high)
        points = shape.triangulated().vertices @ directions.T
        least, most = shape.bounds().extent(directions)
        np.testing.assert_allclose(points.min(axis=0), least, atol=1e-4)
        np.testing.assert_allclose(points.max(axis=0), most, atol=1e-4)
        assert (points.min(axis=0) >= least - 1e-12).all() and (points.max(axis=0) <= most + 1e-12).all()
