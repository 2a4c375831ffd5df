"""What stands before WorldBegin: camera, film, filter, sampler, integrator, options."""

from __future__ import annotations

import re
from dataclasses import astuple

import numpy as np
import pytest

from scenes.description.scene import PixelFilter, SceneDescription
from scenes.errors import SceneError
from scenes.pbrt.parser import parse
from tests.kit.scene_texts import HEAD, fails

REST = 'Camera "perspective"\nWorldBegin\n'


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("", PixelFilter("gaussian", 1.5, 1.5, 0.5)),  # as pbrt
        ('PixelFilter "box"', PixelFilter("box", 0.5, 0.5)),
        ('PixelFilter "box" "float xradius" 1 "float yradius" 2', PixelFilter("box", 1.0, 2.0)),
        ('PixelFilter "triangle"', PixelFilter("triangle", 2.0, 2.0)),
        ('PixelFilter "gaussian"', PixelFilter("gaussian", 1.5, 1.5, 0.5)),
        (
            'PixelFilter "gaussian" "float xradius" 2 "float sigma" .75',
            PixelFilter("gaussian", 2.0, 1.5, 0.75),
        ),
    ],
)
def test_pixel_filters(line: str, expected: PixelFilter) -> None:
    for text in (f'{line}\nFilm "rgb"\n{REST}', f'Film "rgb"\n{line}\n{REST}'):
        assert astuple(parse(text).film.pixel_filter) == astuple(expected)


def test_a_filter_is_content() -> None:
    wide = parse('PixelFilter "gaussian"\n' + REST)
    assert wide.content_hash() != parse('PixelFilter "triangle"\n' + REST).content_hash()
    assert wide.content_hash() != parse('PixelFilter "gaussian" "float sigma" .6\n' + REST).content_hash()


@pytest.mark.parametrize(
    ("line", "estimator", "distance"),
    [
        (
            'Integrator "path" "integer maxdepth" 1 "string lightsampler" "power" "bool regularize" false',
            None,
            np.inf,
        ),
        ('Integrator "volpath" "integer maxdepth" 1', None, np.inf),
        ('Integrator "simplepath" "integer maxdepth" 1', None, np.inf),
        ('Integrator "simplepath" "integer maxdepth" 1 "bool samplelights" false', "bsdf", np.inf),
        (
            'Integrator "simplepath" "integer maxdepth" 1 "bool samplelights" false "bool samplebsdf" false',
            "hemisphere",
            np.inf,
        ),
        ('Integrator "ambientocclusion"', "ambient-occlusion", np.inf),
        (
            'Integrator "ambientocclusion" "bool cossample" false "float maxdistance" 2.5',
            "ambient-occlusion",
            2.5,
        ),
    ],
)
def test_integrators(line: str, estimator: str | None, distance: float) -> None:
    scene = parse(f"{line}\n{REST}")
    assert (scene.defaults.estimator, scene.occlusion_distance) == (estimator, distance)


@pytest.mark.parametrize("order", ["Sampler", "Integrator"])
def test_sampler_and_integrator_keep_each_other(order: str) -> None:
    lines = ['Sampler "sobol" "integer pixelsamples" 4', 'Integrator "ambientocclusion"']
    text = "\n".join(lines if order == "Sampler" else lines[::-1])
    assert astuple(parse(f"{text}\n{REST}").defaults) == ("sobol", 4, 0, "ambient-occlusion")


