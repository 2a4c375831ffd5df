"""Surfaces with holes: what an alpha lets through, in view, in shadow and on lights that no ray meets."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.references.protocol import BACKENDS
from pipeline.self_reference import SelfBackend
from renderer import build, render
from renderer.plan.plan import make_plan
from scenes.description.scene import SceneDescription
from scenes.errors import SceneError
from scenes.hashing import hash_values
from scenes.pbrt.parser import parse, parse_file
from tests.kit.exported import written

SIDE = 24
ABOVE = f"""\
LookAt 0 6 0  0 0 0  0 0 1
Camera "perspective" "float fov" [ 30 ]
Film "rgb" "integer xresolution" [ {SIDE} ] "integer yresolution" [ {SIDE} ]
PixelFilter "box"
Integrator "path" "integer maxdepth" [ 1 ]
WorldBegin
"""
FLOOR = 'Shape "bilinearmesh" "point3 P" [ -9 0 -9  9 0 -9  -9 0 9  9 0 9 ]\n'
SUN = 'LightSource "distant" "point3 from" [ 0 1 0 ] "point3 to" [ 0 0 0 ] "rgb L" [ 3 3 3 ]\n'
SKY = 'LightSource "infinite" "rgb L" [ 1 1 1 ]\n'
BLACK = 'Material "diffuse" "rgb reflectance" [ 0 0 0 ]\n'
COUNT = 64
# A mean of so many draws of yes and no, each rightly drawn, is off by less in all but one of 16,000 cases.
WIDE = 4.0


def sheet(height: float, alpha: str, kind: str = "trianglemesh") -> str:
    """A sheet over all of the floor."""
    corners = f"-20 {height} -20  20 {height} -20  20 {height} 20  -20 {height} 20"
    if kind == "disk":
        return f'AttributeBegin Translate 0 {height} 0 Rotate 90 1 0 0 Shape "disk" "float radius" 30 {alpha}\nAttributeEnd\n'  # noqa: E501
    uv = '"point2 uv" [ 0 0  1 0  1 1  0 1 ]'
    return f'Shape "trianglemesh" "point3 P" [ {corners} ] {uv} "integer indices" [ 0 1 2 0 2 3 ] {alpha}\n'


def mean(scene: SceneDescription, estimator: str = "mis", **given: int) -> float:
    return float(render(scene, estimator=estimator, spp=COUNT, **given).image.mean())


def error(share: float) -> float:
    """The standard error of the mean share of rays, an image's worth of them."""
    return float(np.sqrt(share * (1 - share) / (COUNT * SIDE * SIDE)))


@pytest.mark.parametrize("kind", ["trianglemesh", "disk"])
@pytest.mark.parametrize(("alphas", "share"), [((0.3,), 0.7), ((0.3, 0.6), 0.28), ((0.5, 0.5, 0.5), 0.125)])
def test_shadow_rays_go_through_each_sheet_with_its_own_probability(
    alphas: tuple[float, ...], share: float, kind: str
) -> None:
    """Under the sun through sheets above the camera: 0.5 / pi times 3 times the product of 1 - alpha."""
    sheets = "".join(sheet(7 + i, f'"float alpha" {alpha}', kind) for i, alpha in enumerate(alphas))
    found = mean(parse(ABOVE + SUN + FLOOR + sheets)) * np.pi / 1.5
    assert abs(found - share) < WIDE * error(share)


@pytest.mark.parametrize(
    ("shape", "share"),
    [
        (sheet(3, '"float alpha" 0.25'), 0.75),
        (sheet(3, '"float alpha" 0.25') + sheet(2, '"float alpha" 0.5', "disk"), 0.375),
        (
            'Translate 0 -40 0 Shape "sphere" "float radius" 38 "float alpha" 0.4',
            0.36,
        ),
    ],
)
def test_camera_rays_go_through_and_meet_what_lies_behind(shape: str, share: float) -> None:
    """The white sky below black surfaces; a sphere is met twice."""
    scene = parse(ABOVE + SKY + BLACK + shape)
    assert abs(mean(scene) - share) < WIDE * error(share)


