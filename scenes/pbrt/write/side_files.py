"""Image files beside pbrt-v4 text."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.pbrt.write.text import quoted

Array = NDArray[np.float64]


class SideFiles:
    """The images (h, w, 3) that a text names, by file name; one that is used twice is written once.

    rounded: whether float32 changes any. uneven: whether a texture has a side that is no power of two.
    """

    def __init__(self, stem: str) -> None:
        self._stem = stem
        self._names: dict[int, str] = {}
        self.images: dict[str, Array] = {}
        self.rounded = self.uneven = False

    def add(self, image: Array) -> str:
        """The quoted name of the file that will hold `image`."""
        if id(image) not in self._names:
            name = f"{self._stem}-{len(self.images) + 1}.exr"
            self._names[id(image)], self.images[name] = name, image
            with np.errstate(over="ignore"):
                self.rounded |= not np.array_equal(image.astype(np.float32).astype(np.float64), image)
        return quoted(self._names[id(image)])


def scaled_image(image: Array, radiance: Array, files: SideFiles) -> tuple[str, str]:
    """The file and ` "float scale"` of an image that is multiplied by `radiance` (3,); pbrt scales by a
    number only, and a colour goes into the image.
    """
    if np.all(radiance == radiance[0]):
        return files.add(image), f' "float scale" [ {float(radiance[0])!r} ]'
    return files.add(image * radiance), ""