@pytest.mark.parametrize(
    "line",
    [
        'Film "rgb" "integer xresolution" 200 "integer yresolution" 100 "float cropwindow" [ 0 1 0 1 ]',
        (
            'Film "rgb" "integer xresolution" 200 "integer yresolution" 100 "integer pixelbounds" [ 0 '
            "200 0 100 ]"
        ),
        'Film "rgb" "integer xresolution" 200 "integer yresolution" 100 "float maxcomponentvalue" 1e7',
        (
            'Film "rgb" "integer xresolution" 200 "integer yresolution" 100 "string sensor" "cie1931" "float '
            'iso" 100'
        ),
    ],
)
def test_a_film_that_says_what_holds_anyway(line: str) -> None:
    plain = 'Film "rgb" "integer xresolution" 200 "integer yresolution" 100\n'
    window = (
        'Camera "perspective" "float screenwindow" [ -2 2 -1 1 ] "float shutteropen" 0 "float '
        'shutterclose" 1\n'
    )
    assert parse(f"{line}\n{window}WorldBegin").content_hash() == parse(plain + REST).content_hash()


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ('Sampler "independent" "integer pixelsamples" 64', ("independent", 64, 0)),
        ('Sampler "independent" "integer seed" [ 7 ]', ("independent", 4, 7)),
        ('Sampler "sobol" "string randomization" "owen"', ("sobol", 16, 0)),
        ('Sampler "zsobol" "integer pixelsamples" [ 4 ]', ("sobol", 4, 0)),
        ('Sampler "paddedsobol"', ("sobol", 16, 0)),
        ('Sampler "halton" "integer pixelsamples" 8 "string randomization" "permutedigits"', ("sobol", 8, 0)),
        ('Sampler "pmj02bn"', ("sobol", 16, 0)),
        ('Sampler "stratified"', ("stratified", 16, 0)),
        (
            'Sampler "stratified" "integer xsamples" 8 "integer ysamples" 2 "bool jitter" true',
            ("stratified", 16, 0),
        ),
        ('Sampler "stratified" "integer xsamples" [ 3 ] "integer seed" 5', ("stratified", 12, 5)),
    ],
)
def test_samplers(line: str, expected: tuple[str, int, int]) -> None:
    assert astuple(parse(f"{line}\n{HEAD}").defaults) == (*expected, None)


def test_defaults_are_no_part_of_the_content() -> None:
    assert parse('Sampler "sobol"\n' + HEAD).content_hash() == parse(HEAD).content_hash()


