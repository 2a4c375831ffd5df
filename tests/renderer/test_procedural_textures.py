"""Noise, patterns and mappings against pbrt-v4's formulas written out, one point at a time."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from pipeline.references.protocol import BACKENDS
from renderer.build import build
from renderer.math import noise as noises
from renderer.textures import brightest, coordinates, evaluate
from scenes.description.lights import Environment
from scenes.description.materials import Diffuse
from scenes.description.textures import (
    Bilerp,
    Checkerboard,
    CylindricalMapping,
    DirectionMix,
    Dots,
    ImageTexture,
    Marble,
    Mix,
    NoiseTexture,
    PlanarMapping,
    PointMapping,
    SphericalMapping,
    Texture,
    UVMapping,
)
from scenes.pbrt.parser import parse, parse_file
from scenes.pbrt.transforms import rotate, scale, translate
from scenes.pbrt.write.scene import to_pbrt
from tests.kit.exported import written
from tests.kit.scene_texts import HEAD, TRIANGLE, world
from tests.kit.scenes import floor, places, reflect, scene

TABLE = list(noises._TABLE) * 2
RED, GREEN = np.array([0.8, 0.1, 0.1]), np.array([0.1, 0.6, 0.1])
MADE = translate(1.0, -2.0, 0.5) @ rotate(40.0, 1.0, 2.0, 3.0) @ scale(2.0, 0.5, -1.0)
UP = np.array([0.0, 1.0, 0.0])


def gradient(x: int, y: int, z: int, dx: float, dy: float, dz: float) -> float:
    h = TABLE[TABLE[TABLE[x] + y] + z] & 15
    u = dx if h < 8 or h in (12, 13) else dy
    v = dy if h < 4 or h in (12, 13) else dz
    return (-u if h & 1 else u) + (-v if h & 2 else v)


def noise(x: float, y: float = 0.5, z: float = 0.5) -> float:
    """pbrt's Noise."""
    ix, iy, iz = (int(np.floor(v)) for v in (x, y, z))
    d = (x - ix, y - iy, z - iz)
    w = [6 * t**5 - 15 * t**4 + 10 * t**3 for t in d]
    ix, iy, iz = ix & 255, iy & 255, iz & 255

    def lerp(t: float, a: float, b: float) -> float:
        return (1 - t) * a + t * b

    def at(i: int, j: int, k: int) -> float:
        return gradient(ix + i, iy + j, iz + k, d[0] - i, d[1] - j, d[2] - k)

    y0, y1 = (
        lerp(w[1], lerp(w[0], at(0, 0, k), at(1, 0, k)), lerp(w[0], at(0, 1, k), at(1, 1, k))) for k in (0, 1)
    )
    return lerp(w[2], y0, y1)


def fbm(p: np.ndarray, omega: float, octaves: int, turbulent: bool = False) -> float:
    total, fine, height = 0.0, 1.0, 1.0
    for _ in range(octaves):
        value = noise(*(fine * p))
        total += height * (abs(value) if turbulent else value)
        fine, height = fine * 1.99, height * omega
    return total + (0.2 * height if turbulent else 0.0)


def points(n: int = 200, size: float = 300.0) -> np.ndarray:
    return np.random.default_rng(3).uniform(-size, size, (3, n))


def values(texture: Texture, p: np.ndarray) -> np.ndarray:
    return evaluate(texture, places(np.zeros((2, p.shape[1])), p))


def test_the_table_is_a_permutation_and_noise_is_pbrt_s():
    assert sorted(TABLE[:256]) == list(range(256))
    assert TABLE[:4] == [151, 160, 137, 91]
    p = np.concatenate([points(), points(50, 3.0), np.array([[1.0, -7, 255], [0, 256, -256]]).T], axis=1)
    np.testing.assert_allclose(noises.noise(p), [noise(*one) for one in p.T], atol=1e-12)
    assert not noises.noise(np.floor(points())).any()


