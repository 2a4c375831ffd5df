"""Mitsuba through our conversion against pbrt-v4's own images: orientation, field of view, sidedness, radiometry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scenes
from pipeline.references.mitsuba import MitsubaBackend
from pipeline.references.protocol import ReferenceRequest
from tests.references.pbrt_images import (
    NAMES,
    NO_PBRT,
    PBRT,
    Pair,
    assert_wrong_images_fail,
    pair_with,
    smallest_bias,
)

pytestmark = NO_PBRT


def against_pbrt(path: Path, name: str, colour: float, spp: int = 1024) -> Pair:
    """The scene at `path` by Mitsuba, and pbrt's two images called `name`."""
    image = MitsubaBackend().render(scenes.load(str(path)), ReferenceRequest(spp=spp))
    return pair_with(name, image.mean, image.variance, colour)


@pytest.fixture(scope="module", params=NAMES)
def pair(request: pytest.FixtureRequest) -> Pair:
    return against_pbrt(PBRT / f"{request.param}.pbrt", request.param, NAMES[request.param])


def test_mitsuba_agrees_with_pbrt(pair: Pair):
    print(f"smallest bias of the image mean that would have been caught: {smallest_bias(pair):.2%}")
    assert smallest_bias(pair) < 5e-3
    assert pair.disagreements() == []


def test_wrong_images_fail_the_same_test(pair: Pair):
    assert_wrong_images_fail(pair)


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
    assert pair.disagreements(pair.ours[:, ::-1]), "mirrored"