@pytest.mark.parametrize(
    ("line", "column", "words"),
    [
        ('Camera "realistic"', 1, ('"realistic"', "--substitute")),
        ('Camera "perspective" "float fov" 180', 22, ("180",)),
        ('Camera "perspective" "float fov" 0', 22, ("0",)),
        ('Camera "perspective" "float focaldistance" 0 "float lensradius" .1', 22, ("positive",)),
        ('Camera "perspective" "float screenwindow" [ -1 1 ]', 22, ("four numbers, not 2",)),
        ('Camera "perspective" "float shutterclose" -0.5', 22, ("open for -0.5",)),
        ('Film "tiles"', 1, ('"rgb"', '"gbuffer"')),
        ('Film "rgb" "integer xresolution" 0', 12, ("xresolution", "0")),
        ('Film "rgb" "integer yresolution" [ 100000 ]', 12, ("65535",)),
        ('Film "rgb" "integer xresolution" 10.5', 34, ("whole number",)),
        ('Film "rgb" "integer xresolution" 10.0', 34, ("whole number",)),  # pbrt reads no decimals there
        ('Film "rgb" "integer xresolution" 99999999999', 34, ("whole number",)),
        ('Film "rgb" "string sensor" "canon_eos_6d"', 12, ("canon_eos_6d", '"cie1931"')),
        ('Film "rgb" "float iso" 0', 12, ("iso must be positive",)),
        ('Film "rgb" "float exposuretime" 2', 12, ("exposuretime",)),
        ('PixelFilter "mitchell" "float B" 0.3', 1, ('"mitchell"', "--substitute")),
        ('PixelFilter "sinc"', 1, ('"sinc"', "--substitute")),
        ('PixelFilter "tent"', 1, ('unknown PixelFilter "tent"', '"box", "triangle", "gaussian"')),
        ('Film "rgb" "float cropwindow" [ 0 1 0 ]', 12, ("cropwindow is four numbers, not 3",)),
        ('Film "rgb" "integer pixelbounds" [ 1 ]', 12, ("pixelbounds is four numbers, not 1",)),
        ('Film "rgb" "float cropwindow" [ .5 .5 0 1 ]', 12, ("cropwindow leaves no pixel of 1280 x 720",)),
        ('Film "rgb" "integer pixelbounds" [ 2000 2010 0 9 ]', 12, ("pixelbounds leaves no pixel",)),
        ('Camera "perspective" "float screenwindow" [ -1 1 2 2 ]', 22, ("screenwindow has no area",)),
        ('PixelFilter "box" "float xradius" 0', 19, ("above 0",)),
        ('PixelFilter "gaussian" "float yradius" 100', 24, ("at most 16",)),
        ('PixelFilter "gaussian" "float sigma" 0', 24, ("sigma must be positive",)),
        ('PixelFilter "box" "float sigma" 1', 19, ('"float sigma"', '"float xradius"')),
        ('Sampler "random"', 1, ('"independent"', '"sobol"', '"halton"')),
        ('Sampler "stratified" "integer xsamples" 100000 "integer ysamples" 100000', 22, ("at most",)),
        ('Sampler "independent" "integer pixelsamples" 0', 23, ("at least 1",)),
        ('Sampler "independent" "string randomization" "owen"', 23, ("randomization",)),
        ('Sampler "independent" "integer seed" -1', 23, ("negative",)),
        ('Integrator "whitted" "integer maxdepth" 1', 1, ('"path"', '"ambientocclusion"')),
        ('Integrator "ambientocclusion" "float maxdistance" 0', 31, ("maxdistance must be positive",)),
        ('Option "disablepixeljitter" maybe', 1, ("true or false", "maybe")),
        ('Option "gloss" 1', 1, ('unknown Option "gloss"', "disablepixeljitter")),
        ("ActiveTransform Never", 1, ("All, StartTime or EndTime",)),
        ('MakeNamedMedium "fog" "string type" "smoke"', 23, ('MakeNamedMedium "fog"', '"homogeneous"')),
        ('Integrator "path" "integer maxdepth" 0', 19, ("maxdepth is 0", "emission alone")),
        ("AttributeBegin", 1, ("after WorldBegin",)),
        ('Shape "sphere"', 1, ("after WorldBegin",)),
        ("ReverseOrientation", 1, ("after WorldBegin",)),
        ('NamedMaterial "m"', 1, ("after WorldBegin",)),
    ],
)
def test_errors_before_the_world(line: str, column: int, words: tuple[str, ...]) -> None:
    camera = "" if line.startswith("Camera") else 'Camera "perspective"\n'
    fails(f"\n{line}\n{camera}WorldBegin\n", 2, column, *words)


@pytest.mark.parametrize(
    ("camera", "film"),
    [
        ('"float frameaspectratio" 1.7778', ""),  # of the default film, 16 / 9
        ('"float frameaspectratio" 0.5', '"integer xresolution" 10 "integer yresolution" 20'),
        ('"float screenwindow" [ -1 1 -2 2 ]', '"integer xresolution" 10 "integer yresolution" 20'),
        # the window decides
        (
            '"float frameaspectratio" 3 "float screenwindow" [ -1 1 -2 2 ]',
            '"integer xresolution" 10 "integer yresolution" 20',
        ),
    ],
)
def test_a_window_of_the_film_s_own_shape_changes_nothing(camera: str, film: str) -> None:
    text = f'Film "rgb" {film}\nCamera "perspective" {camera}\nWorldBegin\n'
    assert parse(text).content_hash() == parse(text.replace(camera, "")).content_hash()


def test_without_a_camera_it_is_pbrts_own() -> None:
    """A perspective camera of 90 degrees at the origin, whatever the transformation was."""
    assert (
        parse("Translate 1 2 3\nWorldBegin").content_hash()
        == parse('Camera "perspective"\nWorldBegin').content_hash()
    )


