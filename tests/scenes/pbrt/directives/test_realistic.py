"""The thin lens that stands in for a realistic camera."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.description.lights import PointLight
from scenes.description.scene import PerspectiveCamera
from scenes.errors import SceneError
from scenes.pbrt.directives.realistic import focal_length
from scenes.pbrt.parser import parse_file
from tests.kit.scene_texts import HEAD

# Two surfaces of glass of 1.5, with a stop behind them.
GLASS = "50 6 1.5 20\n-80 2 1 20\n0 10 0 8\n"
CAMERA = 'Camera "realistic" "string lensfile" "lens.dat" "float focusdistance" 5 "float aperturediameter" 4'


def text(camera: str) -> str:
    return HEAD.replace('Camera "perspective" "float fov" [ 40 ]', camera)


def test_a_single_lens_has_the_focal_length_of_the_lensmakers_equation() -> None:
    """1/f = (n - 1) (1/R1 - 1/R2 + (n - 1) d / (n R1 R2)); a sign of R2 that is wrong gives 256 mm for 62."""
    surfaces = np.array([[50.0, 6, 1.5, 20], [-80, 2, 1, 20], [0, 10, 0, 8]])
    inverse = 0.5 * (1 / 50 + 1 / 80 + 0.5 * 6 / (1.5 * 50 * -80))
    assert focal_length(surfaces) == pytest.approx(1 / inverse, rel=1e-12)


def test_the_lens_focuses_on_the_plane_and_the_film_has_its_angle(tmp_path: Path) -> None:
    (tmp_path / "lens.dat").write_text("# a lens\n" + GLASS)
    main = tmp_path / "main.pbrt"
    main.write_text(text(CAMERA) + 'LightSource "point"')
    scene = parse_file(main, substitute=True)
    camera = scene.camera
    assert isinstance(camera, PerspectiveCamera)
    assert camera.lens is not None
    f = focal_length(np.array([[50.0, 6, 1.5, 20], [-80, 2, 1, 20]])) / 1000
    ahead, behind = camera.lens.distance, 5 - camera.lens.distance
    assert 1 / ahead + 1 / behind == pytest.approx(1 / f, rel=1e-12)
    assert camera.lens.radius == 0.002
    # The film of 8 x 6 pixels has a diagonal of 35 mm: it is 28 x 21 mm.
    assert np.tan(np.radians(camera.fov / 2)) == pytest.approx(0.0105 / behind, rel=1e-12)
    # On its axis a film receives L pi (r / v)^2, where pbrt's other cameras record L.
    (light,) = scene.lights
    assert isinstance(light, PointLight)
    assert light.intensity == pytest.approx(np.pi * (0.002 / behind) ** 2, rel=1e-12)
    assert ["as a thin lens" in line for line in scene.substitutions] == [True]


def test_the_stop_bounds_the_aperture(tmp_path: Path) -> None:
    (tmp_path / "lens.dat").write_text(GLASS)
    main = tmp_path / "main.pbrt"
    main.write_text(text(CAMERA.replace('diameter" 4', 'diameter" 100')))
    camera = parse_file(main, substitute=True).camera
    assert camera.lens is not None and camera.lens.radius == 0.004


@pytest.mark.parametrize(
    ("lens", "camera", "words"),
    [
        (None, CAMERA, "cannot read .*lens.dat"),
        ("1 2 3", CAMERA, "'lens.dat' is no lens: it holds rows of four numbers"),
        ("version 1 2 3", CAMERA, "is no lens"),
        ("-50 2 1.5 20\n50 2 1 20", CAMERA, "is no lens that forms an image"),
        (GLASS, CAMERA.replace('distance" 5', 'distance" .1'), "cannot focus 0.1 m from its film"),
        (GLASS, 'Camera "realistic"', 'needs "string lensfile"'),
    ],
)
def test_what_is_no_lens_is_refused(tmp_path: Path, lens: str | None, camera: str, words: str) -> None:
    if lens is not None:
        (tmp_path / "lens.dat").write_text(lens)
    (tmp_path / "main.pbrt").write_text(text(camera))
    with pytest.raises(SceneError, match=words):
        parse_file(tmp_path / "main.pbrt", substitute=True)


def test_without_substitutes_it_is_refused(tmp_path: Path) -> None:
    (tmp_path / "lens.dat").write_text(GLASS)
    (tmp_path / "main.pbrt").write_text(text(CAMERA))
    with pytest.raises(
        SceneError, match=r'main\.pbrt:2:1: Camera "realistic" is not supported; --substitute'
    ):
        parse_file(tmp_path / "main.pbrt")
