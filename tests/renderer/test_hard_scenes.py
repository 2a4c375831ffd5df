"""Whole scenes where arithmetic is tried: scaled, moved, with lights of any size, coincident surfaces, sealed
boxes.

Scenes are rendered with the same random numbers as the plain one, so that images must agree far below their
noise, and any difference is one of rounding: a leak, acne, a lost light.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from renderer.interfaces.estimator import ESTIMATORS
from renderer.render import render
from scenes.description.lights import DistantLight, Environment, PointLight, SpotLight
from scenes.description.shapes import Disk, Sphere, TriangleMesh
from scenes.errors import PenumbraError
from tests.kit.scenes import box, floor, light, moved, patch, scene

pytestmark = pytest.mark.usefixtures("thorough")

WHITE = np.ones(3)
DOWN = np.array([0.0, -1.0, 0.0])
LAMPS = {
    "rectangle": ([patch([-0.5, 2.0, -0.5], [1, 0, 0], [0, 0, 1], [3.0, 2, 1])], ()),
    "disk": ([light(Disk(np.array([0.0, 2.0, 0.0]), DOWN, 0.5))], ()),
    "sphere": ([light(Sphere(np.array([0.0, 2.0, 0.0]), 0.4))], ()),
    "triangle": (
        [
            light(
                TriangleMesh(
                    np.array([[-0.5, 2.0, -0.5], [0.5, 2.0, -0.5], [0.0, 2.0, 0.5]]), np.array([[0, 1, 2]])
                )
            )
        ],
        (),
    ),
    "environment": ([], (Environment(WHITE),)),
    "distant": ([], (DistantLight(np.array([0.36, 0.8, 0.48]), WHITE),)),
    "point": ([], (PointLight(np.array([0.5, 2.0, -1.0]), WHITE),)),
    "spot": ([], (SpotLight(np.array([0.5, 2.0, -1.0]), DOWN, WHITE, 40.0, 20.0),)),
}
PLACES = [
    *((s, (0.0, 0.0, 0.0)) for s in (1e-6, 1e-3, 1e3, 1e7)),
    (1.0, (1e6, -1e6, 1e6)),
]


def lit_by(lamp: str):
    shapes, lights = LAMPS[lamp]
    return replace(scene([floor(), box([0.3, 0.5, 0.2], 0.5), *shapes]), lights=lights)


def applicable(given) -> list[str]:
    return [name for name in ESTIMATORS.names() if not ESTIMATORS[name].refuses(given)]


@pytest.mark.parametrize("lamp", LAMPS)
def test_scaled_and_moved_scenes_give_the_plain_image(lamp):
    """Pixels that differ by more than 1e-3 are those where a shadow ray or a camera ray passes an edge: a
    handful of samples.

    With 8 samples a pixel one sample that falls on the other side moves its pixel by an eighth or so; 0.5 %
    of pixels, and a mean within 1e-4, leave room for those and for nothing else: acne or a leak at any scale
    takes whole regions.
    """
    plain = lit_by(lamp)
    for name in applicable(plain):
        truth = render(plain, estimator=name, spp=8).image
        assert truth.mean() > 0
        for scale, offset in PLACES:
            image = render(moved(plain, scale, offset), estimator=name, spp=8).image
            off = np.abs(image - truth).max(axis=2) > 1e-3 * truth.max()
            assert off.mean() < 5e-3, (name, scale, offset, off.mean())
            assert abs(image.mean() / truth.mean() - 1) < 1e-3, (name, scale, offset)


@pytest.mark.parametrize("lamp", ["rectangle", "disk", "sphere", "triangle"])
@pytest.mark.parametrize("size", [1e-6, 1e-3, 1e3, 1e6])
@pytest.mark.usefixtures("statistical")
def test_lights_of_any_size_give_what_they_must(lamp, size):
    """Radiance falls with the square of the size, so that the floor far below a small light gets the same; a
    light of 1e6 fills the sky.

    Small lights: E at the point below tends to I/h^2, with I = L A of a flat light, 1 % off at size 1e-1 and
    less below. Large ones: L pi from a full hemisphere (the sphere is entered: it is lit from inside nowhere,
    and has its own test).
    """
    shapes, _ = LAMPS[lamp]
    given = shapes[0]
    plain = scene([floor(), given], eye=(0.0, 1.5, -0.02), target=(0.0, 0.0, 0.0), width=4, height=4, fov=1.0)
    if size < 1:
        shrunk = moved(scene([given]), size, (0.0, 2.0 - 2.0 * size, 0.0)).shapes[0]
        assert shrunk.emission is not None
        shrunk = replace(
            shrunk, emission=replace(shrunk.emission, radiance=given.emission.radiance / size**2)
        )
        here = replace(plain, shapes=(plain.shapes[0], shrunk))
        area = {"rectangle": 1.0, "disk": np.pi / 4, "sphere": np.pi * 0.16, "triangle": 0.5}[lamp]
        expected = 0.5 / np.pi * given.emission.radiance * area / 4.0
        for name in ("area", "solid-angle", "mis", "projected-solid-angle"):
            if not ESTIMATORS[name].refuses(here):
                image = render(here, estimator=name, spp=64).image
                # 64 x 16 samples of a light that is nearly a point: no noise to speak of but on the back half
                # of a sphere
                slack = 0.15 if (lamp, name) == ("sphere", "area") else 0.02
                np.testing.assert_allclose(image.mean(axis=(0, 1)), expected, rtol=slack)
    elif lamp != "sphere":
        centre = (
            given.geometry.vertices.mean(axis=0)
            if hasattr(given.geometry, "vertices")
            else given.geometry.center
        )
        grown = moved(scene([given]), size, tuple(np.array([0.0, 2.0, 0.0]) - size * centre)).shapes[0]
        here = replace(plain, shapes=(plain.shapes[0], grown))
        for name in ("solid-angle", "mis", "hemisphere", "cosine", "projected-solid-angle"):
            if not ESTIMATORS[name].refuses(here):
                image = render(here, estimator=name, spp=256).image
                np.testing.assert_allclose(image.mean(axis=(0, 1)), 0.5 * given.emission.radiance, rtol=0.1)


@pytest.mark.parametrize("lamp", LAMPS)
@pytest.mark.parametrize(("scale", "offset"), [(1.0, (0.0, 0.0, 0.0)), *PLACES])
def test_no_light_leaks_into_a_sealed_box(lamp, scale, offset):
    """The camera is inside a closed box, every light outside: every sample of every estimator is exactly 0.

    The control variate is 0 there on average only.
    """
    shapes, lights = LAMPS[lamp]
    sealed = replace(
        scene([box([0.0, 0.0, 0.0], 1.0), *shapes], eye=(0.3, 0.2, -0.5), target=(0.1, -0.9, 0.7), fov=90.0),
        lights=lights,
    )
    given = moved(sealed, scale, offset)
    for name in applicable(given):
        if name not in ("ambient-occlusion", "analytic-visibility-unbiased"):
            result = render(given, estimator=name, spp=4, prune=False)
            assert not result.image.any(), (name, int((result.image > 0).sum()))


def test_a_light_in_the_plane_of_its_receiver_or_behind_it_sends_nothing():
    for lamp in (
        patch([1.0, 0.0, -0.5], [1, 0, 0], [0, 0, 1], WHITE),
        patch([1.0, -1.0, -0.5], [1, 0, 0], [0, 0, 1], WHITE),
    ):
        given = scene([floor(0.5), lamp], eye=(0.0, 1.0, -0.1), target=(0.0, 0.0, 0.0), fov=10.0)
        for name in applicable(given):
            if name != "ambient-occlusion":
                result = render(given, estimator=name, spp=4, prune=False)
                assert not result.image.any() and result.nonfinite == 0, name


def test_surfaces_that_coincide_shade_each_other_nowhere():
    """Two floors in one place, and one that is a hair below: the same image as one floor alone."""
    lamp = LAMPS["rectangle"][0]
    one = scene([floor(), *lamp])
    truth = render(one, estimator="solid-angle", spp=8).image
    for other in (floor(), floor(3.0), floor(y=-1e-9)):
        image = render(scene([floor(), other, *lamp]), estimator="solid-angle", spp=8).image
        np.testing.assert_allclose(image, truth, rtol=1e-6)


def test_a_light_nearer_than_rays_can_tell_is_refused_where_triangles_may_lie_in_between():
    """Down to ten bounds it is rendered; below, only if nothing can lie in between.

    Ten bounds of this floor are 6e-5.
    """
    between = box([3.0, 0.5, 0.0], 0.1)  # reaches below the light, far aside
    for h, refused in ((1e-3, False), (1e-5, True), (1e-8, True)):
        low = patch([-0.5, h, -0.5], [1, 0, 0], [0, 0, 1], WHITE)
        alone, crowded = scene([floor(), low]), scene([floor(), box([3.0, 0.05, 0.0], 0.1), low, between])
        assert render(alone, estimator="solid-angle", spp=1).nonfinite == 0
        if refused:
            with pytest.raises(PenumbraError, match=r"from a surface .*that it lights, with triangles"):
                render(crowded, estimator="solid-angle", spp=1)
        else:
            render(crowded, estimator="solid-angle", spp=1)