def test_sums_over_octaves_are_pbrt_s():
    p = points(60, 20.0)
    for texture, want in (
        (NoiseTexture("fbm", 5, 0.6), [fbm(one, 0.6, 5) for one in p.T]),
        (NoiseTexture("fbm"), [fbm(one, 0.5, 8) for one in p.T]),
        (NoiseTexture("wrinkled", 4, 0.7), [fbm(one, 0.7, 4, True) for one in p.T]),
        (NoiseTexture("windy"), [abs(fbm(0.1 * one, 0.5, 3)) * fbm(one, 0.5, 6) for one in p.T]),
    ):
        np.testing.assert_allclose(values(texture, p), np.repeat([want], 3, axis=0), atol=1e-11)
        assert (np.abs(want) <= brightest(texture)[0]).all()
    wrinkled = NoiseTexture("wrinkled")
    assert values(wrinkled, points(4000)).mean() == pytest.approx(wrinkled.mean()[0], rel=0.1)


def test_marble_is_pbrt_s():
    """The Bezier curve by de Casteljau, where the texture has Bernstein's polynomials."""
    texture, p = Marble(4, 0.6, 3.0, 0.7), points(80, 5.0)
    colors = 1.5 * np.array(
        [[58, 58, 60], [58, 58, 60], [58, 58, 60], [50, 50, 50], [60, 59, 58], [58, 58, 60], [58, 58, 60],
         [20, 20, 33], [58, 58, 60]]
    ) / 100  # fmt: skip
    for own, got in zip(3.0 * p.T, values(texture, p).T, strict=True):
        t = 0.5 + 0.5 * np.sin(own[1] + 0.7 * fbm(own, 0.6, 4))
        first = min(int(np.floor(t * 6)), 5)
        t = t * 6 - first
        curve = list(colors[first : first + 4])
        while len(curve) > 1:
            curve = [(1 - t) * a + t * b for a, b in pairwise(curve)]
        np.testing.assert_allclose(got, curve[0], atol=1e-11)
    assert (values(texture, points()) <= brightest(texture)[:, None]).all()
    np.testing.assert_allclose(values(texture, points(5000)).mean(axis=1), texture.mean(), rtol=0.02)


def test_dots_are_pbrt_s():
    """Its "inside" lies around them: InsidePolkaDot, and the order that the constructor takes."""
    uv = np.random.default_rng(1).uniform(-5, 5, (2, 400))
    got = evaluate(Dots(RED, GREEN, UVMapping(2.0, 3.0)), places(uv))
    inside = 0
    for (s, t), value in zip((uv * [[2.0], [3.0]]).T, got.T, strict=True):
        a, b = np.floor(s + 0.5), np.floor(t + 0.5)
        dot = False
        if noise(a + 0.5, b + 0.5) > 0:
            x, y = a + 0.15 * noise(a + 1.5, b + 2.8), b + 0.15 * noise(a + 4.5, b + 9.8)
            dot = (s - x) ** 2 + (t - y) ** 2 < 0.35**2
        inside += dot
        assert value.tolist() == (GREEN if dot else RED).tolist()
    assert 40 < inside < 120


def test_a_solid_checkerboard_counts_all_three_coordinates():
    board = Checkerboard(RED, GREEN, PointMapping(MADE.matrix))
    p = points(300, 4.0)
    own = MADE.inverted().points(p.T)
    want = [RED if sum(np.floor(one)) % 2 == 0 else GREEN for one in own]
    assert np.array_equal(values(board, p).T, want)


