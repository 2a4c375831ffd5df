"""Where a metric says that the reference hides the error, to a hundredth of the limit; and how far SMAPE
moves with its reference.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from pipeline.scoring.metric import METRICS, Estimate, Image, Reference

SHAPE = (8, 8, 3)
FLOOR = 0.01  # SMAPE's
LIMIT = 0.1  # of the measured error: the most that the reference's noise may be


def constant(value: float) -> Image:
    return np.full(SHAPE, value)


def halves(dark: float, bright: float) -> Image:
    """(8, 8, 3): the left half one value, the right half another; no block of 2 x 2 holds both."""
    image = constant(dark)
    image[:, 4:] = bright
    return image


def smape(a: float, r: float) -> float:
    """By its definition."""
    return abs(a - r) / (abs(a) + abs(r) + FLOOR)


@pytest.mark.parametrize("a", [0.0, 1e-3, 0.3, 0.49, 0.5, 0.51, 1.0, 40.0])
def test_smape_moves_with_its_reference_by_no_more_than_its_interval_says(a: float) -> None:
    """|s(r') - s(r)| is within what the interval's upper end is moved by, for all r' within b of r, far below
    0 as well.

    Every pixel is the same, so that this end is the score and nothing but that. With a slope of 1 in the
    place of 2, a = 1 against r = b = 0.5 is told to move by 0.50 at most, and moves by 0.66.
    """
    for r, share in itertools.product((0.0, 0.01, 0.1, 0.5, 3.0), (0.1, 0.5, 0.99, 1.0, 2.0)):
        b = max(r, 0.01) * share
        found = METRICS["smape"](Estimate(constant(a)), Reference(constant(r), constant(b**2), 0))
        assert found.score.high is not None
        slack = found.score.high - smape(a, r)
        moved = max(abs(smape(a, r + b * t) - smape(a, r)) for t in np.linspace(-1.0, 1.0, 201))
        assert moved <= slack * (1 + 1e-9) + 1e-12, (a, r, b)


@pytest.mark.parametrize("batches", [0, 64])
@pytest.mark.parametrize("noisy", ["dark", "bright"])
@pytest.mark.parametrize("above", [False, True])
def test_smape_weighs_the_reference_s_noise_as_it_weighs_the_error(
    batches: int, noisy: str, above: bool
) -> None:
    """A dark half and a bright one err by the same share and count the same, so that noise in either half
    alone, whichever it is,
    hides the error at the same limit. Weighed by the weight and not its square, the dark half would count 667
    times less.
    """
    r = halves(0.01, 10.0)
    d = (2 * r + FLOOR) / 9  # |d| / (2 r + d + 0.01) = 1/10 everywhere
    here = halves(2.0, 0.0) if noisy == "dark" else halves(0.0, 2.0)
    limit = (
        LIMIT if batches == 0 else LIMIT / (1 + LIMIT)
    )  # of d^2, from which a sampled variance is subtracted
    share = (1.05 if above else 0.95) * limit
    found = METRICS["smape"](Estimate(r + d), Reference(r, share * d**2 * here, batches)).score
    assert found.bound is above


@pytest.mark.parametrize("name", ["mse", "relmse", "relmse-imgtool"])
@pytest.mark.parametrize("batches", [0, 64])
@pytest.mark.parametrize("share", [0.02, 0.099, 0.101, 0.15, 0.19, 0.5])
def test_an_error_is_a_bound_from_a_tenth_of_noise_on(name: str, batches: int, share: float) -> None:
    """Noise of this share of the measured error, from which a sampled variance is subtracted first."""
    squared = 0.04 if batches == 0 else 0.04 * (1 + share)  # the error itself is 0.04
    reference = Reference(constant(0.5), constant(0.04 * share), batches)
    found = METRICS[name](Estimate(constant(0.5 + squared**0.5)), reference).score
    assert found.bound is (share > LIMIT)
