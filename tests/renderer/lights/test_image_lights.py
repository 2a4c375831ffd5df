"""Goniometric and projection lights: asymmetric images under turned and mirrored frames, against pbrt's
formulas written out.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from renderer.interfaces.light import LIGHTS
from renderer.math.vectors import dot
from scenes.description.lights import GoniometricLight, Light, ProjectionLight
from scenes.errors import SceneError
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse_file
from scenes.pbrt.spectra import LUMINANCE
from tests.kit.exported import written
from tests.kit.scene_texts import HEAD, world_fails

SLIDE = np.arange(36.0).reshape(3, 4, 3) % 11 + 1
MAP = np.arange(16.0).reshape(4, 4) % 7 + 1
TURN = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
PLACE = "Translate 1 2 3 Rotate 30 1 2 3 "


def from_file(folder: Path, kind: str, before: str = "", parameters: str = "") -> Light:
    write_exr(folder / "slide.exr", dict(zip("RGB", np.moveaxis(SLIDE, -1, 0), strict=True)))
    write_exr(folder / "map.exr", {"Y": MAP})
    name = "slide" if kind == "projection" else "map"
    (folder / "s.pbrt").write_text(
        f'{HEAD}{before}LightSource "{kind}" "string filename" "{name}.exr" {parameters}\n'
    )
    (light,) = parse_file(folder / "s.pbrt").lights
    return light


def sent(light: Light, w: np.ndarray) -> np.ndarray:
    """Intensity (3, n) that a light sends along world directions w (3, n): its irradiance 2 away, times 4."""
    kind = LIGHTS["goniometric" if isinstance(light, GoniometricLight) else "projection"]
    n = w.shape[1]
    at = np.zeros(n, dtype=np.int64)
    sampler = kind.make([light], [0]).techniques["area"]
    assert light.place is not None
    s = sampler.sample_direction(at, light.place[:, None] + 2 * w, w, np.zeros((2, n)))
    np.testing.assert_allclose(s.wi, -w, atol=1e-14)
    return 4 * np.where(s.valid, s.radiance, 0.0)


def directions(n: int) -> np.ndarray:
    w = np.random.default_rng(6).normal(size=(3, n))
    return w / np.linalg.norm(w, axis=0)


def projected(own: np.ndarray, fov: float) -> np.ndarray:
    """pbrt's ProjectionLight::I for one direction of the light's own space, before its flip of y."""
    height, width = SLIDE.shape[:2]
    x, y, z = own[0], -own[1], own[2]
    if z < 1e-3:
        return np.zeros(3)
    aspect = width / height
    bounds = (aspect, 1.0) if aspect > 1 else (1.0, 1 / aspect)
    scale = 1 / np.tan(np.radians(fov) / 2)
    u, v = ((a / z * scale + b) / (2 * b) for a, b in zip((x, y), bounds, strict=True))
    if not (0 <= u <= 1 and 0 <= v <= 1):
        return np.zeros(3)
    return SLIDE[min(int(v * height), height - 1), min(int(u * width), width - 1)]


def looked_up(own: np.ndarray) -> float:
    """pbrt's EqualAreaSphereToSquare and nearest texel, after its swap of y and z."""
    x, y, z = own[0], own[2], own[1]
    r = np.sqrt(1 - abs(z))
    phi = np.arctan2(abs(y), abs(x)) * 2 / np.pi
    v = phi * r
    u = r - v
    if z < 0:
        u, v = 1 - v, 1 - u
    u, v = (np.copysign(u, x) + 1) / 2, (np.copysign(v, y) + 1) / 2
    return MAP[min(int(v * 4), 3), min(int(u * 4), 3)]


@pytest.mark.parametrize("mirror", ["", "Scale -1 1 1 ", "Scale 1 1 -1 ", "Scale 3 3 3 "])
def test_a_projector_shows_its_image_as_pbrt_does(tmp_path: Path, mirror: str):
    """An image that no symmetry leaves as it is: rows, columns, the flip of y and a mirror each have their
    own answer.
    """
    light = from_file(tmp_path, "projection", PLACE + mirror, '"float fov" 70 "float scale" 2')
    assert isinstance(light, ProjectionLight)
    w = directions(3000)
    turned = Rotation.from_rotvec(np.radians(30) * np.array([1, 2, 3]) / np.sqrt(14)).as_matrix()
    flips = np.diag(
        {"": [1, 1, 1], "Scale -1 1 1 ": [-1, 1, 1], "Scale 1 1 -1 ": [1, 1, -1]}.get(mirror, [1] * 3)
    )
    own = (turned @ flips).T @ w
    want = 2 * np.stack([projected(one, 70) for one in own.T], axis=1)
    got = sent(light, w)
    assert (want > 0).any(axis=0).mean() > 0.05
    # On an edge of a texel rounding may choose: at most one of 3000 here.
    assert (np.abs(got - want).max(axis=0) > 1e-9).sum() <= 1
    assert light.position.tolist() == [1, 2, 3]


