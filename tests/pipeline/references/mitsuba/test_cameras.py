"""Cameras that are no plain pinholes, through Mitsuba against our renderer: two ways to the same rays."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.references.backends.mitsuba import MitsubaBackend
from pipeline.references.protocol import ReferenceRequest
from renderer import render
from scenes.pbrt.parser import parse
from tests.kit.pbrt_images import Pair

SCENE = """\
{ctm}
LookAt 0.5 2.4 6.5  0 0.5 0  0 1 0
Camera {camera}
Film "rgb" "integer xresolution" 48 "integer yresolution" 36 {film}
PixelFilter {pixel_filter}
Integrator "path" "integer maxdepth" 1
WorldBegin
Shape "trianglemesh" "point3 P" [ -8 0 -8  8 0 -8  8 0 8  -8 0 8 ] "integer indices" [ 0 2 1 0 3 2 ]
Translate -0.8 0.7 0.2
Shape "sphere" "float radius" 0.7
AreaLightSource "diffuse" "rgb L" [ 9 6 3 ]
Shape "bilinearmesh" "point3 P" [ 0.3 2.7 -0.4  1.9 2.7 -0.4  0.3 2.7 0.8  1.9 2.7 0.8 ]
"""
SHEAR = "Transform [ 1 .3 0 0  .2 .8 0 0  0 .1 1 0  0 0 0 1 ]"
EYE = '"perspective" "float fov" 40 '
WINDOW = '"float screenwindow" [ -1.5 0.9 -0.4 0.9 ]'
WIDE = '"float screenwindow" [ -2.6 2.2 -1.4 1.95 ]'
LENS = '"float lensradius" .3 "float focaldistance" 5 '
CROP = '"float cropwindow" [ 0.25 0.916 0.33 1 ]'  # 32 x 24 pixels


@pytest.mark.parametrize(
    ("ctm", "camera", "film", "pixel_filter"),
    [
        ("", EYE + WINDOW, "", '"box"'),
        ("Scale -1 1 1", EYE + WINDOW, CROP, '"gaussian"'),
        (SHEAR, EYE, "", '"box"'),
        (SHEAR, EYE + WINDOW, CROP, '"triangle" "float xradius" 1.2'),
        ("Transform [ .999 0 0 0  0 1.001 0 0  0 0 1 0  0 0 0 1 ]", EYE, "", '"box"'),
        ("", EYE + LENS, "", '"box"'),
        ("Scale -2 2 2", EYE + LENS + WINDOW, CROP, '"gaussian"'),
        ("", '"orthographic" ' + WIDE, "", '"gaussian"'),
        (SHEAR, '"orthographic" ' + WIDE, CROP, '"box"'),
    ],
)
@pytest.mark.usefixtures("mitsuba")
def test_windows_crops_lenses_and_stretching_cameras_agree(
    ctm: str, camera: str, film: str, pixel_filter: str
) -> None:
    scene = parse(SCENE.format(ctm=ctm, camera=camera, film=film, pixel_filter=pixel_filter))
    ours = render(scene, estimator="mis", spp=256, seed=3)
    reference = MitsubaBackend().render(scene, ReferenceRequest(spp=1024))
    pair = Pair(ours.image, ours.variance, reference.mean, reference.variance, 0.0)
    assert np.ptp(reference.mean.mean(axis=2)) > 0.1  # there is a shadow to be in the wrong place
    assert pair.disagreements() == []
    assert pair.disagreements(np.roll(ours.image, 1, axis=1))
    assert pair.disagreements(ours.image[:, ::-1])


def test_a_film_that_reaches_behind_the_camera_is_refused() -> None:
    """Sheared so far that half of the film lies behind the plane across its middle ray."""
    ctm = "Transform [ 1 0 3 0  0 1 0 0  0 0 1 0  0 0 0 1 ]"
    camera = EYE + '"float screenwindow" [ -9 9 -1 1 ]'
    why = MitsubaBackend().refuses(parse(SCENE.format(ctm=ctm, camera=camera, film="", pixel_filter='"box"')))
    assert why is not None and "behind" in why


@pytest.mark.parametrize(
    ("ctm", "camera", "word"),
    [(SHEAR, EYE + LENS, "stretches"), ("", '"orthographic" ' + LENS, "orthographic")],
)
def test_lenses_that_mitsuba_does_not_have_are_refused(ctm: str, camera: str, word: str) -> None:
    why = MitsubaBackend().refuses(parse(SCENE.format(ctm=ctm, camera=camera, film="", pixel_filter='"box"')))
    assert why is not None and word in why
