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
    used = "".join(f'MediumInterface "m{i}" "" Shape "sphere"\n' for i in range(60))
    head = HEAD.replace('"path"', '"volpath"')
    with pytest.raises(SceneError, match=r"a medium is not supported; .* and 59 more") as caught:
        parse(head + made + used)
    assert "\n" not in str(caught.value)
