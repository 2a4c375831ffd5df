"""`LightSource` and `AreaLightSource`: pbrt-v4's defaults, its normalisation of spectra, `power` and
`illuminance`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes import color as colours
from scenes.description.lights import DistantLight, Light, PointLight, SpotLight
from scenes.description.materials import Diffuse
from scenes.description.shapes import BilinearMesh, Emission, TriangleMesh
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse_file
from tests.kit.scene_texts import HEAD, PATCH, TRIANGLE, world, world_fails

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def light_of(body: str) -> Light:
    (light,) = world(body).lights
    return light


def distant(body: str) -> DistantLight:
    light = light_of(body)
    assert isinstance(light, DistantLight)
    return light


def point(body: str) -> PointLight:
    light = light_of(body)
    assert isinstance(light, PointLight)
    return light


def spot(body: str) -> SpotLight:
    light = light_of(body)
    assert isinstance(light, SpotLight)
    return light


def emission_of(body: str) -> Emission:
    (shape,) = world(body).shapes
    assert shape.emission is not None
    return shape.emission


def test_a_distant_light_by_default() -> None:
    light = distant('LightSource "distant"')  # from the origin to (0, 0, 1)
    assert (light.wi.tolist(), light.irradiance.tolist()) == ([0, 0, -1], [1, 1, 1])


@pytest.mark.parametrize(
    ("body", "wi", "irradiance"),
    [
        (
            '"point3 from" [ 0 5 0 ] "point3 to" [ 0 1 0 ] "rgb L" [ 1 2 3 ] "float scale" 2',
            [0, 1, 0],
            [2, 4, 6],
        ),
        ('"rgb L" [ 1 2 3 ] "float illuminance" 10 "float scale" 2', [0, 0, -1], [20, 40, 60]),
        ('"point from" [ 2 0 0 ] "point to" [ 0 0 0 ] "float illuminance" -1', [1, 0, 0], [1, 1, 1]),
    ],
)
def test_distant_lights(body: str, wi: list[float], irradiance: list[float]) -> None:
    light = distant(f'LightSource "distant" {body}')
    assert (light.wi.tolist(), light.irradiance.tolist()) == (wi, irradiance)


def test_lights_turn_with_the_transformation() -> None:
    light = distant(
        'Rotate 90 1 0 0 Translate 5 5 5 LightSource "distant" "point3 from" [ 0 3 0 ] "point3 to" [ 0 0 0 ]'
    )
    assert light.wi.tolist() == [0, 0, 1]
    light = distant('Scale 1 3 1 LightSource "distant" "point3 from" [ 1 1 0 ] "point3 to" [ 0 0 0 ]')
    np.testing.assert_allclose(light.wi, np.array([1, 3, 0]) / np.sqrt(10), atol=1e-15)


def test_a_point_light() -> None:
    light = point(
        'Translate 1 2 3 Scale 2 2 2 LightSource "point" "point3 from" [ 0 1 0 ] "rgb I" [ 1 2 3 ] "float '
        'scale" 3'
    )
    assert (light.position.tolist(), light.intensity.tolist()) == ([1, 4, 3], [3, 6, 9])
    assert str(light.where).endswith(":7:29")
    assert point('LightSource "point"').intensity.tolist() == [1, 1, 1]


def test_power_of_a_point_light_is_spread_over_the_sphere() -> None:
    light = point('LightSource "point" "float power" 100')
    np.testing.assert_allclose(light.intensity, np.full(3, 100 / (4 * np.pi)), rtol=1e-15)


def test_a_spot_light() -> None:
    light = spot('LightSource "spot"')
    assert (light.position.tolist(), light.axis.tolist(), light.cone, light.falloff_start) == (
        [0, 0, 0],
        [0, 0, 1],
        30,
        25,
    )
    body = (
        '"point3 from" [ 0 2 0 ] "point3 to" [ 0 0 0 ] "float coneangle" 40 "float conedeltaangle" 10 '
        '"rgb I" [ 3 2 1 ]'
    )
    light = spot(f'Translate 1 0 0 Scale 2 2 2 LightSource "spot" {body}')
    assert (light.position.tolist(), light.axis.tolist(), light.cone, light.falloff_start) == (
        [1, 4, 0],
        [0, -1, 0],
        40,
        30,
    )
    assert light.intensity.tolist() == [3, 2, 1]


def test_a_narrow_cone_falls_off_from_its_axis_on() -> None:
    """pbrt takes the cosine of what would be a negative angle."""
    light = spot('LightSource "spot" "float coneangle" 4')
    assert (light.cone, light.falloff_start) == (4, 1)


def test_any_name_with_a_suffix_is_a_file_of_samples(tmp_path: Path) -> None:
    (tmp_path / "lamp.txt").write_text("400 5 700 9\n")
    (tmp_path / "s.pbrt").write_text(HEAD + 'LightSource "distant" "spectrum L" "lamp.txt"')
    (light,) = parse_file(tmp_path / "s.pbrt").lights
    (other,) = world('LightSource "distant" "spectrum L" [ 400 5 700 9 ]').lights
    assert isinstance(light, DistantLight)
    assert isinstance(other, DistantLight)
    assert light.irradiance.tolist() == other.irradiance.tolist()


def test_colours_of_other_spaces() -> None:
    """BT.2087's matrix, to the four digits that it is published with; gray stays gray, and what sRGB does not
    hold is cut off.

    Of a parameter it is the space where that stands, in `Attribute` too, and a block gives the space back.
    """
    (light,) = world('ColorSpace "Rec2020" LightSource "distant" "rgb L" [ 0.3 0.2 0.1 ]').lights
    assert isinstance(light, DistantLight)
    matrix = [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]
    np.testing.assert_allclose(light.irradiance, np.array(matrix) @ [0.3, 0.2, 0.1], atol=1e-4)
    for space in ("rec2020", "dci-p3"):
        (gray,) = world(f'ColorSpace "{space}" LightSource "distant" "rgb L" [ 2 2 2 ]').lights
        assert isinstance(gray, DistantLight)
        np.testing.assert_allclose(gray.irradiance, 2, rtol=1e-14)
    (green,) = world(
        'ColorSpace "rec2020" Material "diffuse" "rgb reflectance" [ 0 1 0 ] Shape "sphere"'
    ).shapes
    assert isinstance(green.material, Diffuse)
    assert np.asarray(green.material.reflectance).tolist() == [0, 1, 0]
    said = 'AttributeBegin ColorSpace "rec2020" Attribute "light" "rgb L" [ .3 .2 .1 ] ColorSpace "srgb" '
    kept, plain = world(
        said + 'LightSource "distant" AttributeEnd LightSource "distant" "rgb L" [ .3 .2 .1 ]'
    ).lights
    assert isinstance(kept, DistantLight)
    assert isinstance(plain, DistantLight)
    assert kept.irradiance.tolist() == light.irradiance.tolist()
    assert plain.irradiance.tolist() == [0.3, 0.2, 0.1]


def test_power_of_a_spot_light_is_what_it_sends_out() -> None:
    """Its intensity integrated over the cone, by midpoints of the cosine at 1e-9, is the power: a factor of
    pbrt's left out would be seen.
    """
    light = spot('LightSource "spot" "float power" 50 "float coneangle" 50 "float conedeltaangle" 20')
    edges = np.linspace(np.cos(np.radians(light.cone)), 1, 400_001)
    cosine = (edges[1:] + edges[:-1]) / 2
    start, end = np.cos(np.radians(light.falloff_start)), np.cos(np.radians(light.cone))
    x = np.clip((cosine - end) / (start - end), 0, 1)
    flux = 2 * np.pi * np.sum(x * x * (3 - 2 * x)) * (edges[1] - edges[0]) * light.intensity
    np.testing.assert_allclose(flux, 50, rtol=1e-9)


@pytest.mark.parametrize("name", ['"distant"', '"point"', '"spot"', '"infinite"'])
def test_spectra_have_luminance_one_before_they_are_scaled(name: str) -> None:
    """pbrt divides by the luminance of the spectrum, whatever its height: a black body of 1e4 K is as bright
    as one of 3000 K.
    """
    letter = "I" if name in ('"point"', '"spot"') else "L"
    for spectrum in ('"blackbody {}" 3000', '"spectrum {}" [ 400 5 700 9 ]', '"spectrum {}" "stdillum-A"'):
        light = light_of(f'LightSource {name} {spectrum.format(letter)} "float scale" 10')
        value = next(
            getattr(light, key) for key in ("irradiance", "intensity", "radiance") if hasattr(light, key)
        )
        assert LUMINANCE @ value == pytest.approx(10, rel=2e-3)
        assert np.ptp(value) > 1
    black = distant('LightSource "distant" "blackbody L" 3000 "float scale" 10')
    if name == '"distant"':
        np.testing.assert_array_equal(black.irradiance, 10 * colours.blackbody(3000.0))


def test_a_spectrum_may_be_a_file(tmp_path: Path) -> None:
    (tmp_path / "a.spd").write_text("# nm, value\n400 5 # a comment\n 700 9\n")
    scene = tmp_path / "s.pbrt"
    scene.write_text(HEAD + 'LightSource "distant" "spectrum L" "a.spd"')
    inline = distant('LightSource "distant" "spectrum L" [ 400 5 700 9 ]')
    (light,) = parse_file(scene).lights
    assert isinstance(light, DistantLight)
    np.testing.assert_array_equal(light.irradiance, inline.irradiance)


def test_area_lights_take_every_kind_of_colour() -> None:
    np.testing.assert_array_equal(
        emission_of('AreaLightSource "diffuse" "blackbody L" [ 4000 ] "float scale" 5 ' + PATCH).radiance,
        5 * colours.blackbody(4000.0),
    )


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        (PATCH, 1.0),
        (TRIANGLE, 0.5),
        ('Scale 2 2 2 Shape "sphere" "float radius" 0.5', 4 * np.pi),
        ('Shape "disk" "float radius" 2', 4 * np.pi),
        (PATCH.replace("1 1 0", "1.5 1 0"), 1.25),
    ],
)
@pytest.mark.parametrize("two_sided", ["false", "true"])
def test_power_of_an_area_light_is_spread_over_its_shape(shape: str, area: float, two_sided: str) -> None:
    """A Lambertian side of radiance L sends out pi L A."""
    emission = emission_of(
        f'AreaLightSource "diffuse" "rgb L" [ 1 2 0 ] "float power" 60 "bool twosided" {two_sided} {shape}'
    )
    expected = 60 / (np.pi * area * (2 if two_sided == "true" else 1))
    np.testing.assert_allclose(emission.radiance, expected * np.array([1, 2, 0]), rtol=1e-14)


def test_power_is_that_of_each_face_as_in_pbrt() -> None:
    mesh = (
        'Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 4 0 0 0 4 0 ] "integer indices" [ 0 1 2 0 '
        "3 4 1 2 0 ]"
    )
    small, large = world('AreaLightSource "diffuse" "float power" 1 ' + mesh).shapes
    assert isinstance(small.geometry, TriangleMesh)
    assert isinstance(large.geometry, TriangleMesh)
    assert (small.geometry.faces.tolist(), large.geometry.faces.tolist()) == (
        [[0, 1, 2], [1, 2, 0]],
        [[0, 3, 4]],
    )
    assert small.emission is not None
    assert large.emission is not None
    np.testing.assert_allclose(small.emission.radiance, 1 / (np.pi * 0.5))
    np.testing.assert_allclose(large.emission.radiance, 1 / (np.pi * 8))


def image_scene(folder: Path, body: str, pixels: np.ndarray) -> Path:
    write_exr(folder / "light.exr", dict(zip("RGB", np.moveaxis(pixels, -1, 0), strict=True)))
    (folder / "s.pbrt").write_text(HEAD + body)
    return folder / "s.pbrt"


PIXELS = np.array([[[1.0, 2, 3], [4, 5, 6]], [[0, 0, 0.5], [1, 1, 1]], [[2, 2, 2], [8, 0, 0]]])


def test_an_image_on_a_rectangle(tmp_path: Path) -> None:
    body = 'AreaLightSource "diffuse" "string filename" "light.exr" "float scale" 2 ' + PATCH
    emission = parse_file(image_scene(tmp_path, body, PIXELS)).shapes[0].emission
    assert emission is not None
    assert emission.image is not None
    assert emission.image.tolist() == PIXELS.tolist()
    assert emission.radiance.tolist() == [2, 2, 2]
    body = body.replace('"float scale" 2', '"float power" 9') + ' "point2 uv" [ 0 0 1 0 0 1 1 1 ]'
    (shape,) = parse_file(image_scene(tmp_path, body, PIXELS)).shapes
    assert shape.emission is not None
    np.testing.assert_allclose(shape.emission.radiance, 9 / (np.pi * (PIXELS @ LUMINANCE).mean()), rtol=1e-14)
    assert isinstance(shape.geometry, BilinearMesh)
    assert shape.geometry.uv is None  # the patch's own parameters anyway


@pytest.mark.parametrize(
    "shape",
    [TRIANGLE, 'Shape "sphere"', PATCH.replace("1 1 0", "1 2 0"), PATCH + ' "point2 uv" [ 0 0 2 0 0 1 2 1 ]'],
)
def test_images_on_other_shapes_are_refused(tmp_path: Path, shape: str) -> None:
    path = image_scene(tmp_path, 'AreaLightSource "diffuse" "string filename" "light.exr"\n' + shape, PIXELS)
    with pytest.raises(Exception, match="rectangles only"):
        parse_file(path)


@pytest.mark.parametrize(
    ("body", "column", "words"),
    [
        ('LightSource "laser"', 1, ('"laser"', "not supported")),
        ('LightSource "distant" "rgb L" [ 1 -1 1 ]', 35, ("negative: -1",)),
        ('LightSource "distant" "rgb I" [ 1 1 1 ]', 23, ('"rgb I"', '"rgb L"')),
        ('LightSource "distant" "point3 to" [ 0 0 0 ]', 23, ("same point",)),
        ('LightSource "distant" "point3 from" [ 0 0 0 1 1 1 ]', 23, ("one point, not 2",)),
        ('LightSource "point" "rgb I" [ 1e30 1 1 ] "float scale" 2', 21, ("1e30",)),
        ('LightSource "point" "float scale" -1', 21, ("negative",)),
        ('LightSource "point" "point3 from" [ 1e30 0 0 ]', 21, ("1e+18",)),
        ('LightSource "spot" "float coneangle" 0', 20, ("coneangle",)),
        ('LightSource "spot" "float conedeltaangle" 61', 20, ("twice coneangle",)),
        ('Scale 1 1 2 LightSource "spot"', 13, ("stretches or shears the cone",)),
        ('LightSource "distant" "blackbody L" 0', 23, ("kelvin",)),
        ('LightSource "distant" "blackbody L" [ 3000 1 ]', 23, ("one temperature",)),
        ('LightSource "distant" "spectrum L" [ 400 1 500 ]', 23, ("pairs",)),
        ('LightSource "distant" "spectrum L" [ 500 1 400 1 ]', 23, ("must increase",)),
        ('LightSource "distant" "spectrum L" [ 400 1 500 -1 ]', 23, ("negative: -1",)),
        ('LightSource "distant" "spectrum L" [ ]', 23, ("pairs",)),
        ('LightSource "distant" "spectrum L" [ 1000 1 2000 1 ]', 23, ("nothing between 360 and 830",)),
        ('LightSource "distant" "spectrum L" "stdillum-X"', 23, ("unknown spectrum 'stdillum-X'",)),
        ('LightSource "distant" "spectrum L" [ "stdillum-A" "stdillum-A" ]', 23, ("one name, not 2",)),
        ('LightSource "distant" "spectrum L" "gone.spd"', 36, ("gone.spd", "No such file")),
    ],
)
def test_lights_that_cannot_be_are_refused_where_they_stand(
    body: str, column: int, words: tuple[str, ...]
) -> None:
    world_fails(body, 1, column, *words)