@pytest.mark.parametrize("mirror", ["", "Scale -1 1 1 ", "Scale 1 -1 1 "])
def test_a_goniometric_light_is_looked_up_as_pbrt_does(tmp_path: Path, mirror: str):
    light = from_file(tmp_path, "goniometric", PLACE + mirror, '"rgb I" [ 3 2 1 ] "float scale" 2')
    w = directions(3000)
    turned = Rotation.from_rotvec(np.radians(30) * np.array([1, 2, 3]) / np.sqrt(14)).as_matrix()
    flips = np.diag({"": [1, 1, 1], "Scale -1 1 1 ": [-1, 1, 1]}.get(mirror, [1, -1, 1]))
    own = (turned @ flips).T @ w
    want = np.array([looked_up(one) for one in own.T]) * np.array([[6.0], [4.0], [2.0]])
    assert (np.abs(sent(light, w) - want).max(axis=0) > 1e-9).sum() <= 1


@pytest.mark.parametrize("kind", ["projection", "goniometric"])
def test_power_is_what_the_light_sends_out(tmp_path: Path, kind: str):
    """Luminance over 4e5 even directions. pbrt's own sum takes each texel's solid angle at its middle: with
    texels of 12 degrees 0.4 % off; a factor of pi or of the aspect is far beyond 2 %.
    """
    light = from_file(tmp_path, kind, PLACE, '"float power" 50' + ' "float fov" 40' * (kind == "projection"))
    n = 400_000
    i = np.arange(n)
    z, angle = 1 - (2 * i + 1) / n, i * (np.pi * (3 - np.sqrt(5)))
    w = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z])
    flux = 4 * np.pi * (LUMINANCE @ sent(light, w)).mean()
    assert flux == pytest.approx(50, rel=0.02)


@pytest.mark.parametrize("kind", ["projection", "goniometric"])
@pytest.mark.parametrize("before", ["", PLACE + "Scale -1 1 1 "])
def test_image_lights_read_back_to_the_bit(tmp_path: Path, kind: str, before: str):
    from_file(tmp_path, kind, before, '"float scale" 3')
    scene = parse_file(tmp_path / "s.pbrt")
    (tmp_path / "back").mkdir()
    assert parse_file(written(scene, tmp_path / "back")).content_hash() == scene.content_hash()


def test_a_map_of_colours_counts_by_the_mean(tmp_path: Path):
    image = np.stack([SLIDE[:3, :3, 0] + c for c in (0, 3, 6)], axis=-1)
    write_exr(tmp_path / "map.exr", dict(zip("RGB", np.moveaxis(image, -1, 0), strict=True)))
    (tmp_path / "s.pbrt").write_text(HEAD + 'LightSource "goniometric" "string filename" "map.exr"')
    (light,) = parse_file(tmp_path / "s.pbrt").lights
    assert isinstance(light, GoniometricLight)
    assert light.image.tolist() == image.mean(axis=2).tolist()


@pytest.mark.parametrize(
    ("body", "column", "words"),
    [
        ('LightSource "projection"', 1, ("filename",)),
        ('LightSource "goniometric"', 1, ("filename",)),
        ('LightSource "projection" "float fov" 180', 26, ("between 0 and 180",)),
        ('LightSource "projection" "string filename" "gone.png"', 26, ("gone.png",)),
    ],
)
def test_image_lights_that_cannot_be(body: str, column: int, words: tuple[str, ...]):
    world_fails(body, 1, column, *words)


def test_image_lights_that_files_do_not_fit(tmp_path: Path):
    for kind, before, parameters, column, words in (
        ("projection", "Scale 1 2 1 ", "", 13, "stretches or shears"),
        ("goniometric", "Scale 1 2 1 ", "", 13, "stretches or shears"),
        ("projection", "", '"float power" 1e32', 56, "1e30"),
    ):
        with pytest.raises(SceneError, match=words) as caught:
            from_file(tmp_path, kind, before, parameters)
        assert f"s.pbrt:7:{column}:" in str(caught.value)
    write_exr(tmp_path / "wide.exr", {"Y": np.ones((2, 4))})
    (tmp_path / "s.pbrt").write_text(HEAD + 'LightSource "goniometric" "string filename" "wide.exr"')
    with pytest.raises(SceneError, match=r"s\.pbrt:7:27: 'wide\.exr' is 4 x 2: .*square"):
        parse_file(tmp_path / "s.pbrt")
    write_exr(tmp_path / "black.exr", {"Y": np.zeros((2, 2))})
    (tmp_path / "s.pbrt").write_text(
        HEAD + 'LightSource "goniometric" "string filename" "black.exr" "float power" 1'
    )
    with pytest.raises(SceneError, match="black"):
        parse_file(tmp_path / "s.pbrt")


def test_irradiance_is_that_of_the_sample():
    light = GoniometricLight(np.zeros(3), TURN, np.ones(3), MAP)
    group = LIGHTS["goniometric"].make([light], [0])
    p = directions(50)
    n = -p
    at = np.zeros(50, dtype=np.int64)
    s = group.techniques["area"].sample_direction(at, p, n, np.zeros((2, 50)))
    np.testing.assert_allclose(group.irradiance(at, p, n), s.radiance * dot(s.wi, n), rtol=1e-13)