def test_mappings_are_pbrt_s():
    p = points(100, 4.0)
    at = places(np.zeros((2, 100)), p)
    own = MADE.inverted().points(p.T)
    v1, v2 = np.array([1.0, 2, 3]), np.array([0.0, -1, 0.5])
    for (x, y, z), sphere, tube, plane in zip(
        own,
        coordinates(SphericalMapping(MADE.matrix), at).T,
        coordinates(CylindricalMapping(MADE.matrix), at).T,
        coordinates(PlanarMapping(MADE.matrix, v1, v2, 0.25, -0.5), at).T,
        strict=True,
    ):
        phi = np.arctan2(y, x)
        theta = np.arccos(z / np.sqrt(x * x + y * y + z * z))
        np.testing.assert_allclose(
            sphere, [theta / np.pi, (phi if phi >= 0 else phi + 2 * np.pi) / (2 * np.pi)]
        )
        np.testing.assert_allclose(tube, [(np.pi + phi) / (2 * np.pi), z], atol=1e-12)
        np.testing.assert_allclose(plane, [[x, y, z] @ v1 + 0.25, [x, y, z] @ v2 - 0.5], atol=1e-12)


def test_bilerp_goes_through_its_corners():
    corners = np.random.default_rng(2).random((4, 3))
    texture = Bilerp(*corners)
    uv = np.array([[0, 0, 1, 1, 0.3], [0, 1, 0, 1, 0.6]])
    got = evaluate(texture, places(uv)).T
    np.testing.assert_allclose(got[:4], corners, atol=1e-15)
    np.testing.assert_allclose(got[4], np.array([0.7 * 0.4, 0.7 * 0.6, 0.3 * 0.4, 0.3 * 0.6]) @ corners)


def test_a_mix_by_direction_is_its_first_along_the_direction():
    texture = DirectionMix(RED, GREEN, UP)
    n = np.array([[0, 1, 0], [0, -1, 0], [1, 0, 0], [0.6, 0.8, 0]]).T
    got = evaluate(texture, places(np.zeros((2, 4)), n, n)).T
    np.testing.assert_allclose(got, [RED, RED, GREEN, 0.8 * RED + 0.2 * GREEN])


def test_an_octahedron_of_texels_goes_on_over_its_edges():
    """Just beyond an edge stands the texel at the same edge, turned by half: pbrt's RemapPixelCoords."""
    image = np.arange(48.0).reshape(4, 4, 3) / 48
    texture = ImageTexture(image, wrap="octahedralsphere", filter="point")
    got = evaluate(texture, places(np.array([[1.1, 0.1, 1.1], [0.9, -0.1, 1.0]]))).T
    np.testing.assert_allclose(got, [image[3, 3], image[3, 3], image[3, 3]])


def test_a_floor_of_marble_reflects_its_texture_where_it_lies():
    """Under a white sky with no noise: a texture read at another point, or without its transformation, is
    another.
    """
    marble = Marble(mapping=PointMapping(MADE.matrix), scale=2.0)
    sky = Environment(np.ones(3))
    built = build(replace(scene([floor(material=Diffuse(marble))]), lights=(sky,)))
    at = np.random.default_rng(4).uniform(-3, 3, (50, 3)) * [1, 0, 1]
    mean, _ = reflect(built, at, UP, 0, "cosine", 2)
    np.testing.assert_allclose(mean, values(marble, at.T).T, rtol=1e-12)
    assert np.ptp(mean) > 0.2
    assert built.coordinates is None  # nothing looks at texture coordinates


TEXTS = {
    "directionmix": '"spectrum" "directionmix" "rgb tex1" [ .1 .2 .3 ] "vector3 dir" [ 1 2 3 ]',
    "bilerp": '"spectrum" "bilerp" "rgb v00" [ .1 .2 .3 ] "rgb v11" [ .4 .2 .3 ] "float uscale" 2',
    "dots": '"spectrum" "dots" "rgb inside" [ .1 .2 .3 ] "string mapping" "spherical"',
    "marble": '"spectrum" "marble" "integer octaves" 3 "float scale" 2 "float variation" .4',
    "checkerboard": '"spectrum" "checkerboard" "integer dimension" 3 "rgb tex1" [ .1 .2 .3 ]',
    "planar": '"spectrum" "checkerboard" "string mapping" "planar" "vector3 v1" [ 1 2 3 ] "float udelta" .3',
    "cylindrical": '"spectrum" "checkerboard" "string mapping" "cylindrical"',
    "octahedral": '"spectrum" "imagemap" "string filename" "a.exr" "string wrap" "octahedralsphere"',
    "fbm": '"float" "fbm" "integer octaves" 3 "float roughness" .4',
    "wrinkled": '"float" "wrinkled"',
    "windy": '"float" "windy"',
}


