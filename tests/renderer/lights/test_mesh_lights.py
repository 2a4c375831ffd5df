"""Lights of many faces and of odd ones: met by formula or by Embree, one or both sides, patches that are no
rectangles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.references.closed_form.radiometry import polygon_irradiance
from renderer import build
from renderer.geometry.primitives import FEW
from renderer.interfaces.estimator import ESTIMATORS
from renderer.render import render
from scenes.description.shapes import BilinearMesh, TriangleMesh
from tests.kit.scenes import box, floor, light, reflect, scene

pytestmark = pytest.mark.usefixtures("thorough")

UP = np.array([0.0, 1.0, 0.0])
POINTS = np.array([[0.0, 0, 0], [0.9, 0, -0.4], [-1.5, 0, 1.0]])
BOUNDED = ("solid-angle", "projected-solid-angle", "mis", "area")


def sheet(n: int, y: float = 1.5) -> TriangleMesh:
    """[-1, 1]^2 at height y as 2 n^2 triangles that face down, of unequal sizes."""
    at = np.linspace(-1, 1, n + 1) ** 3
    z, x = np.meshgrid(at, at, indexing="ij")
    p = np.stack([x.ravel(), np.full(x.size, y), z.ravel()], axis=1)
    i = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :-1].ravel()
    faces = np.concatenate(
        [np.stack([i, i + 1, i + n + 2], axis=1), np.stack([i, i + n + 2, i + n + 1], axis=1)]
    )
    return TriangleMesh(p, faces)


@pytest.mark.parametrize("n", [1, 5, 8])
def test_however_a_light_is_cut_it_sheds_the_same(n):
    """2, 50 and 128 faces, the last through Embree: Lambert's formula of the whole to 4.5 standard errors of
    at most 2 %.
    """
    built = build(scene([floor(), light(sheet(n), (1.0, 1.0, 1.0))]))
    assert (built.emissive_triangles is not None) == (2 * n * n > FEW) and len(built.lights) == 2 * n * n
    assert built.lights.pmf.sum() == pytest.approx(1.0)
    corners = np.array([[-1.0, 1.5, -1], [1, 1.5, -1], [1, 1.5, 1], [-1, 1.5, 1]])
    truth = polygon_irradiance(POINTS, UP, corners)[:, None] * 0.5 / np.pi
    for name in (*BOUNDED, "cosine", "hemisphere", "bsdf"):
        mean, se = reflect(built, POINTS, UP, 0, name, 20_000)
        assert np.all(np.abs(mean - truth) < 4.5 * se + 1e-6 * truth), name
        assert np.all(se < (0.02 if name in BOUNDED else 0.05) * truth), name
    control, se = reflect(built, POINTS, UP, 0, "analytic-visibility-unbiased", 10)
    np.testing.assert_allclose(control, np.repeat(truth, 3, axis=1), rtol=1e-9)


@pytest.mark.parametrize("n", [2, 8])
def test_two_sides_light_both_ways_and_one_side_is_seen_from_one(n):
    up, down = (
        scene(
            [floor(), box([0.0, 3.0, 0.0], 0.3), light(sheet(n), two_sided=both)],
            eye=(0.5, 4.0, -5.0),
            fov=50.0,
        )
        for both in (True, False)
    )
    for name in ("solid-angle", "mis", "cosine"):
        both, one = (render(s, estimator=name, spp=64).image for s in (up, down))
        assert both.mean() > 1.3 * one.mean(), name  # the sheet itself and the box above it
    means = [
        render(up, estimator=name, spp=256, seed=i) for i, name in enumerate(("solid-angle", "mis", "cosine"))
    ]
    for other in means[1:]:
        se = np.sqrt((means[0].variance + other.variance).sum(axis=(0, 1)))
        assert np.all(np.abs((means[0].image - other.image).sum(axis=(0, 1))) < 4.5 * se)


def test_meshes_shade_themselves_whichever_way_they_are_met():
    """A folded light: one half hides part of the other from the floor.

    By formula and by Embree the same image.
    """
    fold = np.array([[-1.0, 1.5, -1], [1, 1.5, -1], [1, 0.7, 0], [-1, 0.7, 0], [-1, 2.0, 1], [1, 2.0, 1]])
    few = TriangleMesh(fold, np.array([[0, 1, 2], [0, 2, 3], [3, 2, 5], [3, 5, 4]]))
    p, f = few.vertices, few.faces
    for _ in range(3):  # each face to four: 256 of them
        a, b, c = p[f[:, 0]], p[f[:, 1]], p[f[:, 2]]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        p = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
        f = np.arange(len(p)).reshape(-1, 3)
    many = TriangleMesh(p, f)
    view = {"eye": (2.0, 1.0, -4.0), "target": (0.0, 0.5, 0.0)}
    pairs = [scene([floor(), light(mesh, two_sided=True)], **view) for mesh in (few, many)]
    for name in ("solid-angle", "mis", "cosine"):
        a, b = (render(s, estimator=name, spp=128, seed=k) for k, s in enumerate(pairs))
        se = np.sqrt((a.variance + b.variance).sum(axis=(0, 1)))
        assert np.all(np.abs((a.image - b.image).sum(axis=(0, 1))) < 4.5 * se), name


def test_a_patch_that_is_no_rectangle_is_the_two_triangles_that_it_is_made_of():
    corners = np.array(
        [[-1.0, 1.5, -1], [1.2, 1.5, -0.8], [-0.7, 1.5, 0.6], [0.8, 1.5, 1.1]]
    )  # p00 p10 p01 p11
    lamp = light(BilinearMesh(corners, np.array([[0, 1, 2, 3]])), (1.0, 1.0, 1.0))
    built = build(scene([floor(), lamp]))
    assert len(built.lights) == 2
    truth = polygon_irradiance(POINTS, UP, corners[[0, 1, 3, 2]])[:, None] * 0.5 / np.pi
    for name in BOUNDED:
        assert not ESTIMATORS[name].refuses(built.description)
        mean, se = reflect(built, POINTS, UP, 0, name, 20_000)
        assert np.all(np.abs(mean - truth) < 4.5 * se + 1e-6 * truth), name
    turned = replace(lamp, geometry=replace(lamp.geometry, reverse=True))
    assert not reflect(build(scene([floor(), turned])), POINTS, UP, 0, "mis", 100)[0].any()


def test_the_nearer_of_two_lamps_is_the_one_that_is_met():
    """A dim rectangle before a bright mesh of many faces, and the other way round: chance and light sampling
    agree.
    """
    for low, high in ((0.2, 5.0), (5.0, 0.2)):
        near = light(sheet(1, y=0.8), (low, low, low))
        built = build(scene([floor(), near, light(sheet(8), (high, high, high))]))
        assert built.emissive_triangles is not None
        by_light, se = reflect(built, POINTS, UP, 0, "solid-angle", 40_000)
        for name in ("cosine", "hemisphere", "mis"):
            mean, error = reflect(built, POINTS, UP, 0, name, 40_000)
            assert np.all(np.abs(mean - by_light) < 4.5 * np.hypot(se, error)), (name, low)
