"""The plan: what it leaves out changes no bit of any image, and it does leave out what it can."""

from __future__ import annotations

import numpy as np
import pytest

import scenes
from renderer import build, render
from renderer.interfaces.estimator import ESTIMATORS
from renderer.plan.plan import PRUNINGS, make_plan
from renderer.render import RenderResult
from scenes.description.shapes import BilinearMesh, Disk, ShapeDescription, Sphere
from tests.kit.scenes import GRAY, floor, light, patch, scene

pytestmark = pytest.mark.usefixtures("thorough")

SMALL = {"xresolution": 48, "yresolution": 36}
TINY = {"xresolution": 16, "yresolution": 12}
CHUNKED = {"xresolution": 24, "yresolution": 18}  # 8,640 samples: 9 chunks of 1,000 rows, 26 of 333
SLOW = {"forest", "many-lights"}
LIBRARY = [entry.name for entry in scenes.library() if entry.name not in SLOW]
EVERY_ESTIMATOR = ("soft-shadow", "touching-light", "sky")
CASES = [
    pytest.param(
        name,
        estimator,
        sampler,
        marks=[] if estimator in ("mis", "solid-angle") else [pytest.mark.slow] * (name != "soft-shadow"),
    )
    for name in LIBRARY
    for estimator in (ESTIMATORS.names() if name in EVERY_ESTIMATOR else ("mis",))
    for sampler in (("independent", "sobol") if name == "soft-shadow" else ("independent",))
    if name not in EVERY_ESTIMATOR or not ESTIMATORS[estimator].refuses(scenes.load(name))
]


def same_bits(a: RenderResult, b: RenderResult) -> bool:
    arrays = all(
        np.array_equal(getattr(a.film, f), getattr(b.film, f)) for f in ("count", "mean", "m2", "maximum")
    )
    return arrays and np.array_equal(a.tail, b.tail) and a.reflected_sum == b.reflected_sum


@pytest.mark.parametrize(("name", "estimator", "sampler"), CASES)
def test_the_pruned_image_is_bitwise_the_unpruned_one(name, estimator, sampler):
    built = build(scenes.load(name, TINY))
    options = {"estimator": estimator, "sampler": sampler, "spp": 20, "seed": 3}
    pruned, full = render(built, **options), render(built, **options, prune=False)
    assert same_bits(pruned, full)
    assert pruned.rays.shadow <= full.rays.shadow
    for pruning in PRUNINGS:
        assert same_bits(pruned, render(built, **options, keep=frozenset([pruning])))


@pytest.mark.parametrize("name", LIBRARY)
def test_bits_do_not_depend_on_chunks_or_threads(name):
    built = build(scenes.load(name, CHUNKED))
    whole = render(built, spp=20)
    assert same_bits(whole, render(built, spp=20, rows=333))
    assert same_bits(
        whole,
        render(built, spp=20, rows=1, threads=2)
        if name == "touching-light"
        else render(built, spp=20, threads=2, rows=1000),
    )


def random_shape(rng: np.random.Generator):
    """A patch, a patch of two, a sphere or a disk, half of them aligned with the axes, half emitting, some
    two-sided.
    """
    c, x = rng.uniform(-2, 2, 3), rng.normal(size=3)
    y = np.cross(x, rng.normal(size=3))
    if rng.random() < 0.5:  # the planes that the plan reasons with, and coordinates that coincide
        axis = int(rng.integers(3))
        c, x, y = (
            np.round(c),
            np.eye(3)[axis],
            np.eye(3)[(axis + int(rng.integers(1, 3))) % 3] * rng.choice([-1, 1]),
        )
    emits = tuple(rng.uniform(0.5, 3, 3)) if rng.random() < 0.4 else None
    two_sided, kind = bool(rng.random() < 0.3), int(rng.integers(4))
    if kind == 0:
        return patch(c, x, y, emits, two_sided, bool(rng.random() < 0.5))
    if kind == 1:  # two patches at a right angle, or an angle at all
        z = np.cross(x, y)
        p = np.stack([c, c + x, c + y, c + x + y, c, c + z, c + y, c + z + y])
        mesh = BilinearMesh(p, np.array([[0, 1, 2, 3], [4, 5, 6, 7]]))
        return light(mesh, emits, two_sided) if emits else ShapeDescription(mesh, GRAY)
    geometry = Sphere(c, 0.5, bool(rng.random() < 0.2)) if kind == 2 else Disk(c, x / np.linalg.norm(x), 0.7)
    return light(geometry, emits, two_sided) if emits else ShapeDescription(geometry, GRAY)


def random_scene(seed: int):
    """Anything anywhere, in any order, often touching: behind lights, in their planes, across every
    horizon.
    """
    rng = np.random.default_rng(seed)
    shapes = [random_shape(rng) for _ in range(rng.integers(2, 6))]
    shapes += [floor(3.0, material=GRAY)] if seed % 2 else []
    lamp = patch([-0.5, 2.5, -0.5], [1, 0, 0], [0, 0, 1], (1.0, 1.0, 1.0), two_sided=seed % 5 == 0)
    shapes += (
        [lamp]
        if seed % 4
        else [lamp, ShapeDescription(Disk(np.array([0, 2.5, 0]), np.array([0, 1.0, 0]), 0.9), GRAY)]
    )
    order = rng.permutation(len(shapes))
    eye = rng.uniform([-4, -2, -4], [4, 6, 4])
    return scene([shapes[i] for i in order], eye=eye, target=(0, 0.5, 0), width=24, height=18)


SEEDS = range(120)


@pytest.mark.parametrize("seed", SEEDS)
def test_no_bit_changes_in_scenes_made_at_random(seed):
    """Catches a proof that is not sound: a wrong side, a touching case, a blocker dropped too many."""
    built = build(random_scene(seed))
    assert same_bits(render(built, spp=4), render(built, spp=4, prune=False))


def test_the_random_scenes_are_worth_the_name():
    """Most have light, most of those have shade, and shade comes from shapes of any number, the first one
    too.
    """
    lit = shaded = first = 0
    for seed in SEEDS:
        built = build(random_scene(seed))
        plan = make_plan(built)
        result = render(built, spp=1)
        lit += result.reflected_sum > 0
        shaded += result.rays.shadow > 0
        first += 0 in built.analytic.shape[plan.shadow_analytic]
    assert lit > 90 and shaded > 75 and first > 30, (lit, shaded, first)


def test_what_can_be_left_out_is_left_out():
    touching = build(scenes.load("touching-light", SMALL))
    plan = make_plan(touching)
    assert not plan.shadow.any() and not plan.horizon and plan.shadow_triangles is None
    assert render(touching, spp=1).rays.shadow == 0
    decided = {d.effect: d.needed for d in plan.decisions}
    assert decided["horizon tests"] is False and decided["shadow rays to rectangle 0"] is False


def test_a_light_that_faces_away_reaches_nothing_and_costs_nothing():
    up = patch([-0.5, 2, -0.5], [0, 0, 1], [1, 0, 0], (1.0, 1.0, 1.0))
    built = build(scene([floor(), up]))
    result = render(built, spp=4)
    assert result.rays.shadow == 0 and result.reflected == 0
    assert not make_plan(built).receivers.any()


def test_a_light_out_of_view_is_not_looked_for():
    built = build(scene([floor(), patch([-0.5, 30, -0.5], [1, 0, 0], [0, 0, 1], (1.0, 1.0, 1.0))]))
    plan = make_plan(built)
    assert not plan.emits and plan.in_view.size == 0
    assert render(built, spp=4).image.max() > 0
