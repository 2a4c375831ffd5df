"""Draw batches of samples until a request is met; all sampling backends do it by this module."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.references.accumulator import Accumulator, empty_accumulator, precision
from pipeline.references.protocol import Continuation, Progress, ReferenceImage, ReferenceRequest
from scenes.description.scene import Film
from scenes.errors import PenumbraError

Image = NDArray[np.float64]

GROWTH = 16.0  # times as many samples at once, at most: a forecast from the first batches is noisy
MARGIN = 1.05  # factor on the forecast, so that a further round is seldom needed
ROUND = 64  # batches a round


@dataclass(frozen=True)
class Batches:
    """Batches number `first` to `first + count - 1` of a series, of `spp` samples a pixel each."""

    first: int
    count: int
    spp: int


# One image (h, w, 3) float64 for each batch, in order, a function of the batch's number and size alone.
Draw = Callable[[Batches], Generator[Image]]


def accumulate(
    draw: Draw,
    film: Film,
    request: ReferenceRequest,
    most: int,
    continuation: Continuation | None = None,
    progress: Progress | None = None,
) -> Accumulator:
    """Draw batches of at most `most` samples a pixel until `request` is met, beginning with `continuation`.

    PenumbraError for fewer than 2 batches, and for a batch with a non-finite value.
    """
    if request.batches < 2:
        raise PenumbraError(
            "a sampled reference needs at least 2 batches: its variance comes from their spread"
        )
    continuation = continuation or Continuation()
    accumulator = continuation.start or empty_accumulator(film.height, film.width)
    shown = 0.0
    while wanted := missing(accumulator, request, most):
        goal = accumulator.spp + wanted.count * wanted.spp
        start = time.perf_counter()
        with closing(draw(wanted)) as images:
            for image in images:
                _require_finite(image)
                now = time.perf_counter()
                accumulator, start = accumulator.add(image, wanted.spp, now - start), now
                continuation.keep(accumulator)
                shown = max(shown, accumulator.spp / goal)
                if progress:
                    progress(shown if request.target is None else min(shown, 0.99))
        if accumulator.spp != goal:
            raise PenumbraError(
                f"{goal - accumulator.spp} samples a pixel of a reference were asked for and not drawn"
            )
    if progress and request.target is not None:
        progress(1.0)
    return accumulator


def missing(accumulator: Accumulator, request: ReferenceRequest, most: int) -> Batches | None:
    """The next batches to draw; None once the request is met.

    Without a target their size follows from the request alone, so that an interrupted reference equals an
    uninterrupted one to the last bit.
    """
    spp = max(1, min(most, -(-request.spp // request.batches)))
    count = max(request.batches - accumulator.batches, -((accumulator.spp - request.spp) // spp))
    if count > 0:
        return Batches(accumulator.batches, count, spp)
    if request.target is None:
        return None
    excess = precision(accumulator.mean, accumulator.variance).excess(request.target)
    if excess <= 1:
        return None
    extra = int(np.ceil(accumulator.spp * (min(excess**2 * MARGIN, GROWTH) - 1)))
    spp = max(1, min(most, -(-extra // ROUND)))
    return Batches(accumulator.batches, -(-extra // spp), spp)


def met(image: ReferenceImage, request: ReferenceRequest) -> bool:
    """True if a reference fulfils the request, as a deterministic one always does."""
    if image.batches == 0:
        return True
    if image.batches < request.batches or image.spp < request.spp:
        return False
    return request.target is None or precision(image.mean, image.variance).excess(request.target) <= 1


def to_image(accumulator: Accumulator, provenance: dict[str, str]) -> ReferenceImage:
    """The reference image of the batches in an accumulator."""
    return ReferenceImage(
        accumulator.mean,
        accumulator.variance,
        accumulator.spp,
        accumulator.batches,
        accumulator.seconds,
        provenance,
    )


def to_accumulator(image: ReferenceImage) -> Accumulator:
    """The accumulator behind a reference, to rounding, so that batches can be added to it."""
    m2 = image.variance * (image.spp * (image.batches - 1))
    return Accumulator(image.mean, m2, image.spp, image.batches, image.seconds)


def _require_finite(image: Image) -> None:
    broken = int(np.count_nonzero(~np.isfinite(image)))
    if broken:
        raise PenumbraError(f"a batch has {broken} non-finite values: no reference can be made of it")
