"""The HDR flip viewer: linear images in a script file beside the page, shown by a bundled flip book.

The flip book needs no server. It has exposure, false colour, zoom, pan, a pixel magnifier and number keys.
Its Python wrapper packs RGBE, which holds neither NaN nor infinity nor negative values. A report about
numerical trouble must show those, so that this module passes half or single floats to the same script.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The script reads halves below 6e-5 as 0, so that only images whose peak lies in this range are halves.
HALF_LEAST, HALF_MOST = 0.1, 65504.0
# Each image of a flip book takes a WebGL context, and a browser keeps 16: a book starts when it comes near.
START = """{
  const book = DATA;
  const place = document.getElementById(book.containerId);
  const watch = new IntersectionObserver((seen) => {
    if (seen.some((entry) => entry.isIntersecting)) { watch.disconnect(); flipbook.MakeFlipBook(book); }
  }, { rootMargin: "400px" });
  watch.observe(place);
}
"""
MAX_IMAGES = 10  # the flip book's number keys: 1 to 9, then 0


@dataclass(frozen=True, eq=False)
class Picture:
    """One page of a flip book.

    pixels: (h, w, 3) linear radiance, or an (h, w) map in false colour from 0 to `limit`.
    """

    name: str
    pixels: Array
    limit: float | None = None


def flipbook_source() -> str:
    """The flip book's JavaScript, as simpleimageio ships it (MIT licence; see NOTICE)."""
    return files("reports").joinpath("bundled", "flipbook.js").read_text(encoding="utf-8")


def flip_script(container: str, pictures: Sequence[Picture], exposure: float = 0.0) -> str:
    """A script that fills the element `container` with a flip book of `pictures`, `exposure` stops brighter.

    Raises ValueError without pictures, for more than the number keys reach, and for different sizes.
    """
    if not 0 < len(pictures) <= MAX_IMAGES:
        raise ValueError(f"a flip book takes 1 to {MAX_IMAGES} pictures, not {len(pictures)}")
    if len({picture.pixels.shape[:2] for picture in pictures}) != 1:
        raise ValueError("pictures of one flip book must have one size")
    return START.replace("DATA", json.dumps(_data(container, pictures, exposure)))


def _data(container: str, pictures: Sequence[Picture], exposure: float) -> dict[str, Any]:
    height, width = pictures[0].pixels.shape[:2]
    encoded = [_encode(picture.pixels) for picture in pictures]
    return {
        "containerId": container,
        "names": [picture.name for picture in pictures],
        "types": [kind for kind, _ in encoded],
        "dataUrls": [f"data:;base64,{base64.b64encode(raw).decode('ascii')}" for _, raw in encoded],
        "width": width,
        "height": height,
        "initialZoom": -1,  # the flip book's name for: fit
        "initialTMO": {"activeTMO": "exposure", "exposure": exposure},
        "initialTMOOverrides": [_tone(picture) for picture in pictures],
        "colorTheme": "light",
    }


def _tone(picture: Picture) -> dict[str, Any] | None:
    if picture.limit is None:
        return None
    return {"activeTMO": "falsecolor", "min": 0, "max": float(f"{picture.limit:.2g}"), "useLog": False}


def _encode(pixels: Array) -> tuple[str, bytes]:
    """Half floats where they hold all that is visible of a colour image, else single floats."""
    peak = float(np.max(np.abs(pixels), where=np.isfinite(pixels), initial=0.0))
    if pixels.ndim == 3 and HALF_LEAST <= peak <= HALF_MOST:
        return "half", pixels.astype("<f2").tobytes()
    return "single", pixels.astype("<f4").tobytes()