def test_what_lies_beyond_a_light_does_not_shade_it() -> None:
    """A shadow ray that went through a sheet has less of its way left, or it would meet the sheet above.

    A second lamp, too faint to count, keeps the plan from leaving that sheet out.
    """
    lamp = 'AttributeBegin AreaLightSource "diffuse" "rgb L" [ 9 9 9 ] "bool twosided" true\n'
    lamp += 'Shape "bilinearmesh" "point3 P" [ -1 4 -1  1 4 -1  -1 4 1  1 4 1 ]\nAttributeEnd\n'
    lamp += lamp.replace("9 9 9", "1e-9 1e-9 1e-9").replace(" 4 ", " 8 ")
    below = ABOVE.replace("LookAt 0 6 0", "LookAt 0 1 0") + FLOOR + lamp + sheet(2, '"float alpha" 0.5')
    alone, under = (parse(below + more) for more in ("", sheet(5, '"float alpha" 0.9')))
    one, other = (render(s, estimator="area", spp=4, seed=2).image for s in (alone, under))
    assert one.mean() > 0
    np.testing.assert_allclose(other, one, atol=1e-6 * one.mean())


def test_holes_of_a_texture_are_those_of_its_squares() -> None:
    """The sheet of a checkerboard's black squares is the sheets of its white ones."""
    board = 'Texture "holes" "float" "checkerboard" "float uscale" 2 "float vscale" 2\n'
    cut = parse(ABOVE + SUN + SKY + FLOOR + board + sheet(2, '"texture alpha" "holes"'))
    squares = "".join(
        f'Shape "bilinearmesh" "point3 P" [ {a} 2 {a}  {b} 2 {a}  {a} 2 {b}  {b} 2 {b} ]\n'
        for a, b in ((-20, 0), (0, 20))
    )
    whole = parse(ABOVE + SUN + SKY + FLOOR + squares)
    for estimator in ("mis", "ambient-occlusion"):
        one, other = (render(s, estimator=estimator, spp=4, seed=2).image for s in (cut, whole))
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
        assert len(np.unique(other.round(3))) >= 5


@pytest.mark.parametrize("estimator", ["mis", "bsdf", "solid-angle", "area", "analytic-visibility"])
@pytest.mark.parametrize(
    "light",
    [
        'Shape "bilinearmesh" "point3 P" [ -1 8 -1  1 8 -1  -1 8 1  1 8 1 ] ',
        'Translate 0 8 0 Shape "sphere" "float radius" 0.5 ',
    ],
)
def test_a_light_of_alpha_0_shines_and_is_never_met(light: str, estimator: str) -> None:
    """As pbrt has it: the floor is lit as by the whole light, and what lies behind the light is seen."""
    emits = 'AttributeBegin AreaLightSource "diffuse" "rgb L" [ 9 9 9 ] "bool twosided" true '
    whole = parse(ABOVE + FLOOR + emits + light + "AttributeEnd")
    hidden = parse(ABOVE + FLOOR + emits + light + '"float alpha" 0 AttributeEnd')
    wanted, found = (
        render(whole, estimator="solid-angle", spp=256),
        render(hidden, estimator=estimator, spp=256, seed=1),
    )
    noise = np.sqrt((wanted.variance + found.variance).mean() / SIDE**2)
    assert abs(found.image.mean() - wanted.image.mean()) < WIDE * noise + 1e-12
    assert noise < 5e-3 * wanted.image.mean()
    below = ABOVE.replace("LookAt 0 6 0", "LookAt 0 12 0")
    seen = render(parse(below + FLOOR + emits + light + '"float alpha" 0 AttributeEnd'), spp=4).image
    assert seen.max() < 9.0 / 2


