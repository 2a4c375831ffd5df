"""`LightSource "infinite"`: constants and images, their frames, their illuminance, and how several add up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.description.lights import DistantLight, Environment, PortalLight
from scenes.description.scene import SceneDescription
from scenes.errors import SceneError
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse, parse_file
from scenes.pbrt.spectra import LUMINANCE
from scenes.pbrt.write.scene import to_pbrt
from tests.kit.exported import written
from tests.kit.scene_texts import HEAD, world, world_fails

SKY = 'LightSource "infinite" "rgb L" [ 1 2 3 ]\n'


def only(scene: SceneDescription) -> Environment:
    (light,) = scene.lights
    assert isinstance(light, Environment)
    return light


def with_image(
    folder: Path, pixels: np.ndarray, parameters: str = "", before: str = "", after: str = ""
) -> SceneDescription:
    write_exr(folder / "sky.exr", dict(zip("RGB", np.moveaxis(pixels, -1, 0), strict=True)))
    (folder / "s.pbrt").write_text(
        f'{HEAD}{before}LightSource "infinite" "string filename" "sky.exr" {parameters}\n{after}'
    )
    return parse_file(folder / "s.pbrt")


def pixels(height: int, width: int) -> np.ndarray:
    """Random radiances that float32 holds exactly."""
    rng = np.random.default_rng(5)
    return rng.uniform(0, 4, (height, width, 3)).astype(np.float32).astype(np.float64)


def test_a_constant_sky() -> None:
    light = only(world('LightSource "infinite"'))
    assert (light.radiance.tolist(), light.image, light.hemisphere, light.mapping) == (
        [1, 1, 1],
        None,
        False,
        "equal-area",
    )
    light = only(world('Rotate 30 1 2 3 LightSource "infinite" "rgb L" [ 1 2 3 ] "float scale" 2'))
    assert light.radiance.tolist() == [2, 4, 6]
    assert light.frame.tolist() == np.eye(3).tolist()  # which way a constant sphere is turned is no content


def test_illuminance_of_a_constant_sky_is_pi_times_its_radiance() -> None:
    light = only(world('LightSource "infinite" "rgb L" [ 2 2 2 ] "float illuminance" 10'))
    np.testing.assert_allclose(light.radiance, 2 * 10 / np.pi)  # pbrt scales L, it does not replace it


def test_a_hemisphere_keeps_its_frame() -> None:
    light = only(world('Rotate 90 1 0 0 LightSource "infinite" "bool hemisphere" true'))
    assert light.hemisphere
    assert light.frame.tolist() == [[1, 0, 0], [0, 0, -1], [0, 1, 0]]


def test_constants_add_up_to_one_light_in_the_place_of_the_first() -> None:
    sun = 'LightSource "distant"\n'
    first, second = world(SKY + sun + 'LightSource "infinite" "rgb L" [ .5 0 0 ] "float scale" 2').lights
    assert isinstance(first, Environment)
    assert isinstance(second, DistantLight)
    assert first.radiance.tolist() == [2, 2, 3]
    half = 'LightSource "infinite" "bool hemisphere" true\n'
    assert only(world(half + half)).radiance.tolist() == [2, 2, 2]


def test_an_image(tmp_path: Path) -> None:
    image = pixels(4, 4)
    light = only(with_image(tmp_path, image, '"float scale" 3', "Rotate -90 1 0 0 Scale 5 5 5 "))
    assert light.image is not None
    assert light.image.tolist() == image.tolist()
    assert (light.radiance.tolist(), light.mapping) == ([3, 3, 3], "equal-area")
    np.testing.assert_allclose(light.frame, [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-15)
    mirrored = only(with_image(tmp_path, image, "", "Scale -1 1 1 "))
    assert mirrored.frame.tolist() == [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]


def test_a_constant_is_added_to_the_texels_of_an_image(tmp_path: Path) -> None:
    image = pixels(4, 4)
    for order in ({"after": SKY}, {"before": SKY}):
        light = only(with_image(tmp_path, image, '"float scale" 2', **order))
        assert light.image is not None
        np.testing.assert_array_equal(
            light.radiance * light.image, (2 * image + [1, 2, 3]).astype(np.float32)
        )


def test_a_latitude_longitude_image_is_named_as_such(tmp_path: Path) -> None:
    light = only(with_image(tmp_path, pixels(4, 8), '"string mapping" "latitude-longitude"'))
    assert (light.mapping, light.image is not None) == ("latitude-longitude", True)
    with pytest.raises(SceneError, match=r"s\.pbrt:7:24: 'sky\.exr' is 8 x 4: .*latitude-longitude"):
        with_image(tmp_path, pixels(4, 8))


def test_illuminance_of_an_image_is_pbrt_s_sum(tmp_path: Path) -> None:
    """pbrt's loop written out: each texel of the upper half by its cosine, times 2 pi over their number in
    all.
    """
    image, total, size = pixels(8, 8), 0.0, 8
    for y in range(size):
        for x in range(size):
            u, v = 2 * (x + 0.5) / size - 1, 2 * (y + 0.5) / size - 1
            d = 1 - (abs(u) + abs(v))
            z = np.copysign(1 - (1 - abs(d)) ** 2, d)
            total += max(z, 0.0) * float(image[y, x] @ LUMINANCE) if z > 0 else 0.0
    total *= 2 * np.pi / size**2
    light = only(with_image(tmp_path, image, '"float illuminance" 7'))
    np.testing.assert_allclose(light.radiance, 7 / total, rtol=1e-12)


@pytest.mark.parametrize(
    ("height", "width", "mapping"), [(64, 64, "equal-area"), (64, 128, "latitude-longitude")]
)
def test_illuminance_means_the_same_under_both_maps(
    tmp_path: Path, height: int, width: int, mapping: str
) -> None:
    """A white image of either map: pbrt divides by pi / 2, half of what a white sky gives.

    Texel centres are off by 2e-4 at 64 x 64.
    """
    light = only(
        with_image(
            tmp_path, np.ones((height, width, 3)), f'"float illuminance" 1 "string mapping" "{mapping}"'
        )
    )
    np.testing.assert_allclose(light.radiance, 2 / np.pi, rtol=1e-3)


def test_two_images_stay_two_lights(tmp_path: Path) -> None:
    """The constant goes to the first; both are written out, and read back to the bit."""
    again = 'Rotate 30 1 2 3 LightSource "infinite" "string filename" "sky.exr"\n' + SKY
    image = pixels(2, 2)
    scene = with_image(tmp_path, image, after=again)
    first, second = scene.lights
    assert isinstance(first, Environment)
    assert isinstance(second, Environment)
    assert first.image is not None
    assert second.image is not None
    np.testing.assert_array_equal(first.image, (image + np.array([1.0, 2.0, 3.0])).astype(np.float32))
    assert second.image.tolist() == image.tolist()
    (tmp_path / "back").mkdir()
    assert parse_file(written(scene, tmp_path / "back")).content_hash() == scene.content_hash()


PORTAL = '"point3 portal" [ 0 0 0  0 2 0  3 2 0  3 0 0 ]'


def test_a_portal_stays_where_it_is_in_the_world(tmp_path: Path) -> None:
    """pbrt moves its sky by the current transformation, and its corners not."""
    scene = with_image(
        tmp_path, pixels(4, 4), '"float scale" 3 ' + PORTAL, "Translate 5 6 7 Rotate 90 0 0 1 "
    )
    (light,) = scene.lights
    assert isinstance(light, PortalLight)
    assert light.corners.tolist() == [[0, 0, 0], [0, 2, 0], [3, 2, 0], [3, 0, 0]]
    assert light.sky.frame.tolist() == [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    assert light.sky.radiance.tolist() == [3, 3, 3]
    (tmp_path / "back").mkdir()
    assert parse_file(written(scene, tmp_path / "back")).content_hash() == scene.content_hash()


def test_a_constant_light_stands_under_any_transformation() -> None:
    stretched = world('Scale 1 2 0 LightSource "infinite" "rgb L" [ 1 2 3 ]')
    assert stretched.content_hash() == world('LightSource "infinite" "rgb L" [ 1 2 3 ]').content_hash()


def test_a_black_body_behind_a_portal_keeps_its_mean_under_the_eye() -> None:
    """pbrt makes RGB of Planck's law over its peak there; without a portal the luminance would be 1.

    Of 6500 K, whose peak is at 446 nm, 0.98 are left at 500 nm, 0.89 at 560 nm and 0.78 at 620 nm.
    """
    light = world(f'LightSource "infinite" "blackbody L" 6500 {PORTAL}').lights[0]
    assert isinstance(light, PortalLight)
    assert LUMINANCE @ light.sky.radiance == pytest.approx(0.886, abs=0.005)
    same = world(f'LightSource "infinite" "spectrum L" "stdillum-D65" {PORTAL}').lights[0]
    assert isinstance(same, PortalLight)
    np.testing.assert_allclose(same.sky.radiance, 1.0, rtol=1e-9)


def test_a_constant_behind_a_portal_is_an_image_of_one_texel_to_pbrt() -> None:
    """Its illuminance is 2 pi, that texel being straight up, and a plain sky stays apart from it."""
    (light, sky) = world(f'LightSource "infinite" "float illuminance" 10 {PORTAL}\n{SKY}').lights
    assert isinstance(light, PortalLight)
    assert isinstance(sky, Environment)
    np.testing.assert_allclose(light.sky.radiance, 10 / (2 * np.pi), rtol=1e-12)
    scene = world(f'LightSource "infinite" "rgb L" [ 1 2 3 ] {PORTAL}')
    assert parse(to_pbrt(scene)).content_hash() == scene.content_hash()


@pytest.mark.parametrize(
    ("body", "column", "words"),
    [
        ('Scale 1 2 1 LightSource "infinite" "bool hemisphere" true', 13, ("stretches or shears",)),
        ('LightSource "infinite" "point3 portal" [ 0 0 0 1 0 0 1 1 0 ]', 24, ("four corners, not 3",)),
        ('LightSource "infinite" "point3 portal" [ 0 0 0 1 0 0 1 1 0 0 1 1 ]', 24, ("no rectangle",)),
        ('LightSource "infinite" "point3 portal" [ 0 0 0 1 0 0 0 1 0 1 1 0 ]', 24, ("in turn",)),
        ('LightSource "infinite" "point3 portal" [ 0 0 0 0 0 0 1 1 0 0 1 0 ]', 24, ("same point",)),
        (f'LightSource "infinite" {PORTAL} "bool hemisphere" true', 24, ("which are ours",)),
        ('LightSource "infinite" "string mapping" "cube"', 24, ('"cube"', "latitude-longitude")),
        ('LightSource "infinite" "string filename" "gone.exr"', 24, ("gone.exr", "no such image")),
        ('LightSource "infinite" "rgb L" [ 1 1 1 ] "string filename" "a.exr"', 42, ("either L or filename",)),
    ],
)
def test_skies_that_cannot_be_are_refused_where_they_stand(
    body: str, column: int, words: tuple[str, ...]
) -> None:
    world_fails(body, 1, column, *words)


def test_a_black_image_gives_no_illuminance(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="black above its horizon"):
        with_image(tmp_path, np.zeros((2, 2, 3)), '"float illuminance" 1')
