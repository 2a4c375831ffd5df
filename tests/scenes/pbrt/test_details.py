"""Details of scene files that only an unusual scene shows: colour spaces, powers of 0, turned skies, factors,
sizes and normals of meshes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.description.lights import DistantLight, Environment, PointLight, SpotLight
from scenes.description.shapes import vertex_normals
from scenes.description.textures import ImageTexture, Product
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse_file
from scenes.ply.header import parse_header
from scenes.ply.mesh import read_ply
from tests.kit.ply_files import CORNERS, Table, ply_bytes, written
from tests.kit.scene_texts import HEAD, PATCH, world
from tests.scenes.pbrt.directives.test_textures import texture_of

# Linear P3 (D65) to linear sRGB, as published, to four digits.
P3_TO_SRGB = np.array([[1.2249, -0.2249, 0.0], [-0.0421, 1.0421, 0.0], [-0.0196, -0.0786, 1.0983]])


@pytest.mark.parametrize("rgb", [(1.0, 0.1, 0.1), (0.2, 1.0, 0.2), (0.2, 0.3, 1.0)])
def test_saturated_p3_colours_are_those_of_the_published_matrix(rgb: tuple[float, float, float]) -> None:
    """Its digits and D65's leave 7e-5; green's y wrong by 0.02 moves a component of each of these by 0.01 and
    more.
    """
    written_out = " ".join(map(str, rgb))
    (light,) = world(f'ColorSpace "dci-p3" LightSource "distant" "rgb L" [ {written_out} ]').lights
    assert isinstance(light, DistantLight)
    np.testing.assert_allclose(light.irradiance, np.maximum(P3_TO_SRGB @ np.array(rgb), 0), atol=5e-4)


@pytest.mark.parametrize("kind", ["point", "spot"])
def test_a_power_of_zero_is_none_given(kind: str) -> None:
    """As in pbrt, which asks for one above 0: the light keeps its I, and is not black."""
    (light,) = world(f'LightSource "{kind}" "rgb I" [ 3 2 1 ] "float power" 0').lights
    assert isinstance(light, PointLight | SpotLight)
    assert light.intensity.tolist() == [3, 2, 1]


def test_an_illuminance_of_zero_is_none_given() -> None:
    (sun,) = world('LightSource "distant" "rgb L" [ 3 2 1 ] "float illuminance" 0').lights
    assert isinstance(sun, DistantLight)
    assert sun.irradiance.tolist() == [3, 2, 1]
    (sky,) = world('LightSource "infinite" "rgb L" [ 3 2 1 ] "float illuminance" 0').lights
    assert isinstance(sky, Environment)
    assert sky.radiance.tolist() == [3, 2, 1]


def test_an_area_light_s_power_of_zero_is_none_given() -> None:
    (shape,) = world('AreaLightSource "diffuse" "rgb L" [ 3 2 1 ] "float power" 0 ' + PATCH).shapes
    assert shape.emission is not None
    assert shape.emission.radiance.tolist() == [3, 2, 1]


@pytest.mark.parametrize("before", ["Rotate 90 1 0 0", "Scale 1 1 -1"])
def test_hemispheres_that_look_different_ways_stay_two_lights(before: str) -> None:
    """Taken for one light, the second would shine from where the first does."""
    half = 'LightSource "infinite" "bool hemisphere" true'
    assert len(world(f"{half}\n{before} {half}").lights) == 2


def inverted(filter_: str) -> ImageTexture:
    """Numbers, of texels 0.9 and 0.1: 1 - 2 x, cut off below 0."""
    image = np.repeat([[[0.9], [0.1]]], 3, axis=2)
    return ImageTexture(image, filter=filter_, scale=2.0, invert=True, clamped=False)


def test_an_inverted_texture_of_numbers_is_not_its_texels_alone() -> None:
    """Halfway between the texels it is max(1 - 2 0.5, 0) = 0; the mean of their own values, 0 and 0.8, is
    0.4.
    """
    assert inverted("bilinear").plain() is None
    nearest = inverted("point").plain()
    assert nearest is not None
    np.testing.assert_allclose(nearest.image[0, :, 0], [0, 0.8], atol=1e-15)
    assert (nearest.scale, nearest.invert, nearest.clamped) == (1, False, False)


def test_a_colour_times_an_image_of_numbers_stays_a_colour(tmp_path: Path) -> None:
    """An image of numbers has one factor for all three components: given the colour's red, it would be
    gray.
    """
    write_exr(tmp_path / "a.exr", {name: np.array([[0.25, 0.5]]) for name in "RGB"})
    number = 'Texture "n" "float" "imagemap" "string filename" "a.exr" '
    product = texture_of(
        number + 'Texture "t" "spectrum" "scale" "rgb tex" [ .2 .4 .6 ] "texture scale" "n"', tmp_path
    )
    assert isinstance(product, Product)
    assert isinstance(product.first, np.ndarray)
    assert isinstance(product.second, ImageTexture)
    assert product.first.tolist() == [0.2, 0.4, 0.6]
    assert product.second.scale == 1


DIGITS: Table = ("vertex", ["float x", "float y", "float z"], [(i % 3, i % 2, i % 5) for i in range(30)])
FACE: Table = ("face", [CORNERS], [((0, 1, 2),)])
NOTHING: Table = ("vertex", ["char x"], [])
EMPTY: Table = ("strip", ["list uchar int parts"], [((),)] * 30)


@pytest.mark.parametrize("before", [(), (EMPTY,)])
def test_an_ascii_file_of_digits_is_read_to_its_last(tmp_path: Path, before: tuple[Table, ...]) -> None:
    """No shorter file holds as many numbers: a byte more that were asked of each row would be 30, and the
    face has but 6 to spare.
    """
    data = ply_bytes("ascii", *before, DIGITS, FACE).rstrip(b"\n")
    mesh = read_ply(written(tmp_path, data))
    assert mesh.vertices.tolist() == [list(row) for row in DIGITS[2]]
    assert mesh.triangles.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("tables", [(DIGITS,), (EMPTY,), (EMPTY, DIGITS), (NOTHING,)])
@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_the_least_size_of_the_content_is_that_of_the_shortest(
    encoding: str, tables: tuple[Table, ...]
) -> None:
    data = ply_bytes(encoding, *tables)
    data = data.rstrip(b"\n") + b"\n" * (not tables[0][2]) if encoding == "ascii" else data
    header = parse_header(data)
    assert header.least() == len(data) - header.size


def quads_with_normals(folder: Path, *normals: tuple[float, float, float]) -> Path:
    """A scene with one upright square, whose corners have these normals."""
    properties = [f"float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    rows = [(*point, *normal) for point, normal in zip(points, normals, strict=True)]
    written(folder, ply_bytes("ascii", ("vertex", properties, rows), ("face", [CORNERS], [((0, 1, 2, 3),)])))
    (folder / "s.pbrt").write_text(HEAD + 'Shape "plymesh" "string filename" "m.ply"')
    return folder / "s.pbrt"


@pytest.mark.parametrize("corner", range(4))
def test_the_normal_of_each_corner_of_a_quadrilateral_counts(tmp_path: Path, corner: int) -> None:
    """The fourth lies in the second half only."""
    normals = [(0.0, 0.0, 1.0)] * 4
    assert len(parse_file(quads_with_normals(tmp_path, *normals)).shapes) == 1
    normals[corner] = (0.0, 0.6, 0.8)
    (shape,) = parse_file(quads_with_normals(tmp_path, *normals)).shapes
    given = vertex_normals(shape.geometry)
    assert given is not None and len(given) > 4
    ring = [0, 1, 3, 2][corner]  # corners go round the face in PLY, row by row in a patch
    last = int(np.sqrt(len(given))) - 1
    at = [0, last, last * (last + 1), len(given) - 1][ring]
    np.testing.assert_allclose(given[at], normals[corner])