def read(name: str, folder: Path, before: str = "") -> Texture:
    from scenes.images.exr import write_exr

    write_exr(folder / "a.exr", dict.fromkeys("RGB", np.arange(16.0).reshape(4, 4) / 16))
    number = 'Texture "m" "spectrum" "mix" "texture amount" "t" Material "diffuse" "texture reflectance" "m" '
    use = number if TEXTS[name].startswith('"float"') else 'Material "diffuse" "texture reflectance" "t" '
    text = f'{HEAD}AttributeBegin {before} Texture "t" {TEXTS[name]} AttributeEnd {use}{TRIANGLE}'
    (folder / "s.pbrt").write_text(text)
    material = parse_file(folder / "s.pbrt").shapes[0].material
    assert isinstance(material, Diffuse)
    found = material.reflectance
    return found.amount if isinstance(found, Mix) else found


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("before", ["", "Translate 1 2 3 Rotate 30 1 2 3 Scale 2 2 -1"])
def test_textures_read_back_to_the_bit(name: str, before: str, tmp_path: Path):
    read(name, tmp_path, before)
    given = parse_file(tmp_path / "s.pbrt")
    (tmp_path / "back").mkdir()
    assert parse_file(written(given, tmp_path / "back")).content_hash() == given.content_hash()


def test_a_texture_lies_in_the_space_where_it_is_made(tmp_path: Path):
    marble = read("marble", tmp_path, "Translate 1 2 3")
    assert isinstance(marble, Marble)
    assert (marble.octaves, marble.roughness, marble.scale, marble.variation) == (3, 0.5, 2, 0.4)
    np.testing.assert_array_equal(marble.mapping.from_texture, translate(1.0, 2.0, 3.0).matrix)
    mix = read("directionmix", tmp_path, "Rotate 90 0 0 1 Scale 5 5 5")
    assert isinstance(mix, DirectionMix)
    np.testing.assert_allclose(mix.direction, np.array([-2, 1, 3]) / np.sqrt(14), atol=1e-15)
    dots = read("dots", tmp_path)
    assert isinstance(dots, Dots)
    assert (np.asarray(dots.around).tolist(), np.asarray(dots.within).tolist()) == (
        [0.1, 0.2, 0.3],
        [0, 0, 0],
    )
    assert isinstance(dots.mapping, SphericalMapping)


def test_ptex_is_a_constant_by_request():
    text = 'Texture "t" "spectrum" "ptex" "string filename" "a" Material "diffuse" "texture reflectance" "t" '
    given = parse(HEAD + text + TRIANGLE, substitute=True)
    assert given.substitutions
    material = given.shapes[0].material
    assert isinstance(material, Diffuse)
    assert np.asarray(material.reflectance).tolist() == [0.5] * 3


def test_mitsuba_refuses_what_it_lacks_by_name(tmp_path: Path):
    for name, word in (("marble", "Marble"), ("planar", "PlanarMapping"), ("octahedral", "octahedralsphere")):
        read(name, tmp_path)
        given = replace(parse_file(tmp_path / "s.pbrt"), lights=(Environment(np.ones(3)),))
        why = BACKENDS["mitsuba"].refuses(given)
        assert why is not None
        assert word in why


def test_the_texts_of_constants_stay():
    given = world(
        'Texture "t" "spectrum" "checkerboard" Material "diffuse" "texture reflectance" "t" ' + TRIANGLE
    )
    assert "Transform [" not in to_pbrt(given).split("WorldBegin")[1]
