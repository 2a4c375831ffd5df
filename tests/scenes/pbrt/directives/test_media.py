"""Surfaces that light passes through, and media: what counts, what is refused, what is rendered instead."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.references.cache import reference_for
from pipeline.references.protocol import ReferenceRequest
from renderer import render
from scenes.errors import PenumbraError, SceneError
from scenes.pbrt.parser import parse
from tests.kit.scene_texts import HEAD, TRIANGLE

VOLUME = HEAD.replace('"path"', '"volpath"')
LIGHT = 'LightSource "point" "point3 from" [ 0 3 0 ]\n'
FLOOR = 'Shape "bilinearmesh" "point3 P" [ -5 0 -5  5 0 -5  -5 0 5  5 0 5 ]\n'
FOG = 'MakeNamedMedium "fog" "string type" "homogeneous"\n'
# Between the camera, the floor and the light, as every kind of shape, built here or not.
BOX = 'Shape "sphere" "float radius" 2 Shape "cylinder" Scale 1 2 1 Shape "sphere"'


@pytest.mark.parametrize(
    "shapes",
    [
        f'Material "interface" {BOX}',
        f'Material "" {BOX}',
        f'Material "none" "float nonsense" 1 {BOX}',
        f'MakeNamedMaterial "air" "string type" "interface" NamedMaterial "air" {BOX}',
        'NamedMaterial "air" Shape "sphere" MakeNamedMaterial "air" "string type" "interface"',
        f'ObjectBegin "o" Material "interface" {BOX} ObjectEnd ObjectInstance "o"',
        f'Material "interface" {TRIANGLE} {TRIANGLE} {TRIANGLE}',
        f'{FOG} MediumInterface "fog" "fog" Material "interface" {BOX}',
        f'{FOG} ObjectBegin "o" MediumInterface "fog" "" Material "interface" {BOX} ObjectEnd',
        FOG,
    ],
)
def test_light_passes_through_an_interface_to_the_bit(shapes: str) -> None:
    bare = parse(VOLUME + LIGHT + FLOOR)
    scene = parse(f"{VOLUME}{LIGHT}{FLOOR}AttributeBegin {shapes} AttributeEnd")
    assert scene.content_hash() == bare.content_hash()
    assert scene.notes == () == scene.substitutions
    lit = render(scene, spp=1).image
    assert lit.max() > 0 and np.array_equal(lit, render(bare, spp=1).image)


def test_the_area_light_of_an_interface_is_left_out_as_in_pbrt() -> None:
    lamp = 'AreaLightSource "diffuse" Material "interface" ' + TRIANGLE
    scene = parse(VOLUME + LIGHT + FLOOR + lamp)
    assert scene.content_hash() == parse(VOLUME + LIGHT + FLOOR).content_hash()
    assert len(scene.notes) == 1 and "is no area light" in scene.notes[0]


def test_an_integrator_without_media_lets_interfaces_block_delta_lights_in_pbrt() -> None:
    (note,) = parse(HEAD + LIGHT + FLOOR + 'Material "interface" Shape "sphere"').notes
    assert "block point, spot and distant lights" in note
    sky = 'LightSource "infinite"\n'
    assert parse(HEAD + sky + FLOOR + 'Material "interface" Shape "sphere"').notes == ()


MEDIA = [
    f'{FOG} MediumInterface "fog" "" Material "interface" Shape "sphere"',
    f'{FOG} MediumInterface "" "fog" {TRIANGLE}',
    f'{FOG} ObjectBegin "o" MediumInterface "fog" "" {TRIANGLE} ObjectEnd ObjectInstance "o"',
]


@pytest.mark.parametrize("shapes", MEDIA)
def test_a_medium_is_refused_or_rendered_as_empty_space(shapes: str, tmp_path: Path) -> None:
    text = VOLUME + LIGHT + FLOOR + shapes
    with pytest.raises(SceneError, match="a medium is not supported; --substitute renders"):
        parse(text)
    scene = parse(text, substitute=True)
    assert len(scene.substitutions) == 1 and "a medium: rendered as empty" in scene.substitutions[0]
    with pytest.raises(PenumbraError, match="a reference is of the file"):
        reference_for(scene, "mitsuba", ReferenceRequest(spp=1), tmp_path)
    assert parse(HEAD + LIGHT + FLOOR + shapes).notes  # pbrt's path integrator sees no medium


def test_a_camera_in_a_medium_is_refused_or_rendered_in_empty_space() -> None:
    text = FOG + 'MediumInterface "" "fog"\n' + VOLUME + 'MediumInterface ""\n' + LIGHT + FLOOR
    with pytest.raises(SceneError, match="a medium is not supported"):
        parse(text)
    assert parse(text, substitute=True).content_hash() == parse(VOLUME + LIGHT + FLOOR).content_hash()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (VOLUME + f'MediumInterface "fog" {TRIANGLE}', "no medium is called 'fog'"),
        (VOLUME + FOG + FOG, "made twice"),
        (VOLUME + 'MakeNamedMedium "fog"', 'needs "string type"'),
    ],
)
def test_a_wrong_medium_is_an_error(text: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        parse(text)


def test_strict_and_substitute_exclude_each_other() -> None:
    with pytest.raises(PenumbraError, match="strict and substitute"):
        parse(HEAD + FLOOR, strict=True, substitute=True)


def test_many_media_are_one_line_with_their_number() -> None:
    """Exporters name a medium a shape; a line each would hide what else is wrong."""
    made = "".join(f'MakeNamedMedium "m{i}" "string type" "cloud"\n' for i in range(60))
    used = "".join(f'MediumInterface "m{i}" "" {TRIANGLE}\n' for i in range(60))
    head = HEAD.replace('"path"', '"volpath"')
    with pytest.raises(SceneError, match=r"a medium is not supported; .* and 59 more") as caught:
        parse(head + made + used)
    assert "\n" not in str(caught.value)


CUBE = (
    'Shape "trianglemesh" "point3 P" [ -1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  -1 -1 1  1 -1 1  1 1 1  -1 1 1 ] '
    '"integer indices" [ 0 2 1  0 3 2  4 5 6  4 6 7  0 1 5  0 5 4  1 2 6  1 6 5  2 3 7  2 7 6 '
    "3 0 4  3 4 7 ] "
)
CORNER_NORMALS = '"normal N" [ -1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  -1 -1 1  1 -1 1  1 1 1  -1 1 1 ] '
WITHIN, AROUND = 'MediumInterface "fog" ""', 'MediumInterface "" "fog"'
GLASS = 'Material "dielectric" '


@pytest.mark.parametrize(
    "shell",
    [
        f'{WITHIN} {GLASS} Shape "sphere"',
        f'{AROUND} {GLASS} ReverseOrientation Shape "sphere"',
        f'{AROUND} {GLASS} Scale -1 1 1 Shape "sphere"',
        f"{WITHIN} {GLASS} {CUBE}",
        f"{WITHIN} {GLASS} {CUBE} {CORNER_NORMALS}",
        f"{WITHIN} {GLASS} {CUBE.replace('4 5 6', '4 4 5  4 5 6')} {CORNER_NORMALS}",
        f"{WITHIN} {GLASS} Scale 1 2 1 Rotate 30 1 2 3 {CUBE}",
        f"{AROUND} {GLASS} ReverseOrientation {CUBE}",
        f'{WITHIN} Material "coateddiffuse" {CUBE}',
        f'{WITHIN} {GLASS} {CUBE} Translate 9 9 9 MediumInterface "" AreaLightSource "diffuse" {CUBE}',
    ],
)
def test_a_medium_behind_a_closed_surface_is_of_no_effect(shell: str) -> None:
    scene = parse(f"{VOLUME}{LIGHT}{FLOOR}{FOG}{shell}", strict=True)
    bare = parse(f"{VOLUME}{LIGHT}{FLOOR}{shell.replace(WITHIN, '').replace(AROUND, '')}")
    assert scene.content_hash() == bare.content_hash()


@pytest.mark.parametrize(
    "shell",
    [
        f'{AROUND} {GLASS} Shape "sphere"',
        f"{WITHIN} {GLASS} ReverseOrientation {CUBE}",
        f"{WITHIN} {GLASS} {CUBE.replace('3 0 4  3 4 7', '3 0 4')}",
        f"{WITHIN} {GLASS} {CUBE.replace('3 0 4  3 4 7', '3 0 4  4 3 7')}",
        f"{WITHIN} {GLASS} {CUBE} {CORNER_NORMALS.replace('[ -1 -1 -1', '[ 1 1 1')}",
        f'{WITHIN} {GLASS} {CUBE} "float alpha" 0.5',
        f'{WITHIN} Material "interface" {CUBE}',
        f"{WITHIN} {GLASS} Scale 9 9 9 {CUBE}",
        f'{WITHIN} {GLASS} {CUBE} LightSource "point" "point3 from" [ 0.5 0 0 ]',
        f'{WITHIN} {GLASS} {CUBE} MediumInterface "" Scale .1 .1 .1 AreaLightSource "diffuse" {CUBE}',
        f'{WITHIN} {GLASS} AreaLightSource "diffuse" {CUBE}',
        f'{WITHIN} {GLASS} Shape "cylinder"',
    ],
)
def test_a_medium_that_direct_light_may_cross_is_refused(shell: str) -> None:
    with pytest.raises(SceneError, match="a medium is not supported"):
        parse(f"{VOLUME}{LIGHT}{FLOOR}{FOG}{shell}")


@pytest.mark.parametrize("material", ['"dielectric"', '"dielectric" "float roughness" .3', '"coateddiffuse"'])
def test_direct_light_crosses_no_closed_surface(material: str) -> None:
    """A black ball within is the thickest of all media: without it, the image is the same to the bit."""
    shell = f'LightSource "infinite" Material {material} Shape "sphere" '
    black = 'Material "diffuse" "rgb reflectance" [ 0 0 0 ] Shape "sphere" "float radius" 0.99'
    images = [render(parse(VOLUME + FLOOR + shell + more), spp=4).image for more in ("", black)]
    assert images[0].max() > 0 and np.array_equal(*images)
