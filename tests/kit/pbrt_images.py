"""pbrt-v4's own images, and when another image agrees with them: image mean, regions, and relMSE without
either's noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from scenes.description.shapes import Array
from scenes.images.exr import read_rgb
from tests.kit.mitsuba_scenes import regions

PBRT = Path(__file__).parents[3] / "shared" / "references"
SIGMA = 4.5  # two-sided 7e-6 a comparison; 4 scenes x 51 comparisons: 0.14 % of false alarms in all

# pbrt turns RGB into spectra and back. Its gray is exact; coloured light reads up to 0.1 % off the RGB
# product.
NAMES = {"rect-over-floor": 1e-3, "disk-over-floor": 1e-3, "sphere-light": 1e-3, "touching-light": 0.0}

# The sky that they show and reflect reads 0.17 % less blue in pbrt than the file says.
GLASS = {"mirror": 2e-3, "glass": 2e-3, "rough-glass": 2e-3}

NO_PBRT = pytest.mark.skipif(not PBRT.is_dir(), reason=f"pbrt's images are not at {PBRT}")


@dataclass(frozen=True, eq=False)
class Pair:
    """Two estimates of one image with the variances of their means, and the relative error that pbrt's colour
    may have.
    """

    ours: Array
    ours_variance: Array
    pbrt: Array
    pbrt_variance: Array
    colour: float

    def disagreements(self, mean: Array | None = None) -> list[str]:
        """What of `mean` (the image under test, unless another is given) is not pbrt's within the errors of
        both.
        """
        mean = self.ours if mean is None else mean
        found: list[str] = []
        for count in (1, 4):
            value, want = regions(mean, count), regions(self.pbrt, count)
            error = np.abs(value - want) - self.colour * want
            for row, column, channel in np.argwhere(error > SIGMA * self.errors(count)):
                at = (row, column, channel)
                found.append(f"region {at} of {count}^2: {value[at]:.6f} where pbrt has {want[at]:.6f}")
        if self.relmse(mean) > 1e-3:
            found.append(f"relMSE {self.relmse(mean):.2g}")
        return found

    def errors(self, count: int) -> Array:
        """Standard errors of the difference of region means."""
        pixels = self.pbrt[..., 0].size / count**2
        return np.sqrt(regions(self.ours_variance + self.pbrt_variance, count) / pixels)

    def relmse(self, mean: Array) -> float:
        """Squared error over squared radiance plus (mean radiance / 10)^2, both variances subtracted."""
        squared = (mean - self.pbrt) ** 2 - self.ours_variance - self.pbrt_variance
        return float(np.mean(squared / (self.pbrt**2 + (self.pbrt.mean() / 10) ** 2)))


def pair_with(name: str, mean: Array, variance: Array, colour: float) -> Pair:
    """An image with the variance of its mean, and pbrt's two images called `name`."""
    a, b = read_rgb(PBRT / f"{name}.a.exr"), read_rgb(PBRT / f"{name}.b.exr")
    return Pair(mean, variance, (a + b) / 2, (a - b) ** 2 / 4, colour)


def smallest_bias(pair: Pair) -> float:
    """The smallest bias of the image mean that would have been caught."""
    wanted = regions(pair.pbrt, 1)
    return float(((SIGMA * pair.errors(1) + pair.colour * wanted) / wanted).max())


def assert_wrong_images_fail(pair: Pair) -> None:
    """Mirrored, upside down, a pixel aside, half a percent off: each must disagree."""
    image = pair.ours
    assert pair.disagreements(image[:, ::-1]), "mirrored"
    assert pair.disagreements(image[::-1]), "upside down"
    assert pair.disagreements(np.roll(image, 1, axis=1)), "one pixel aside"
    assert pair.disagreements(1.005 * image), "0.5 % too bright"
    assert pair.disagreements(0.995 * image), "0.5 % too dark"
