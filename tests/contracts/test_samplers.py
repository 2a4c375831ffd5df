"""Every sampler: uniform, stateless, the same bits whatever the batch, and what it says of itself is true."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, norm

from renderer.interfaces.sampler import SAMPLERS
from renderer.samplers.stratified import permute

NAMES = SAMPLERS.names()
DIMS = 5


def grid(pixels: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    return np.repeat(np.arange(pixels), samples), np.tile(np.arange(samples), pixels)


@pytest.mark.parametrize("name", NAMES)
def test_numbers_are_uniform_in_each_dimension(name):
    """Chi-square over 64 bins with one sample a pixel; Sidak at 1 %. Catches a bias of 0.5 % in the mean."""
    pixel, sample = grid(100_000, 1)
    u = SAMPLERS[name](7, 1).uniform(pixel, sample, 0, DIMS)
    assert (u >= 0).all() and (u < 1).all()
    for row in u:
        counts = np.bincount((row * 64).astype(int), minlength=64)
        assert chi2.sf(((counts - row.size / 64) ** 2 / (row.size / 64)).sum(), 63) > 1 - 0.99 ** (
            1 / (DIMS * len(NAMES))
        )


@pytest.mark.parametrize("name", NAMES)
def test_pixels_dimensions_and_seeds_are_uncorrelated(name):
    """Products of centred numbers between neighbours; each correlation within 4.5 standard errors of 0."""
    pixel, sample = grid(200_000, 1)
    u = SAMPLERS[name](3, 1).uniform(pixel, sample, 0, DIMS) - 0.5
    other_seed = SAMPLERS[name](4, 1).uniform(pixel, sample, 0, DIMS) - 0.5
    pairs = [(u[i], u[j]) for i in range(DIMS) for j in range(i)]
    pairs += [(row[1:], row[:-1]) for row in u] + [(row[160:], row[:-160]) for row in u]
    pairs += list(zip(u, other_seed, strict=True))
    for a, b in pairs:
        assert abs((a * b).mean()) * 12 < 4.5 / np.sqrt(a.size)


@pytest.mark.parametrize("name", NAMES)
def test_bits_do_not_depend_on_the_batch(name):
    sampler = SAMPLERS[name](1, 40)
    pixel, sample = grid(13, 40)
    whole = sampler.uniform(pixel, sample, 0, DIMS)
    order = np.random.default_rng(0).permutation(pixel.size)
    assert np.array_equal(sampler.uniform(pixel[order], sample[order], 0, DIMS), whole[:, order])
    assert np.array_equal(sampler.uniform(pixel[:1], sample[:1], 0, DIMS), whole[:, :1])
    assert np.array_equal(sampler.uniform(pixel, sample, 2, 2), whole[2:4])
    assert sampler.uniform(pixel[:0], sample[:0], 0, 3).shape == (3, 0)


@pytest.mark.parametrize("name", NAMES)
def test_another_seed_gives_other_numbers(name):
    pixel, sample = grid(50, 16)
    a, b = (SAMPLERS[name](seed, 16).uniform(pixel, sample, 0, 2) for seed in (0, 1))
    assert (a != b).mean() > 0.99


@pytest.mark.parametrize("name", [n for n in NAMES if SAMPLERS[n].independent])
def test_independent_samples_are_independent_within_a_pixel(name):
    """Correlation of successive samples of a pixel, and the variance of pixel means: both as independence has
    them.
    """
    pixels, samples = 20_000, 16
    u = SAMPLERS[name](2, samples).uniform(*grid(pixels, samples), 0, 1).reshape(pixels, samples)
    neighbours = (u[:, 1:] - 0.5) * (u[:, :-1] - 0.5)
    assert abs(neighbours.mean()) * 12 < 4.5 / np.sqrt(neighbours.size)
    ratio = u.mean(axis=1).var(ddof=1) * 12 * samples
    assert abs(ratio - 1) < 4.5 * np.sqrt(2 / pixels)


@pytest.mark.parametrize("pair", [0, 1, 2, 5])
def test_sobol_prefixes_are_nets(pair):
    """Every elementary interval of each pair of dimensions holds one of the first 2^m points, in every
    pixel.
    """
    for m in (1, 2, 3, 4, 6, 8):
        pixel, sample = grid(20, 2**m)
        u = SAMPLERS["sobol"](5, 2**m).uniform(pixel, sample, 2 * pair, 2).reshape(2, 20, 2**m)
        for k in range(m + 1):
            cell = (u[0] * 2**k).astype(int) * 2 ** (m - k) + (u[1] * 2 ** (m - k)).astype(int)
            assert (np.sort(cell, axis=1) == np.arange(2**m)).all()


def test_owen_scrambling_leaves_each_stratum_uniform():
    """The mean of N scrambled coordinates has the variance 1/(12 N^3) of N free offsets: a weak hash has
    another.
    """
    pixels = 20_000
    for dim, count in ((0, 16), (1, 16), (2, 64), (3, 64)):
        u = SAMPLERS["sobol"](9, count).uniform(*grid(pixels, count), dim, 1).reshape(pixels, count)
        ratio = u.mean(axis=1).var(ddof=1) * 12 * count**3
        assert abs(ratio - 1) < 4.5 * np.sqrt(2 / pixels), f"dimension {dim}: {ratio:.3f}"


def test_pairs_of_sobol_dimensions_come_in_orders_of_their_own():
    """Between pairs, products of centred numbers vanish like those of independent ones, sample by sample."""
    u = SAMPLERS["sobol"](2, 64).uniform(*grid(3000, 64), 0, 6) - 0.5
    for i, j in ((0, 2), (0, 3), (1, 2), (1, 3), (2, 4), (3, 5)):
        assert abs((u[i] * u[j]).mean()) * 12 < 4.5 / np.sqrt(u[0].size)


@pytest.mark.parametrize("spp", [1, 2, 7, 16, 60, 256])
def test_stratified_samples_are_one_to_a_stratum(spp):
    """In y always; in x and in the grid where N = m n. Both pairs of dimensions, every pixel."""
    pixel, sample = grid(20, spp)
    u = SAMPLERS["stratified"](5, spp).uniform(pixel, sample, 0, 4).reshape(4, 20, spp)
    m = int(np.sqrt(spp))
    n = -(-spp // m)
    for x, y in ((u[0], u[1]), (u[2], u[3])):
        assert (np.sort((y * spp).astype(int), axis=1) == np.arange(spp)).all()
        if m * n == spp:
            assert (np.sort((x * spp).astype(int), axis=1) == np.arange(spp)).all()
            cell = (x * m).astype(int) * n + (y * n).astype(int)
            assert (np.sort(cell, axis=1) == np.arange(spp)).all()


def test_permutations_are_permutations():
    for length in (1, 2, 3, 17, 64, 1000):
        seed = np.repeat(np.array([1, 0xDEADBEEF, 77], dtype=np.uint32), length)
        out = permute(np.tile(np.arange(length, dtype=np.uint32), 3), length, seed).reshape(3, length)
        assert (np.sort(out, axis=1) == np.arange(length)).all()


@pytest.mark.parametrize("name", [n for n in NAMES if not SAMPLERS[n].independent])
def test_strata_beat_independence_on_a_smooth_integrand(name):
    """Mean of x y at 256 samples: the standard deviation over pixels must be far below that of independent
    samples.
    """
    spread = {}
    for each in ("independent", name):
        u = SAMPLERS[each](1, 256).uniform(*grid(500, 256), 0, 2).reshape(2, 500, 256)
        means = (u[0] * u[1]).mean(axis=1)
        spread[each] = means.std(ddof=1)
        assert abs(means.mean() - 0.25) < norm.isf(1e-6) * spread[each] / np.sqrt(500)
    # Multi-jittered: a column's offsets in y are shared, and their order against x is chance: sqrt(2) / (12
    # sqrt(16) 16).
    # A scrambled net: at most e times independence by theory, here the measured 1.35e-4 of scrambled nets of
    # 256 points.
    expected = {"sobol": 1.35e-4, "stratified": np.sqrt(2) / 768}
    assert spread[name] < expected[name] * (1 + 4.5 / np.sqrt(2 * 500))
