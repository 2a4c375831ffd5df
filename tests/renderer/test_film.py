"""The film: the same numbers as NumPy's on all samples at once, however they come in."""

from __future__ import annotations

import numpy as np

from renderer.film import BLOCK, Film, PixelSums, keep_largest, luminance


def test_blocks_merge_to_the_moments_of_all_samples():
    rng = np.random.default_rng(0)
    radiance = (
        rng.lognormal(size=(3, 100, 7)) + 1e6
    )  # a large mean: a naive sum of squares would lose every digit
    reflected = radiance * 0.5
    sums = PixelSums(7)
    for first in range(0, 100, BLOCK):
        sums.add(radiance[:, first : first + BLOCK], reflected[:, first : first + BLOCK])
    assert sums.count == 100
    np.testing.assert_allclose(sums.mean, radiance.mean(axis=1), rtol=1e-15)
    np.testing.assert_allclose(sums.m2 / 99, radiance.var(axis=1, ddof=1), rtol=1e-6)
    assert np.array_equal(sums.maximum, reflected.max(axis=1))
    np.testing.assert_allclose(sums.reflected, luminance(reflected).sum(axis=0), rtol=1e-14)


def test_a_pixel_has_the_same_bits_alone_and_among_others():
    rng = np.random.default_rng(1)
    radiance = rng.lognormal(size=(3, BLOCK, 33))
    whole = PixelSums(33)
    whole.add(radiance, radiance)
    for i in range(33):
        one = PixelSums(1)
        part = np.ascontiguousarray(radiance[:, :, i : i + 1])
        one.add(part, part)
        for name in ("mean", "m2", "maximum", "reflected"):
            assert np.array_equal(getattr(one, name)[..., 0], getattr(whole, name)[..., i])


def test_the_largest_do_not_depend_on_how_they_were_cut():
    values = np.random.default_rng(2).pareto(1.0, 10_000)
    pieces = [keep_largest(part, 50) for part in np.array_split(values, 7)]
    assert np.array_equal(keep_largest(np.concatenate(pieces), 50), np.sort(values)[::-1][:50])


def test_the_variance_is_that_of_the_mean():
    samples = np.random.default_rng(3).lognormal(size=(3, 40, 5))
    sums = PixelSums(5)
    for first in range(0, 40, BLOCK):
        part = np.ascontiguousarray(samples[:, first : first + BLOCK])
        sums.add(part, part)
    film = Film(np.full((1, 5), 40), sums.mean.T[None], sums.m2.T[None], sums.maximum.T[None])
    np.testing.assert_allclose(film.variance_of_mean()[0].T, samples.var(axis=1, ddof=1) / 40, rtol=1e-12)
    single = Film(np.full((1, 1), 1), np.ones((1, 1, 3)), np.zeros((1, 1, 3)), np.ones((1, 1, 3)))
    assert np.isnan(single.variance_of_mean()).all()
