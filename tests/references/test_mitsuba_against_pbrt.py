"""Mitsuba through our conversion against pbrt-v4's own images: orientation, field of view, sidedness, radiometry."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import scenes
from pipeline.references.mitsuba import MitsubaBackend
from pipeline.references.protocol import ReferenceRequest
from scenes.description import Array
from scenes.images import read_rgb
from tests.references.mitsuba_scenes import regions

PBRT = Path(__file__).parents[3] / "shared" / "references"
SIGMA = 4.5  # two-sided 7e-6 a comparison; 4 scenes x 51 comparisons: 0.14 % of false alarms in all

# pbrt turns RGB into spectra and back. Its gray is exact; coloured light reads up to 0.1 % off the RGB product.
NAMES = {"rect-over-floor": 1e-3, "disk-over-floor": 1e-3, "sphere-light": 1e-3, "touching-light": 0.0}

pytestmark = pytest.mark.skipif(not PBRT.is_dir(), reason=f"pbrt's images are not at {PBRT}")


@dataclass(frozen=True, eq=False)
class Pair:
    """Two estimates of one image with the variances of their means, and the relative error that pbrt's colour may have."""

    mitsuba: Array
    mitsuba_variance: Array
    pbrt: Array
    pbrt_variance: Array
    colour: float

    def disagreements(self, mean: Array | None = None) -> list[str]:
        """What of `mean` (Mitsuba's, unless another is given) is not pbrt's within the errors of both."""
        mean = self.mitsuba if mean is None else mean
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
        return np.sqrt(regions(self.mitsuba_variance + self.pbrt_variance, count) / pixels)

    def relmse(self, mean: Array) -> float:
        """Squared error over squared radiance plus (mean radiance / 10)^2, both variances subtracted."""
        squared = (mean - self.pbrt) ** 2 - self.mitsuba_variance - self.pbrt_variance
        return float(np.mean(squared / (self.pbrt**2 + (self.pbrt.mean() / 10) ** 2)))


def against_pbrt(path: Path, name: str, colour: float, spp: int = 1024) -> Pair:
    """The scene at `path` by Mitsuba, and pbrt's two images called `name`."""
    a, b = read_rgb(PBRT / f"{name}.a.exr"), read_rgb(PBRT / f"{name}.b.exr")
    image = MitsubaBackend().render(scenes.load(str(path)), ReferenceRequest(spp=spp))
    return Pair(image.mean, image.variance, (a + b) / 2, (a - b) ** 2 / 4, colour)


@pytest.fixture(scope="module", params=NAMES)
def pair(request: pytest.FixtureRequest) -> Pair:
    return against_pbrt(PBRT / f"{request.param}.pbrt", request.param, NAMES[request.param])


def test_mitsuba_agrees_with_pbrt(pair: Pair):
    smallest = (SIGMA * pair.errors(1) + pair.colour * regions(pair.pbrt, 1)) / regions(pair.pbrt, 1)
    print(f"smallest bias of the image mean that would have been caught: {smallest.max():.2%}")
    assert smallest.max() < 5e-3
    assert pair.disagreements() == []


def test_wrong_images_fail_the_same_test(pair: Pair):
    image = pair.mitsuba
    assert pair.disagreements(image[:, ::-1]), "mirrored"
    assert pair.disagreements(image[::-1]), "upside down"
    assert pair.disagreements(np.roll(image, 1, axis=1)), "one pixel aside"
    assert pair.disagreements(1.005 * image), "0.5 % too bright"
    assert pair.disagreements(0.995 * image), "0.5 % too dark"


def test_the_asymmetric_scene_is_pbrts(tmp_path: Path):
    """Its distant light is stood in for by a square so far away that it is as good as a direction."""
    distance, half = 1e6, 500.0
    axis = np.array([-2.0, 5.0, 3.0]) / np.sqrt(38.0)
    u = np.cross(axis, (0.0, 1.0, 0.0))
    u = half * u / np.linalg.norm(u)
    v = np.cross(u, axis)
    corners = [
        distance * axis + a * u + b * v for b in (-1, 1) for a in (-1, 1)
    ]  # normal u x v = -axis: towards the scene
    radiance = 2.0 * distance**2 / (2 * half) ** 2
    square = "\n".join(
        (
            f'AttributeBegin\nAreaLightSource "diffuse" "rgb L" [ {radiance} {radiance} {radiance} ]',
            f'Shape "bilinearmesh" "point3 P" [ {" ".join(repr(float(x)) for x in np.ravel(corners))} ]',
            ' "integer indices" [ 0 1 2 3 ]\nAttributeEnd',
        )
    )
    lines = (PBRT / "asymmetric.pbrt").read_text().splitlines()
    path = tmp_path / "asymmetric.pbrt"
    path.write_text("\n".join(square if line.startswith("LightSource") else line for line in lines))
    pair = against_pbrt(path, "asymmetric", colour=0.0)
    assert pair.disagreements() == []
    assert pair.disagreements(pair.mitsuba[:, ::-1]), "mirrored"
