"""Details of tests of images: seeds, degrees of freedom, the largest draw, the level of a family, and the
sign of a difference.
"""

from __future__ import annotations

import numpy as np
import pytest

import scenes
from pipeline.references.protocol import ReferenceImage
from pipeline.statistics.welch import sidak_level
from pipeline.studies.agreement import agreement
from pipeline.studies.moments import of_reference, of_render
from pipeline.studies.verify import Trial, verify
from renderer import build, render
from scenes.description.scene import SceneDescription

SMALL = {"xresolution": 16.0, "yresolution": 12.0}


def soft_shadow() -> SceneDescription:
    return scenes.load("soft-shadow", SMALL)


def reference(scale: float = 1.0) -> ReferenceImage:
    """A render of many samples, multiplied by `scale`, in the clothes of a reference."""
    result = render(build(soft_shadow()), estimator="solid-angle", spp=256, seed=900)
    return ReferenceImage(scale * result.image, result.variance, 256, 64, 0.0, {})


def test_the_seed_and_the_level_of_a_trial_are_used() -> None:
    """Five families share alpha: the image, the grid, the pixels and two regions."""
    built = build(soft_shadow())
    left = np.zeros((12, 16), dtype=np.bool_)
    left[:, :8] = True
    found = [
        verify(built, Trial("area", spp=16, seed=s), reference(), {"a": left, "b": ~left}) for s in (5, 6)
    ]
    assert found[0].level == pytest.approx(sidak_level(1e-3, 5))
    for seed, one in zip((5, 6), found, strict=True):
        np.testing.assert_array_equal(one.image, render(built, estimator="area", spp=16, seed=seed).image)


def test_degrees_of_freedom_are_one_less_than_what_was_drawn() -> None:
    result = render(build(soft_shadow()), estimator="area", spp=16, seed=3)
    assert of_render(result, 16).dof == 15
    assert of_reference(reference()).dof == 63


def test_no_sample_was_larger_than_the_largest_draw() -> None:
    """Here mean + variance / mean alone lies below the largest sample of the film."""
    result = render(build(soft_shadow()), estimator="area", spp=64, seed=3)
    draws = of_render(result, 64).draws
    assert draws is not None
    assert np.all(draws.largest >= result.film.maximum.max(axis=(0, 1)))


def test_estimators_of_a_matrix_have_seeds_of_their_own() -> None:
    """The i-th takes seed + i; with one seed for all, those that share directions would share their noise."""
    names = ["area", "solid-angle"]
    matrix = agreement(soft_shadow(), estimators=names, spp=16, seed=40)
    built = build(soft_shadow())
    for i, (name, member) in enumerate(zip(names, matrix.members, strict=True)):
        assert member.mean == float(render(built, estimator=name, spp=16, seed=40 + i).image.mean())


def test_a_difference_is_of_the_first_from_the_second() -> None:
    """A reference twice as bright: the estimator is half of it, -50 %, with its interval about that."""
    matrix = agreement(soft_shadow(), estimators=["solid-angle"], spp=64, reference=("twice", reference(2.0)))
    (pair,) = matrix.pairs
    assert (pair.a, pair.b, pair.agree) == ("solid-angle", "twice", False)
    assert pair.low < pair.difference < pair.high
    assert pair.difference == pytest.approx(-0.5, abs=0.02)
