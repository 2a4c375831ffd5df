"""Input that is degenerate: a clear error with its place, or a correct image.

The table is in docs/hard-cases.md.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from renderer.render import render
from scenes import load
from scenes.description.shapes import ShapeDescription, TriangleMesh
from scenes.errors import PenumbraError
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse
from tests.kit.scenes import GRAY, floor, patch, scene

HEAD = (
    'LookAt 0 3 5  0 0 0  0 1 0\nCamera "perspective"\nFilm "rgb" "integer xresolution" 16 "integer '
    'yresolution" 12\nWorldBegin\n'
)
LIT = 'LightSource "distant" "point3 from" [0 5 0]\n'
GLOW = 'AreaLightSource "diffuse" "rgb L" [1 1 1]\n'
POINTS = '"point3 P" [0 0 0  1 0 0  {}] "integer indices" [0 1 2]'

REFUSED = {
    "a face without area that emits": (
        GLOW + f'Shape "trianglemesh" {POINTS.format("2 0 0")}',
        r":6:1: .*no area",
    ),
    "a disk without radius": (GLOW + 'Shape "disk" "float radius" 0', r":6:\d+: the radius must be positive"),
    "a sphere without radius": (
        GLOW + 'Shape "sphere" "float radius" -1',
        r":6:\d+: the radius must be positive",
    ),
    "a rectangle without area": (
        GLOW + 'Shape "bilinearmesh" "point3 P" [0 0 0  1 0 0  0 0 0  1 0 0]',
        r":6:1: .*no area",
    ),
    "negative radiance": (
        'AreaLightSource "diffuse" "rgb L" [1 -1 1]\nShape "sphere"',
        r":5:\d+: .*negative",
    ),
    "NaN in a mesh": (LIT + f'Shape "trianglemesh" {POINTS.format("nan 0 1")}', r":6:\d+: "),
    "an infinite vertex": (LIT + f'Shape "trianglemesh" {POINTS.format("1e999 0 1")}', r":6:\d+: "),
    "an infinite radiance": ('LightSource "infinite" "rgb L" [inf 1 1]\nShape "sphere"', r":5:\d+: "),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused_with_its_place(case):
    text, message = REFUSED[case]
    with pytest.raises(PenumbraError, match=message) as caught:
        render(parse(HEAD + text, file="scene.pbrt"), spp=1)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_map_that_is_no_light_is_refused(value, tmp_path: Path):
    image = np.ones((8, 8), dtype=np.float32)
    image[3, 4] = value
    write_exr(tmp_path / "map.exr", {"R": image, "G": image, "B": image}, {})
    (tmp_path / "scene.pbrt").write_text(
        HEAD + 'LightSource "infinite" "string filename" "map.exr"\nShape "sphere"'
    )
    with pytest.raises(PenumbraError, match=r"map\.exr|texel|environment"):
        render(load(str(tmp_path / "scene.pbrt")), spp=1)


def test_negative_texels_of_a_map_are_black_as_pbrts_are(tmp_path: Path):
    image = np.full((8, 8), -1.0, dtype=np.float32)
    write_exr(tmp_path / "map.exr", {"R": image, "G": image, "B": image}, {})
    (tmp_path / "scene.pbrt").write_text(
        HEAD + 'LightSource "infinite" "string filename" "map.exr"\nShape "sphere"'
    )
    result = render(load(str(tmp_path / "scene.pbrt")), spp=4)
    assert not result.image.any() and result.nonfinite == 0


def test_faces_without_area_needles_and_duplicates_are_harmless_where_they_do_not_emit():
    """Beside a good floor: the image of the floor alone, but where the needles themselves are seen."""
    lamp = patch([-0.5, 2.0, -0.5], [1, 0, 0], [0, 0, 1], [3.0, 2, 1])
    truth = render(scene([floor(), lamp]), estimator="solid-angle", spp=8)
    far = [50.0, -1.0, 50.0]
    points = np.array([[0.0, 0, 0], [0, 0, 0], [1e-3, 0, 0], far, far, [51.0, -1, 50]])
    odd = ShapeDescription(TriangleMesh(points, np.array([[0, 0, 1], [0, 1, 2], [3, 4, 5], [3, 3, 3]])), GRAY)
    image = render(scene([floor(), lamp, odd]), estimator="solid-angle", spp=8)
    assert image.nonfinite == 0
    np.testing.assert_allclose(image.image, truth.image, rtol=1e-5, atol=1e-9)
    needle = ShapeDescription(
        TriangleMesh(np.array([[-1.0, 0.5, 0], [1, 0.5, 0], [1, 0.5 + 1e-9, 0]]), np.array([[0, 1, 2]])), GRAY
    )
    image = render(scene([floor(), lamp, needle]), estimator="solid-angle", spp=8)
    assert image.nonfinite == 0 and np.abs(image.image - truth.image).max() < 0.3 * truth.image.max()


def test_duplicated_vertices_change_nothing():
    lamp = patch([-0.5, 2.0, -0.5], [1, 0, 0], [0, 0, 1], [3.0, 2, 1])
    whole = floor()
    split = TriangleMesh(
        whole.geometry.vertices[whole.geometry.faces].reshape(-1, 3), np.arange(6).reshape(2, 3)
    )
    a, b = (
        render(scene([s, lamp]), estimator="mis", spp=8).image
        for s in (whole, ShapeDescription(split, whole.material))
    )
    np.testing.assert_array_equal(a, b)
