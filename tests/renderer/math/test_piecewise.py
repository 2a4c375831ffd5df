"""The piecewise-constant distribution: what it picks, how often, and never a texel without weight."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import chi2

from renderer.math.piecewise import BELOW_ONE, PiecewiseConstant2D

WEIGHTS = arrays(
    np.float64,
    st.tuples(st.integers(1, 9), st.integers(1, 9)),
    elements=st.sampled_from([0.0, 1.0, 3.0, 1e-9, 1e6, 1e-300, 1e300]),
)
UNITS = st.lists(
    st.sampled_from([0.0, 2.0**-53, 0.25, 0.5, 0.75, BELOW_ONE]) | st.floats(0, BELOW_ONE),
    min_size=2,
    max_size=2,
)


def zeros(n: int) -> np.ndarray:
    return np.zeros(n, dtype=np.int64)


@given(WEIGHTS, UNITS)
def test_a_texel_without_weight_is_never_picked_and_the_place_is_inside(weights, u):
    """Catches a search that stops at the first of equal sums, or goes beyond the last: u = 0 and u = 1 -
    2^-53 are among the cases.
    """
    distribution = PiecewiseConstant2D.of([weights])
    place = distribution.sample(zeros(1), np.array(u)[:, None])
    assert 0 <= place.row[0] < weights.shape[0] and 0 <= place.column[0] < weights.shape[1]
    assert 0 <= place.x[0] < 1 and 0 <= place.y[0] < 1
    chance = distribution.probability(0, *weights.shape)
    assert distribution.empty[0] == (not weights.any())
    if weights.any():
        assert weights[place.row[0], place.column[0]] > 0
        assert chance[place.row[0], place.column[0]] > 0
    assert (chance[weights == 0] == 0).all()


@given(WEIGHTS, UNITS)
def test_sampling_inverts(weights, u):
    """Where a texel is wide in u; in a narrow one the place inside it has fewer digits than u."""
    distribution = PiecewiseConstant2D.of([weights])
    u = np.array(u)[:, None]
    np.testing.assert_allclose(
        distribution.invert(zeros(1), distribution.sample(zeros(1), u)), u, rtol=0, atol=3e-16
    )


def test_the_chance_of_a_texel_is_its_part_of_the_weight():
    """To 1e-12 of each texel over twelve orders of magnitude in one row: catches a wrong normalisation or a
    transposed table.
    """
    rng = np.random.default_rng(3)
    weights = 10.0 ** rng.uniform(-3, 3, (57, 91))
    weights[20:30] = 0
    chance = PiecewiseConstant2D.of([weights]).probability(0, 57, 91)
    np.testing.assert_allclose(chance, weights / weights.sum(), rtol=0, atol=1e-15)
    np.testing.assert_allclose(chance[weights > 1], (weights / weights.sum())[weights > 1], rtol=1e-9)
    assert chance.sum() == pytest.approx(1, abs=1e-13)


def test_texels_are_picked_in_proportion_to_their_weight():
    """Chi-square at 0.1 %, 4e5 samples in 35 texels: a texel off by 2 % is caught."""
    rng = np.random.default_rng(8)
    weights = rng.exponential(size=(5, 7))
    count = 400_000
    place = PiecewiseConstant2D.of([weights]).sample(zeros(count), rng.random((2, count)))
    observed = np.bincount(place.row * 7 + place.column, minlength=35)
    expected = (weights / weights.sum()).reshape(-1) * count
    assert chi2.sf(((observed - expected) ** 2 / expected).sum(), 34) > 1e-3
    # Inside the texels: uniform, so that the means of x and y are 1/2 within 4.5 standard errors.
    for inside in (place.x, place.y):
        assert abs(inside.mean() - 0.5) < 4.5 * np.sqrt(1 / 12 / count)


def test_strata_stay_strata():
    """A regular grid of u gives every row its share of samples within one line of the grid: nothing is
    shuffled.
    """
    rng = np.random.default_rng(4)
    weights = rng.exponential(size=(16, 16))
    side = 64
    line = (np.arange(side) + 0.5) / side
    u = np.stack([a.reshape(-1) for a in np.meshgrid(line, line)])
    rows = (
        np.bincount(PiecewiseConstant2D.of([weights]).sample(zeros(side * side), u).row, minlength=16) / side
    )
    assert np.abs(rows - weights.sum(axis=1) / weights.sum() * side).max() <= 1


def test_images_of_other_sizes_beside_it_change_no_bit():
    rng = np.random.default_rng(5)
    images = [rng.exponential(size=size) for size in ((1, 1), (33, 5), (4, 64), (3, 2))]
    images[3][:] = 0
    many = PiecewiseConstant2D.of(images)
    assert many.empty.tolist() == [False, False, False, True]
    index, u = rng.integers(0, 4, 500), rng.random((2, 500))
    together = many.sample(index, u)
    for image, weights in enumerate(images):
        rows = np.flatnonzero(index == image)
        alone = PiecewiseConstant2D.of([weights]).sample(zeros(rows.size), u[:, rows])
        for name in ("row", "column", "x", "y"):
            assert np.array_equal(getattr(together, name)[rows], getattr(alone, name))
        chance = PiecewiseConstant2D.of([weights]).probability(0, *weights.shape)
        assert np.array_equal(many.probability(image, *weights.shape), chance)


def test_a_row_stands_alone():
    rng = np.random.default_rng(6)
    distribution = PiecewiseConstant2D.of([rng.exponential(size=(31, 17))])
    u = rng.random((2, 37))
    whole = distribution.sample(zeros(37), u)
    for i in range(37):
        one = distribution.sample(zeros(1), u[:, i : i + 1])
        assert (one.row[0], one.column[0], one.x[0], one.y[0]) == (
            whole.row[i],
            whole.column[i],
            whole.x[i],
            whole.y[i],
        )