def test_of_an_option_given_twice_the_last_holds_as_in_pbrt() -> None:
    first = """
        Film "rgb" "integer xresolution" 3 Camera "perspective" "float fov" 3 PixelFilter "triangle"
        Integrator "ambientocclusion" "float maxdistance" 2 Sampler "stratified"
        """
    twice, once = parse(first + HEAD), parse(HEAD)
    assert twice.content_hash() == once.content_hash()
    assert (twice.defaults.estimator, once.defaults.estimator) == (None, None)


def test_film_in_another_colour_space_is_shown_in_srgb() -> None:
    scene = noted('ColorSpace "rec2020"\n' + HEAD, "rec2020", "linear sRGB")
    assert scene.content_hash() == parse(HEAD).content_hash()


@pytest.mark.parametrize("light", ["point", "spot", "distant"])
def test_without_light_sampling_pbrt_leaves_lights_out(light: str) -> None:
    line = 'Integrator "simplepath" "integer maxdepth" 1 "bool samplelights" false\n'
    text = HEAD.replace('Integrator "path" "integer maxdepth" [ 1 ]\n', line)
    assert text != HEAD
    fails(text + f'LightSource "{light}"', 5, 46, "samplelights", "take them out")
    assert parse(text + 'LightSource "infinite"').defaults.estimator == "bsdf"
    assert (
        parse(HEAD.replace("Integrator", line + "Integrator") + f'LightSource "{light}"').defaults.estimator
        is None
    )


def noted(text: str, *words: str) -> SceneDescription:
    """The scene, which is read with one note that has these words, and refused where `strict` asks for it."""
    scene = parse(text)
    (note,) = scene.notes
    for word in words:
        assert word in note, f"{word!r} is not in: {note}"
    with pytest.raises(SceneError, match=re.escape(note.split(" (<text>")[0])):
        parse(text, strict=True)
    return scene


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('Integrator "path" "integer maxdepth" 17', ("maxdepth is 17", "direct component", "<text>:1:19")),
        ('Integrator "volpath"', ("maxdepth is 5 (pbrt's default)", "<text>:1:1")),
        ('Integrator "bdpt" "integer maxdepth" 9', ('"bdpt"', "direct component")),
        ('Integrator "mlt" "integer chains" 100', ('"mlt"',)),
        ('Integrator "sppm" "float radius" .1', ('"sppm"',)),
        ('Integrator "directlighting" "string strategy" "all"', ('"directlighting"',)),
        ('Film "rgb" "string sensor" "canon_eos_5d"', ("canon_eos_5d", "imaging ratio holds")),
        ('Film "rgb" "float whitebalance" 5000', ("whitebalance is left out",)),
        ('Film "rgb" "float maxcomponentvalue" 10', ("maxcomponentvalue, 10", "bias")),
        ('Option "forcediffuse" true', ("forcediffuse", "left out")),
        ('Option "bool disablepixeljitter" true', ("disablepixeljitter", "left out")),
    ],
)
def test_what_pbrt_would_do_further_is_noted_and_changes_nothing(line: str, words: tuple[str, ...]) -> None:
    integrator = "" if line.startswith("Integrator") else 'Integrator "path" "integer maxdepth" 1\n'
    scene = noted(f"{line}\n{integrator}{REST}", *words)
    assert scene.content_hash() == parse('Integrator "path" "integer maxdepth" 1\n' + REST).content_hash()


def test_of_a_parameter_given_twice_the_last_one_holds_as_in_pbrt() -> None:
    twice = 'Film "rgb" "integer xresolution" 2 "integer xresolution" 1280\n'
    once = 'Integrator "path" "integer maxdepth" 1\n' + REST
    scene = parse(twice + once, strict=True)  # the image is pbrt's
    assert ["given twice to Film" in note for note in scene.notes] == [True]
    assert scene.content_hash() == parse(once).content_hash()


def test_notes_of_one_kind_are_one_line_with_their_number() -> None:
    body = 'Shape "sphere" "float radius" 1 "float radius" 2\n' * 3
    assert parse(HEAD + body).notes == (
        '"radius" is given twice to Shape: the last one holds, as in pbrt (<text>:7:33 and 2 more)',
    )