def test_a_shape_of_alpha_0_is_left_out_and_one_of_alpha_1_is_whole() -> None:
    assert len(parse(ABOVE + SUN + FLOOR + sheet(2, '"float alpha" 0')).shapes) == 1
    assert parse(ABOVE + SUN + sheet(2, '"float alpha" 1')).shapes[0].alpha is None
    white = 'Texture "t" "float" "constant" "float value" 1\n'
    assert parse(ABOVE + SUN + white + sheet(2, '"texture alpha" "t"')).shapes[0].alpha is None


def test_the_image_does_not_hang_on_how_the_work_is_cut() -> None:
    scene = parse(
        ABOVE + SUN + SKY + FLOOR + sheet(2, '"float alpha" 0.5') + sheet(7, '"float alpha" 0.5', "disk")
    )
    one, other = (
        render(scene, spp=4, rows=rows, threads=threads) for rows, threads in ((2**14, 1), (777, 2))
    )
    assert np.array_equal(one.image, other.image)


def test_a_scene_without_alpha_does_nothing_for_it() -> None:
    holed = parse(ABOVE + SUN + FLOOR + sheet(7, '"float alpha" 0.5'))
    whole = replace(holed, shapes=tuple(replace(s, alpha=None) for s in holed.shapes))
    plans = [make_plan(build(scene)) for scene in (holed, whole)]
    assert [plan.shadow_cutouts is None for plan in plans] == [False, True]
    told = [d.needed for plan in plans for d in plan.decisions if d.effect == "holes in surfaces"]
    assert told == [True, False]


@pytest.mark.parametrize("backend", ["closed-form", "mitsuba"])
def test_a_reference_that_cannot_have_holes_refuses_them(backend: str) -> None:
    light = 'AreaLightSource "diffuse" Shape "bilinearmesh" "point3 P" [ -1 8 -1  1 8 -1  -1 8 1  1 8 1 ] '
    unseen = parse(ABOVE + FLOOR + light + '"float alpha" 0')
    assert "alpha" in str(BACKENDS[backend].refuses(unseen))
    holed = parse(ABOVE + SUN + FLOOR + sheet(7, '"float alpha" 0.5'))
    assert BACKENDS[backend].refuses(holed) is not None
    assert SelfBackend().refuses(holed) is None


def test_a_light_that_is_partly_there_is_refused_or_rendered_whole() -> None:
    text = ABOVE + 'AreaLightSource "diffuse"\n' + sheet(7, '"float alpha" 0.5')
    with pytest.raises(SceneError, match=r"8:.*alpha of an area light that is not 0 is not supported"):
        parse(text)
    scene = parse(text, substitute=True)
    assert scene.shapes[0].alpha is None
    assert len(scene.substitutions) == 1


def test_alpha_is_written_and_read_back(tmp_path: Path) -> None:
    board = 'Texture "holes" "float" "checkerboard" "float uscale" 2\n'
    scene = parse(
        ABOVE + SUN + FLOOR + board + sheet(2, '"texture alpha" "holes"') + sheet(3, '"float alpha" 0.5')
    )
    again = parse_file(written(scene, tmp_path))
    assert [hash_values(shape) for shape in again.shapes] == [hash_values(shape) for shape in scene.shapes]


@pytest.mark.parametrize(
    "texture",
    [
        '"directionmix" "float tex1" .3 "float tex2" 1',
        '"checkerboard" "integer dimension" 3 "float tex1" 1 "float tex2" .3',
    ],
)
def test_an_alpha_may_look_at_points_and_normals(texture: str) -> None:
    """Of a sheet across the direction, and in an odd cell of the solid checkerboard, it is 0.3."""
    made = (
        f'AttributeBegin Translate -90 6.5 -90 Scale 180 1 180 Texture "t" "float" {texture} AttributeEnd\n'
    )
    sheets = made.replace("6.5", "6.5" if "direction" in texture else "5.5") + sheet(7, '"texture alpha" "t"')
    found = mean(parse(ABOVE + SUN + FLOOR + sheets)) * np.pi / 1.5
    assert abs(found - 0.7) < WIDE * error(0.7)
