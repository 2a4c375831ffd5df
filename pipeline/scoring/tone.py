"""Display encoding for the metrics that judge pictures: exposure, sRGB, clipping to [0, 1].

The exposure is a property of the reference, so that all estimates of a scene are shown alike. It puts the
median luminance of the lit pixels at 0.18, middle gray (0.46 after encoding). The median, unlike a mean, does
not depend on how bright a light in view is; unlit background does not count.
"""

from __future__ import annotations

import numpy as np

from pipeline.scoring.metric import Image, Mask, Reference

MIDDLE_GRAY = 0.18
REC709 = np.array([0.2126, 0.7152, 0.0722])  # luminance of linear sRGB, ITU-R BT.709


def luminance(image: Image) -> Image:
    """Relative luminance of linear RGB. image: (h, w, 3) -> (h, w)."""
    return np.einsum("...c,c->...", image, REC709)


def lit_luminance(reference: Image) -> Image | None:
    """The positive luminances (n,) of an image (h, w, 3); None if it is black."""
    values = luminance(reference)
    lit = values[values > 0]
    return lit if lit.size else None


def exposure(reference: Image) -> float:
    """The factor that puts the median lit luminance of the reference at 0.18; 1 for a black one."""
    lit = lit_luminance(reference)
    return 1.0 if lit is None else MIDDLE_GRAY / float(np.median(lit))


def clipped(image: Image, scale: float) -> Image:
    """Scale an image (h, w, 3) and clip it to [0, 1]; it stays linear."""
    return np.clip(image * scale, 0.0, 1.0)


def displayed(image: Image, scale: float) -> Image:
    """Scale linear RGB (h, w, 3), clip it to [0, 1] and encode it as sRGB [iec61966]."""
    linear = clipped(image, scale)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def shown_noise(reference: Reference, scale: float, mask: Mask) -> float:
    """Mean square over a mask (h, w) of the reference's standard error, as displayed.

    The larger of a shift up and a shift down counts: at the display's white a shift up is clipped away.
    """
    shown, error = displayed(reference.mean, scale), np.sqrt(reference.variance)
    shifts = (np.abs(displayed(reference.mean + way * error, scale) - shown) for way in (1.0, -1.0))
    return float(np.mean(np.maximum(*shifts)[mask] ** 2))
