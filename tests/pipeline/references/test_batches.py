"""Batches: merged without bias whatever their sizes, drawn until a request is met, the same however often
interrupted.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np
import pytest

from pipeline.references.accumulator import Accumulator, Precision, empty_accumulator, precision
from pipeline.references.batches import Batches, accumulate, met, missing, to_accumulator, to_image
from pipeline.references.protocol import Continuation, Image, ReferenceRequest
from scenes.description.scene import Film
from scenes.errors import PenumbraError

FILM = Film(6, 4)
SHAPE = (4, 6, 3)


def draw(wanted: Batches) -> Generator[Image]:
    """Normal noise about 2, of standard deviation 1 a sample."""
    for number in range(wanted.first, wanted.first + wanted.count):
        yield 2 + np.random.default_rng(number).normal(size=SHAPE) / np.sqrt(wanted.spp)


def accumulated(images: list[Image], sizes: list[int]) -> Accumulator:
    accumulator = empty_accumulator(4, 6)
    for image, spp in zip(images, sizes, strict=True):
        accumulator = accumulator.add(image, spp, 0.5)
    return accumulator


def test_equal_batches_are_accumulated_as_numpy_would():
    """Against the two-pass formula, with a mean 1e4 times the spread: float32 or sums of squares would lose
    it.
    """
    images = 1e4 + np.random.default_rng(2).normal(size=(24, *SHAPE))
    accumulator = accumulated(list(images), [5] * 24)
    np.testing.assert_allclose(accumulator.mean, images.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(accumulator.variance, images.var(axis=0, ddof=1) / 24, rtol=1e-8)
    assert (accumulator.spp, accumulator.batches, accumulator.seconds) == (120, 24, 12.0)


def test_the_variance_is_unbiased_for_batches_of_any_sizes():
    """4,000 x 72 tallies of sizes 1, 1, 2, 30 of samples with variance 1: mean and reported variance are
    1/34.

    The average of the reported variances is then known to 0.15 %: 1 % of bias, such as a batch count without
    its -1, would fail.
    """
    rng, sizes = np.random.default_rng(7), [1, 1, 2, 30]
    said, errors = [], []
    for _ in range(4000):
        accumulator = accumulated([2 + rng.normal(size=SHAPE) / np.sqrt(spp) for spp in sizes], sizes)
        said.append(accumulator.variance.mean())
        errors.append(((accumulator.mean - 2) ** 2).mean())
    assert np.mean(said) == pytest.approx(1 / 34, rel=0.01)
    assert np.mean(errors) == pytest.approx(1 / 34, rel=0.01)


def test_one_batch_knows_no_variance():
    assert np.isinf(accumulated([np.ones(SHAPE)], [4]).variance).all()


@pytest.mark.parametrize(
    ("spp", "batches", "most"), [(4096, 64, 10_000), (64, 64, 4), (100, 7, 10), (10**6, 64, 99)]
)
def test_a_request_is_met_and_not_by_far(spp: int, batches: int, most: int):
    accumulator, request = empty_accumulator(1, 1), ReferenceRequest(spp, batches)
    while wanted := missing(accumulator, request, most):
        assert wanted.first == accumulator.batches and 1 <= wanted.spp <= most
        spp_now, batches_now = accumulator.spp + wanted.count * wanted.spp, accumulator.batches + wanted.count
        accumulator = replace(accumulator, spp=spp_now, batches=batches_now)
    assert (
        accumulator.batches >= batches
        and spp <= accumulator.spp < spp + max(batches, wanted.spp if wanted else 0) + most
    )


class _Stop(Exception):
    pass


def test_an_interrupted_reference_comes_out_as_if_it_had_not_been():
    """To the last bit, wherever it is cut; 1000 is not a multiple of the 64 batches."""
    request = ReferenceRequest(1000, 64)
    whole = accumulate(draw, FILM, request, 10_000)
    for cut in (1, 2, 63):
        kept: list[Accumulator] = []

        def stop(accumulator: Accumulator, kept: list[Accumulator] = kept, cut: int = cut) -> None:
            kept.append(accumulator)
            if len(kept) == cut:
                raise _Stop

        with pytest.raises(_Stop):
            accumulate(draw, FILM, request, 10_000, Continuation(None, stop))
        again = accumulate(draw, FILM, request, 10_000, Continuation(kept[-1]))
        np.testing.assert_array_equal(again.mean, whole.mean)
        np.testing.assert_array_equal(again.variance, whole.variance)
        assert (again.spp, again.batches) == (whole.spp, whole.batches) == (1024, 64)


def test_more_later_adds_batches_and_never_draws_one_twice():
    numbers: list[int] = []

    def counted(wanted: Batches) -> Generator[Image]:
        numbers.extend(range(wanted.first, wanted.first + wanted.count))
        yield from draw(wanted)

    first = to_image(accumulate(counted, FILM, ReferenceRequest(640, 64), 10_000), {})
    assert met(first, ReferenceRequest(640, 64)) and not met(first, ReferenceRequest(6400, 64))
    more = accumulate(counted, FILM, ReferenceRequest(6400, 64), 10_000, Continuation(to_accumulator(first)))
    assert numbers == list(range(more.batches)) and 6400 <= more.spp <= 6500
    assert more.variance.mean() == pytest.approx(1 / more.spp, rel=0.2)
    assert accumulate(counted, FILM, ReferenceRequest(64, 64), 9, Continuation(more)) is more


def test_a_target_is_reached_and_not_overshot_by_much():
    """The standard error of a sample is half the mean of 2: a target of 1 % takes 2,500 samples."""
    shares: list[float] = []
    accumulator = accumulate(draw, FILM, ReferenceRequest(128, 64, target=0.01), 10_000, None, shares.append)
    assert precision(accumulator.mean, accumulator.variance).excess(0.01) <= 1
    assert 1800 < accumulator.spp < 4500
    assert shares == sorted(shares) and shares[-1] == 1.0


def test_the_target_holds_for_the_median_and_tenfold_for_the_99th_percentile():
    assert Precision(0.5, 4.0).excess(1.0) == 0.5
    assert Precision(0.5, 20.0).excess(1.0) == 2.0
    assert Precision(3.0, 4.0).excess(1.0) == 3.0


def test_precision_is_relative_to_a_pixel_and_to_the_image_where_it_is_dark():
    mean, variance = np.full((10, 10, 3), 4.0), np.full((10, 10, 3), 0.16)
    mean[0], variance[0] = 0.0, 0.0  # an umbra: exact
    mean[1], variance[1] = 1e-9, 1e-6  # its rim: 1e-3 against a tenth of 3.2
    found = precision(mean, variance)
    assert found.median == pytest.approx(0.1)
    assert found.p99 == pytest.approx(0.1)
    assert precision(mean, np.where(mean == 4, variance, 1.0)).p99 == pytest.approx(1 / 0.32)
    assert precision(np.zeros(SHAPE), np.zeros(SHAPE)) == Precision(0.0, 0.0)
    assert precision(np.zeros(SHAPE), np.ones(SHAPE)).median == np.inf


def test_what_cannot_be_accumulated_is_an_error():
    with pytest.raises(PenumbraError, match="at least 2 batches"):
        accumulate(draw, FILM, ReferenceRequest(16, 1), 9)

    def broken(wanted: Batches) -> Generator[Image]:
        yield np.full(SHAPE, np.nan)

    with pytest.raises(PenumbraError, match="72 non-finite values"):
        accumulate(broken, FILM, ReferenceRequest(16, 2), 9)

    def short(wanted: Batches) -> Generator[Image]:
        yield np.ones(SHAPE)

    with pytest.raises(PenumbraError, match="not drawn"):
        accumulate(short, FILM, ReferenceRequest(16, 2), 9)