def test_regularisation_changes_no_direct_light() -> None:
    """pbrt makes BSDFs rougher behind the first bounce only."""
    line = 'Integrator "path" "integer maxdepth" 1 "bool regularize" true\n'
    assert parse(line + REST).notes == ()


@pytest.mark.parametrize(
    ("camera", "window"),
    [
        ('"float screenwindow" [ -1.2 1.2 -0.9 0.7 ]', [-1.2, 1.2, -0.9, 0.7]),
        ('"float screenwindow" [ 1.2 -1.2 0.7 -0.9 ]', [-1.2, 1.2, -0.9, 0.7]),  # pbrt sorts the ends
        ('"float frameaspectratio" 3', [-3, 3, -1, 1]),
        ('"float frameaspectratio" 0.5', [-1, 1, -2, 2]),
    ],
)
def test_a_window_of_the_screen(camera: str, window: list[float]) -> None:
    film = 'Film "rgb" "integer xresolution" 10 "integer yresolution" 8'
    scene = parse(f'{film}\nCamera "perspective" {camera}\nWorldBegin')
    assert scene.camera.window is not None
    assert scene.camera.window.tolist() == window


@pytest.mark.parametrize(
    ("crop", "size", "window"),
    [
        # A window in pixels of a film of 16 x 12, whose shorter side spans two units: a pixel is 1/6.
        ('"float cropwindow" [ 0.25 0.75 0 1 ]', (8, 12), [-4 / 6, 4 / 6, -1, 1]),
        ('"float cropwindow" [ 0.75 0.25 1 0 ]', (8, 12), [-4 / 6, 4 / 6, -1, 1]),
        (
            '"float cropwindow" [ -1 0.3 0 0.26 ]',
            (5, 4),
            [-8 / 6, -3 / 6, 2 / 6, 1],
        ),  # 4.8 and 3.12 rounded up
        ('"integer pixelbounds" [ 2 10 3 99 ]', (8, 9), [-1, 2 / 6, -1, 3 / 6]),
        ('"integer pixelbounds" [ 0 1 0 1 ] "float cropwindow" [ 0.5 1 0 1 ]', (8, 12), [0, 8 / 6, -1, 1]),
    ],
)
def test_a_crop_is_a_smaller_film_and_its_window(
    crop: str, size: tuple[int, int], window: list[float]
) -> None:
    film = f'Film "rgb" "integer xresolution" 16 "integer yresolution" 12 {crop}\n'
    scene = parse(film + REST)
    assert (scene.film.width, scene.film.height) == size
    np.testing.assert_allclose(scene.camera.window, window, rtol=0, atol=1e-15)


def test_shutter_and_iso_multiply_all_light() -> None:
    """pbrt's imaging ratio: seconds of exposure times ISO / 100."""
    world = """WorldBegin
        LightSource "point" "rgb I" [ 1 2 3 ]
        LightSource "spot" "rgb I" [ 1 2 3 ]
        LightSource "distant" "rgb L" [ 1 2 3 ]
        LightSource "infinite" "rgb L" [ 1 2 3 ]
        AreaLightSource "diffuse" "rgb L" [ 1 2 3 ]
        Shape "sphere"
        """
    shutter = '"float shutteropen" 1 "float shutterclose" 4'
    text = f'Film "rgb" "float iso" 200\nCamera "perspective" {shutter}\n{world}'
    scene, plain = parse(text), parse(f'Camera "perspective"\n{world}')
    emitted = [*(vars(light) for light in scene.lights), vars(scene.shapes[0].emission)]
    before = [*(vars(light) for light in plain.lights), vars(plain.shapes[0].emission)]
    for light, reference in zip(emitted, before, strict=True):
        (name,) = {"intensity", "irradiance", "radiance"} & set(light)
        np.testing.assert_array_equal(light[name], reference[name] * 6)
