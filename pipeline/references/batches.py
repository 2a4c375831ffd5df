"""Drawing batches until a request is met: the part that every sampling backend shares."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.references.accumulator import Tally, empty_tally, precision
from pipeline.references.protocol import Continuation, Progress, ReferenceImage, ReferenceRequest
from scenes.description.scene import Film
from scenes.errors import PenumbraError

Image = NDArray[np.float64]

GROWTH = 16.0  # times as many samples at once, at most: what the first batches foretell is itself noisy
MARGIN = 1.05  # asked for beyond what is foretold, so that the next round is seldom needed
ROUND = 64  # batches a round


@dataclass(frozen=True)
class Batches:
    """`count` batches to be drawn, of `spp` samples a pixel each, the first of them number `first` of its
    series.
    """

    first: int
    count: int
    spp: int


# One image (h, w, 3) float64 for each batch, in order, each a function of the batch's number and size and of
# nothing else that changes.
Draw = Callable[[Batches], Generator[Image]]


def accumulate(
    draw: Draw,
    film: Film,
    request: ReferenceRequest,
    most: int,
    continuation: Continuation | None = None,
    progress: Progress | None = None,
) -> Tally:
    """Draw batches of at most `most` samples a pixel until `request` is met, going on from where
    `continuation` starts.

    PenumbraError for fewer than 2 batches, and where a batch has a non-finite value.
    """
    if request.batches < 2:
        raise PenumbraError(
            "a sampled reference needs at least 2 batches: its variance comes from their spread"
        )
    continuation = continuation or Continuation()
    tally = continuation.start or empty_tally(film.height, film.width)
    shown = 0.0
    while wanted := missing(tally, request, most):
        goal = tally.spp + wanted.count * wanted.spp
        start = time.perf_counter()
        with closing(draw(wanted)) as images:
            for image in images:
                _require_finite(image)
                now = time.perf_counter()
                tally, start = tally.add(image, wanted.spp, now - start), now
                continuation.keep(tally)
                shown = max(shown, tally.spp / goal)
                if progress:
                    progress(shown if request.target is None else min(shown, 0.99))
        if tally.spp != goal:
            raise PenumbraError(
                f"{goal - tally.spp} samples a pixel of a reference were asked for and not drawn"
            )
    if progress and request.target is not None:
        progress(1.0)
    return tally


def missing(tally: Tally, request: ReferenceRequest, most: int) -> Batches | None:
    """The next batches to draw, or None where the request is met.

    Their size follows from the request alone where it names the samples, so that a reference that was
    interrupted comes out as if it had not been, to the last bit.
    """
    spp = max(1, min(most, -(-request.spp // request.batches)))
    count = max(request.batches - tally.batches, -((tally.spp - request.spp) // spp))
    if count > 0:
        return Batches(tally.batches, count, spp)
    if request.target is None:
        return None
    excess = precision(tally.mean, tally.variance).excess(request.target)
    if excess <= 1:
        return None
    extra = int(np.ceil(tally.spp * (min(excess**2 * MARGIN, GROWTH) - 1)))
    spp = max(1, min(most, -(-extra // ROUND)))
    return Batches(tally.batches, -(-extra // spp), spp)


def met(image: ReferenceImage, request: ReferenceRequest) -> bool:
    """Whether a reference that is there already is all that is asked for; one without samples always is."""
    tally = Tally(image.mean, image.variance, image.spp, image.batches)
    if image.batches == 0 or tally.batches < request.batches or tally.spp < request.spp:
        return image.batches == 0
    return request.target is None or precision(image.mean, image.variance).excess(request.target) <= 1


def to_image(tally: Tally, provenance: dict[str, str]) -> ReferenceImage:
    """The reference that a tally makes."""
    return ReferenceImage(tally.mean, tally.variance, tally.spp, tally.batches, tally.seconds, provenance)


def to_tally(image: ReferenceImage) -> Tally:
    """The tally behind a reference, to be gone on with; exact to rounding."""
    m2 = image.variance * (image.spp * (image.batches - 1))
    return Tally(image.mean, m2, image.spp, image.batches, image.seconds)


def _require_finite(image: Image) -> None:
    broken = int(np.count_nonzero(~np.isfinite(image)))
    if broken:
        raise PenumbraError(f"a batch has {broken} non-finite values: no reference can be made of it")
