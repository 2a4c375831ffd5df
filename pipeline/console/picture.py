"""The PNG that a command writes, with advice on its exposure."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from pipeline.console.console import Console
from renderer.math.vectors import Floats
from scenes.images.exr import write_png

LIGHT, DARK = 1.0, 0.05  # linear: beyond white, and below a quarter of what sRGB shows


def write_picture(target: Path, rgb: Floats, exposure: float, console: Console) -> None:
    """Write `rgb` (h, w, 3), `exposure` stops brighter, as a PNG.

    A note names a better exposure if more than a tenth of the pixels is clipped, or if all but a hundredth
    are nearly black. A light in view or a small bright spot does not count.
    """
    write_png(target, rgb, exposure)
    brightest = np.nan_to_num(rgb.max(axis=-1), posinf=np.finfo(float).max) * 2.0**exposure
    bright, top = np.quantile(brightest, [0.9, 0.99])
    if bright > LIGHT or 0 < top < DARK:
        stops = exposure + math.floor(-math.log2(bright if bright > LIGHT else top))
        state = "clipped to white" if bright > LIGHT else "nearly black"
        console.note(f"{target}: the picture is {state}; --exposure {stops:g} shows it better")
