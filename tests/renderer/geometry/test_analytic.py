"""Primitives by formula: hits, sides, and shadows next to the surface that a ray leaves."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.geometry.analytic import AnalyticPrimitives, join, primitives_of
from scenes.description.shapes import BilinearMesh, Disk, Sphere


def sphere(shape, center, radius, reverse):
    return primitives_of(Sphere(center, radius, reverse), shape)[0]


def disk(shape, center, normal, radius):
    return primitives_of(Disk(center, normal, radius), shape)[0]


def rectangle(shape, corners, reverse):
    return primitives_of(BilinearMesh(corners, np.arange(4)[None], reverse), shape)[0]


BALL = sphere(0, np.zeros(3), 1.0, False)
UNIT = join([BALL])
ALL = np.arange(1)


def rays(*pairs):
    o, d = (np.array(v, dtype=float).T for v in zip(*pairs, strict=True))
    return o, d / np.linalg.norm(d, axis=0)


def none(n: int) -> np.ndarray:
    return np.full(n, -1)


def test_spheres_are_met_from_outside_and_inside_and_missed():
    t, which = UNIT.closest(
        ALL,
        *rays(
            ([0, 0, -3], [0, 0, 1]), ([0, 0, 0], [0, 1, 0]), ([0, 2, -3], [0, 0, 1]), ([0, 0, 3], [0, 0, 1])
        ),
    )
    np.testing.assert_allclose(t, [2, 1, np.inf, np.inf])
    assert which.tolist() == [0, 0, -1, -1]


def test_far_spheres_keep_their_digits():
    """A unit sphere 1e7 away: b^2 - c would leave no digit of the root; here the error stays below 1e-8."""
    for offset in (0.0, 0.5, 0.999999):
        t, _ = UNIT.closest(ALL, *rays(([0, offset, -1e7], [0, 0, 1])))
        assert t[0] == pytest.approx(1e7 - np.sqrt(1 - offset**2), abs=1e-8)


def test_disks_and_rectangles_end_at_their_edges():
    flat = join(
        [
            disk(0, np.zeros(3), np.array([0.0, 1, 0]), 2.0),
            rectangle(1, np.array([[3, 0, 0], [5, 0, 0], [3, 0, 1], [5, 0, 1.0]]), False),
        ]
    )
    inside = [([1.99, 1, 0], [0, -1, 0]), ([3.01, 1, 0.99], [0, -1, 0])]
    outside = [
        ([2.01, 1, 0], [0, -1, 0]),
        ([5.01, 1, 0.5], [0, -1, 0]),
        ([4, 1, 1.01], [0, -1, 0]),
        ([4, 1, 0.5], [1, 0, 0]),
    ]
    _, which = flat.closest(np.arange(2), *rays(*inside, *outside))
    assert which.tolist() == [0, 1, -1, -1, -1, -1]


def test_a_sphere_never_shades_what_leaves_it_outwards():
    """Points on a sphere a million across, offset nowhere: a tolerance in the distance would fail at one end
    or the other.
    """
    rng = np.random.default_rng(0)
    n = rng.normal(size=(3, 2000))
    n /= np.linalg.norm(n, axis=0)
    d = rng.normal(size=(3, 2000))
    d /= np.linalg.norm(d, axis=0)
    d = np.where((n * d).sum(axis=0) < 0, -d, d)
    for radius in (1e-6, 1.0, 1e6):
        q = join([sphere(0, np.array([1e3, 0, 0]), radius, False)])
        p = n * radius + np.array([[1e3], [0], [0]])
        near, far = np.zeros(2000), np.full(2000, 1e9)
        assert not q.occluded(ALL, p, d, near, far, np.zeros(2000, dtype=np.int64), none(2000)).any()
        inwards = q.occluded(ALL, p, -d, near, far, np.zeros(2000, dtype=np.int64), none(2000))
        assert inwards[(n * d).sum(axis=0) > 1e-6].all()


def test_the_goal_never_blocks_and_what_is_beyond_it_does_not_either():
    o, d = rays(([0, 0, -3], [0, 0, 1]), ([0, 0, -3], [0, 0, 1]), ([0, 0, -3], [0, 0, 1]))
    blocked = UNIT.occluded(ALL, o, d, np.zeros(3), np.array([5.0, 5.0, 1.9]), none(3), np.array([-1, 0, -1]))
    assert blocked.tolist() == [True, False, False]
    behind = UNIT.occluded(ALL, o, d, np.full(3, 4.1), np.full(3, 5.0), none(3), none(3))
    assert not behind.any()


def test_no_primitives_are_no_trouble():
    empty: AnalyticPrimitives = join([])
    o, d = rays(([0, 0, -3], [0, 0, 1]))
    t, which = empty.closest(np.arange(0), o, d)
    assert t.tolist() == [np.inf] and which.tolist() == [-1]


def test_points_are_moved_onto_their_quadric():
    q = join([BALL, disk(1, np.zeros(3), np.array([0.0, 1, 0]), 2.0)])
    p, n = q.surface(np.array([0, 1]), np.array([[1.001, 0, 0], [0.5, 1e-3, 0.5]]).T)
    np.testing.assert_allclose(p.T, [[1, 0, 0], [0.5, 0, 0.5]], atol=1e-16)
    np.testing.assert_allclose(n.T, [[1, 0, 0], [0, 1, 0]], atol=1e-16)
