"""Shadow rays where things touch: behind a light, in its plane, at a receiver's own surface, on slivers."""

from __future__ import annotations

import numpy as np
import pytest

from renderer import build, render
from renderer.geometry.triangles import SLENDER, make_triangles
from scenes.description.materials import Diffuse
from scenes.description.shapes import BilinearMesh, Disk, ShapeDescription, TriangleMesh
from tests.kit.scenes import BLACK, GRAY, floor, light, patch, scene

LAMP = ([-0.5, 2.0, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])  # faces down


def means(shapes, **options) -> list[float]:
    built = build(scene(shapes, eye=(0.3, 1.0, -5.0), target=(0.0, -1.0, 0.0)))  # looks down: no lamp in view
    return [
        float(render(built, estimator="solid-angle", spp=8, prune=prune, **options).image.mean())
        for prune in (True, False)
    ]


def slab(y: float, half: float = 3.0, tilt: float = 0.0) -> ShapeDescription:
    """A ceiling of two triangles."""
    p = np.array(
        [[-half, y - tilt, -half], [-half, y - tilt, half], [half, y + tilt, half], [half, y + tilt, -half]]
    )
    return ShapeDescription(TriangleMesh(p, np.array([[0, 1, 2], [0, 2, 3]])), BLACK)


@pytest.mark.parametrize("gap", [0.0, 1e-7, 1e-6, 1e-5, 1e-3])
@pytest.mark.parametrize("half", [3.0, 40.0])
def test_what_touches_a_light_from_behind_does_not_hide_it(gap, half):
    """A lamp flush with a ceiling, as in every Cornell box: to the last bit as bright as without the
    ceiling.
    """
    lamp = patch(*LAMP, (1.0, 1.0, 1.0))
    ours, bare = means([floor(), lamp, slab(2.0 + gap, half)]), means([floor(), lamp])
    assert ours[0] == ours[1]
    assert ours[0] == pytest.approx(bare[0], rel=1e-12)


def test_a_ceiling_below_the_light_hides_it():
    assert means([floor(), patch(*LAMP, (1.0, 1.0, 1.0)), slab(1.99, 10.0)]) == [0.0, 0.0]


def test_a_disk_in_the_plane_of_a_light_does_not_hide_it():
    for tilt in (0.0, 0.3):
        normal = np.array([np.sin(tilt), -np.cos(tilt), 0.0])
        x = np.array([np.cos(tilt), np.sin(tilt), 0.0])
        lamp = patch([-0.5 * x[0], 2.0 - 0.5 * x[1], -0.5], list(x), [0.0, 0.0, 1.0], (1.0, 1.0, 1.0))
        disk = ShapeDescription(Disk(np.array([0.0, 2.0, 0.0]), normal, 0.8), BLACK)
        ours, bare = means([floor(), lamp, disk]), means([floor(), lamp])
        assert ours[0] == ours[1] == pytest.approx(bare[0], rel=1e-12)


def test_a_disk_in_the_plane_of_a_receiver_does_not_hide_its_light():
    mat = ShapeDescription(Disk(np.array([0.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), 0.5), BLACK)
    lamp = patch(*LAMP, (1.0, 1.0, 1.0))
    ours = means([floor(), mat, lamp])
    assert ours[0] == ours[1]


@pytest.mark.parametrize("aspect", [1.0, 0.1, 1.2 / SLENDER])
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_a_triangle_does_not_shade_itself(aspect, offset):
    """100,000 shadow rays from points on triangles of all orientations, grazing ones too: not one is
    stopped.
    """
    rng = np.random.default_rng(1)
    count, each = 500, 200
    axis = rng.normal(size=(3, count, 3))
    e1 = axis[0] / np.linalg.norm(axis[0], axis=1, keepdims=True)
    e2 = np.cross(e1, axis[1])
    e2 *= aspect / np.linalg.norm(e2, axis=1, keepdims=True)
    for t in range(0, count, 100):  # one triangle at a time in view of its own rays
        corners = np.stack([np.zeros(3), e1[t], 0.3 * e1[t] + e2[t]]) + offset
        triangles = make_triangles(corners, np.array([[0, 1, 2]]), np.array([0]), np.array([False]))
        b = rng.dirichlet([1, 1, 1], each)
        p = np.ascontiguousarray((b @ corners).T)
        n = np.repeat(triangles.normal, each, axis=1)
        d = rng.normal(size=(3, each))
        d -= n * (n * d).sum(axis=0)
        d = d / np.linalg.norm(d, axis=0) + n * 10.0 ** rng.uniform(-5, 0, each)
        hidden = triangles.occluded(p, n, np.zeros(each, dtype=np.int64), p + d, -n)
        assert not hidden.any()


def test_two_sided_lights_light_both_sides_and_are_seen_from_both():
    up = patch(
        [-0.5, 2.0, -0.5], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], (1.0, 1.0, 1.0), two_sided=True
    )  # faces up
    down = patch(*LAMP, (1.0, 1.0, 1.0))
    for estimator in ("area", "solid-angle", "cosine", "mis"):
        pair = [build(scene([floor(), lamp])) for lamp in (up, down)]
        two, one = (render(b, estimator=estimator, spp=256, seed=4) for b in pair)
        both = [render(b, estimator=estimator, spp=256, seed=4, prune=False) for b in pair]
        assert np.array_equal(two.image, both[0].image) and np.array_equal(one.image, both[1].image)
        error = np.sqrt(two.variance.mean() / two.image[..., 0].size) * 3
        assert two.image.mean() == pytest.approx(one.image.mean(), abs=4.5 * error)
        assert one.image.mean() > 10 * error
    seen = scene([floor(), up], eye=(0.0, 0.5, -0.01), target=(0.0, 2.0, 0.0))
    back = scene(
        [floor(), patch([-0.5, 2.0, -0.5], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], (1.0, 1.0, 1.0))],
        eye=(0.0, 0.5, -0.01),
        target=(0.0, 2.0, 0.0),
    )
    assert render(seen, spp=1).image.max() == 1.0
    assert render(back, spp=1).image.max() == 0.0


def test_the_patches_of_one_light_shade_each_other():
    """An L of two patches: the upright one stands between the other and half of the floor."""
    p = np.array(
        [
            [0.0, 0.1, -1], [1.0, 0.1, -1], [0.0, 0.1, 1], [1.0, 0.1, 1],
            [-0.2, 0.0, -4], [-0.2, 0.0, 4], [-0.2, 3.0, -4], [-0.2, 3.0, 4],
        ]
    )  # fmt: skip
    both = light(BilinearMesh(p, np.array([[0, 1, 2, 3], [4, 6, 5, 7]])))
    alone = light(BilinearMesh(p[:4], np.array([[0, 1, 2, 3]])))
    upright = ShapeDescription(BilinearMesh(p[4:], np.array([[0, 2, 1, 3]])), Diffuse(np.zeros(3)))
    images = [
        render(build(scene([floor(), *s], eye=(0.0, 6.0, -0.01), target=(0.0, 0.0, 0.0))), spp=16)
        for s in ([both], [alone, upright])
    ]
    full = render(
        build(scene([floor(), both], eye=(0.0, 6.0, -0.01), target=(0.0, 0.0, 0.0))), spp=16, prune=False
    )
    assert np.array_equal(images[0].image, full.image)
    assert GRAY.reflectance[0] == 0.5 and images[1].image.mean() > 0
