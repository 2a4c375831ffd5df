"""What stands before WorldBegin: camera, film, filter, sampler, integrator, options."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest

from scenes.description.scene import PixelFilter
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
        ('Camera "orthographic"', 1, ('"perspective"',)),
        ('Camera "perspective" "float fov" 180', 22, ("180",)),
        ('Camera "perspective" "float fov" 0', 22, ("0",)),
        ('Camera "perspective" "float lensradius" .1', 22, ("pinhole",)),
        ('Camera "perspective" "float screenwindow" [ -1 1 -1 1 ]', 22, ("screenwindow", "-1.77778 1.77778")),
        ('Camera "perspective" "float screenwindow" [ -1 1 ]', 22, ("four numbers, not 2",)),
        ('Camera "perspective" "float frameaspectratio" 2', 22, ("frameaspectratio", "1.77778")),
        ('Camera "perspective" "float shutterclose" 0.5', 22, ("shutterclose", "1")),
        ('Film "gbuffer"', 1, ('"rgb"',)),
        ('Film "rgb" "integer xresolution" 0', 12, ("xresolution", "0")),
        ('Film "rgb" "integer yresolution" [ 100000 ]', 12, ("65535",)),
        ('Film "rgb" "integer xresolution" 10.5', 34, ("whole number",)),
        ('Film "rgb" "integer xresolution" 10.0', 34, ("whole number",)),  # pbrt reads no decimals there
        ('Film "rgb" "integer xresolution" 99999999999', 34, ("whole number",)),
        ('Film "rgb" "string sensor" "canon_eos_5d"', 12, ("sensor", '"cie1931"')),
        ('Film "rgb" "float iso" 200', 12, ("iso", "100")),
        ('Film "rgb" "float exposuretime" 2', 12, ("exposuretime",)),
        ('Film "rgb" "float maxcomponentvalue" 10', 12, ("maxcomponentvalue",)),
        ('Film "rgb" "float cropwindow" [ 0 .5 0 1 ]', 12, ("cropwindow",)),
        ('Film "rgb" "integer pixelbounds" [ 0 10 0 10 ]', 12, ("pixelbounds",)),
        ('PixelFilter "mitchell" "float B" 0.3', 1, ('"mitchell"', '"box", "triangle", "gaussian"')),
        ('PixelFilter "sinc"', 1, ('"sinc"', '"gaussian"')),
        ('Film "rgb" "float cropwindow" [ 0 1 0 ]', 12, ("cropwindow is four numbers, not 3",)),
        ('Film "rgb" "integer pixelbounds" [ 1 ]', 12, ("pixelbounds is four numbers, not 1",)),
        ('PixelFilter "box" "float xradius" 0', 19, ("above 0",)),
        ('PixelFilter "gaussian" "float yradius" 100', 24, ("at most 16",)),
        ('PixelFilter "gaussian" "float sigma" 0', 24, ("sigma must be positive",)),
        ('PixelFilter "box" "float sigma" 1', 19, ('"float sigma"', '"float xradius"')),
        ('Sampler "random"', 1, ('"independent"', '"sobol"', '"halton"')),
        ('Sampler "stratified" "bool jitter" false', 22, ("jitter must be true",)),
        ('Sampler "stratified" "integer xsamples" 100000 "integer ysamples" 100000', 22, ("at most",)),
        ('Sampler "independent" "integer pixelsamples" 0', 23, ("at least 1",)),
        ('Sampler "sobol" "string randomization" "none"', 17, ("owen",)),
        ('Sampler "independent" "string randomization" "owen"', 23, ("randomization",)),
        ('Sampler "independent" "integer seed" -1', 23, ("negative",)),
        ('Integrator "bdpt" "integer maxdepth" 1', 1, ('"path"', '"ambientocclusion"')),
        ('Integrator "path" "integer maxdepth" 1 "bool regularize" true', 40, ("regularize",)),
        ('Integrator "ambientocclusion" "float maxdistance" 0', 31, ("maxdistance must be positive",)),
        ('Option "forcediffuse" true', 1, ("forcediffuse", "not supported")),
        ('Option "bool disablepixeljitter" true', 1, ("disablepixeljitter", "not supported")),
        ('Option "disablepixeljitter" maybe', 1, ("true or false", "maybe")),
        ('Option "gloss" 1', 1, ('unknown Option "gloss"', "disablepixeljitter")),
        ("ActiveTransform EndTime", 1, ("nothing moves",)),
        ("ActiveTransform Never", 1, ("All, StartTime or EndTime",)),
        ('MediumInterface "fog"', 1, ('MediumInterface "fog"', "space is empty")),
        ('MakeNamedMedium "fog" "string type" "homogeneous"', 1, ('MakeNamedMedium "fog"',)),
        ('ColorSpace "aces2065-1"', 1, ("not supported", "srgb, rec2020, dci-p3")),
        ('ColorSpace "rec709"', 1, ("no colour space is called 'rec709'",)),
        ('Integrator "path" "integer maxdepth" 5', 19, ("maxdepth is 5",)),
        ('Integrator "path"', 1, ("maxdepth is 5 (pbrt's default)",)),
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


def test_film_in_another_colour_space_is_refused() -> None:
    fails('ColorSpace "rec2020"\n' + HEAD, 4, 1, "put ColorSpace behind Film")


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
