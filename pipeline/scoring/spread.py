"""The standard error of a mean over pixels, from one image.

Pixels are independent (box filter), but each is drawn once and no two are alike, so that the variance of the
mean of a map q cannot be had from the spread of q over the image: that spread holds the image's own
structure. It is had from the spread within blocks of four neighbours, whose expectation is the variance
sought plus the spread of four neighbouring expectations, never less: the collapsed strata of survey sampling
with one unit a stratum [cochran1977] section 5A.12. It asks for no distribution (2/3 of the sum of d^4, the
estimate for normal errors, is a third too large across a penumbra of one sample a pixel, and a third too
small for fireflies) and takes the pixel, not the channel, as the unit, so that the channels may be correlated
as they like. Being a scale, an error has its interval on the logarithmic scale, always positive. No interval
from one image helps where the errors themselves are heavy-tailed (for lognormal errors of parameter 1.5 it
covers 80 %): the samples' own verdict tells (statistics/samples.py).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.scoring.metric import Image, Mask
from pipeline.statistics.intervals import NORMAL


def standard_error(pixel: Image, mask: Mask | None = None) -> float:
    """Standard error of the mean over a mask of independent pixels, from the spread within 2 x 2 blocks.

    pixel, mask: (h, w). A block of m pixels adds m times its sample variance to the estimated sum of the
    pixels' variances; an odd row or column joins the block before it. Where a mask leaves single pixels in
    their blocks, these are paired in the order of the image; a last one without a mate stands for its own
    deviation from 0.
    """
    inside = np.ones(pixel.shape, dtype=np.bool_) if mask is None else mask
    q = np.where(inside, pixel, 0.0)
    m = _in_blocks(inside.astype(np.float64))
    total, square = _in_blocks(q), _in_blocks(q**2)
    several = m > 1
    count = np.where(several, m, 2.0)
    spread = np.where(several, np.maximum(square - total**2 / count, 0.0) * count / (count - 1), 0.0)
    return float(np.sqrt(np.sum(spread) + _lone(total[m == 1]))) / max(int(np.count_nonzero(inside)), 1)


def _lone(values: Image) -> float:
    """The estimated sum of variances of pixels that are alone in their blocks, paired. values: (n,)."""
    even = values[: values.size // 2 * 2].reshape(-1, 2)
    paired = float(np.sum((even[:, 0] - even[:, 1]) ** 2))  # twice their sample variance
    return paired + (float(values[-1] ** 2) if values.size % 2 else 0.0)


def _in_blocks(pixel: Image) -> Image:
    """Sums over blocks of 2 x 2 pixels, of 3 at the end of an odd side."""
    down = np.add.reduceat(pixel, _starts(pixel.shape[0]), axis=0)
    return np.add.reduceat(down, _starts(pixel.shape[1]), axis=1)


def _starts(side: int) -> NDArray[np.intp]:
    return np.arange(0, max(side - 1, 1), 2, dtype=np.intp)


def scale_interval(value: float, error: float) -> tuple[float, float]:
    """95 % interval of a positive scale on the logarithmic scale, by the delta method; (0, 0) for 0."""
    if value == 0.0:
        return 0.0, 0.0
    ratio = float(np.exp(min(NORMAL * error / value, 700.0)))
    return value / ratio, value * ratio
