"""Mixes of materials: the share of each in closed form, choices without chance to the bit, text and back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.references.mitsuba.surfaces import bsdf
from renderer import render
from renderer.build import build
from renderer.interfaces.material import Lobes, lobes_of
from renderer.math.vectors import normalize
from renderer.records import SurfaceHit
from scenes.description.materials import Conductor, Diffuse, MixedMaterial
from scenes.description.scene import SceneDescription
from scenes.errors import SceneError
from scenes.pbrt.parser import parse
from scenes.pbrt.write.scene import to_pbrt
from tests.kit.scene_texts import world, world_fails

HEAD = """LookAt 0 0 5  0 0 0  0 1 0
Camera "perspective" "float fov" [ 20 ] Sampler "independent" "integer pixelsamples" [ 1 ]
Film "rgb" "integer xresolution" [ {size} ] "integer yresolution" [ {size} ]
Integrator "path" "integer maxdepth" [ 1 ]
WorldBegin
LightSource {light} "rgb L" [ 3 2 1 ]
MakeNamedMaterial "red" "string type" "diffuse" "rgb reflectance" [ .8 .2 .4 ]
MakeNamedMaterial "blue" "string type" "diffuse" "rgb reflectance" [ .1 .3 .5 ]
MakeNamedMaterial "pane" "string type" "thindielectric"
MakeNamedMaterial "gold" "string type" "conductor" "float roughness" .1
MakeNamedMaterial "nest" "string type" "mix" "string materials" [ "blue" "gray" ] "float amount" 0.3
MakeNamedMaterial "gray" "string type" "diffuse" "rgb reflectance" [ .6 .6 .6 ]
Texture "checks" "float" "checkerboard" "float uscale" 5 "float vscale" 3 "float tex1" 0 "float tex2" 1
Texture "colours" "spectrum" "checkerboard" "float uscale" 5 "float vscale" 3
    "rgb tex1" [ .8 .2 .4 ] "rgb tex2" [ .1 .3 .5 ]
"""
RED, BLUE, GRAY, L = (
    np.array([0.8, 0.2, 0.4]),
    np.array([0.1, 0.3, 0.5]),
    np.full(3, 0.6),
    np.array([3, 2, 1]),
)
DISTANT = '"distant" "point3 from" [ 0 0 1 ] "point3 to" [ 0 0 0 ]'
DISK = ' Shape "disk" "float radius" 9 '
COUNT = 8 * 8 * 512


def scene(material: str, light: str = DISTANT, size: int = 8) -> SceneDescription:
    return parse(HEAD.format(size=size, light=light) + material + DISK)


def mix_of(first: str, second: str, amount: str) -> str:
    return f'Material "mix" "string materials" [ "{first}" "{second}" ] {amount}'


@pytest.mark.parametrize("estimator", ["mis", "cosine", "solid-angle", "bsdf"])
@pytest.mark.parametrize(
    ("second", "amount", "parts"),
    [
        ("blue", "", [(0.5, RED), (0.5, BLUE)]),  # pbrt's default
        ("blue", '"float amount" 0.2', [(0.8, RED), (0.2, BLUE)]),
        ("nest", '"float amount" 0.4', [(0.6, RED), (0.4 * 0.7, BLUE), (0.4 * 0.3, GRAY)]),
    ],
)
def test_each_material_has_its_share(second: str, amount: str, parts: list, estimator: str) -> None:
    """A distant light along the normal shows L R / pi of each; the choice alone is random.

    A share that is off by 0.013 would have been told.
    """
    given = scene(mix_of("red", second, amount))
    result = render(given, estimator=estimator, spp=COUNT // 64)
    mean = sum(share * colour for share, colour in parts)
    spread = np.sqrt(sum(share * (colour - mean) ** 2 for share, colour in parts))
    found = result.image.mean(axis=(0, 1))
    assert (np.abs(found * np.pi / L - mean) < 4.5 * spread / np.sqrt(COUNT)).all()
    np.testing.assert_allclose(
        result.variance.mean(axis=(0, 1)) * (COUNT // 64), (spread * L / np.pi) ** 2, rtol=0.1
    )


@pytest.mark.parametrize("estimator", ["mis", "cosine", "environment", "bsdf"])
def test_delta_lobes_and_transmission_count_for_the_points_that_have_them(estimator: str) -> None:
    """Under a constant sky the pane, which reflects and transmits all, shows L, and the red disk L R.

    A bias of 4.5 % would have been told.
    """
    given = scene(mix_of("red", "pane", '"float amount" 0.25'), light='"infinite"')
    assert lobes_of(given.shapes[0]) == (
        Lobes.REFLECTION | Lobes.TRANSMISSION | Lobes.DIFFUSE | Lobes.SPECULAR
    )
    result = render(given, estimator=estimator, spp=256)
    error = np.sqrt(result.variance.mean(axis=(0, 1)) / 64)
    found = result.image.mean(axis=(0, 1))
    assert (np.abs(found - (0.75 * RED + 0.25) * L) < 4.5 * error).all() and (error < 0.01 * found).all()


@pytest.mark.parametrize(
    ("mixed", "alone"),
    [
        (mix_of("red", "gold", '"float amount" 0'), 'NamedMaterial "red"'),
        (mix_of("gold", "blue", '"float amount" 1'), 'NamedMaterial "blue"'),
        (mix_of("gold", "nest", '"float amount" -3'), 'NamedMaterial "gold"'),
        (
            mix_of("red", "blue", '"texture amount" "checks"'),
            'Material "diffuse" "texture reflectance" "colours"',
        ),
    ],
    ids=["0", "1", "below 0", "checks"],
)
def test_a_choice_without_chance_is_the_chosen_material_to_the_bit(mixed: str, alone: str) -> None:
    images = [render(scene(one, '"infinite"'), estimator="mis", spp=4).image for one in (mixed, alone)]
    np.testing.assert_array_equal(*images)


def test_points_choose_alone_and_nested_choices_are_independent() -> None:
    """The bits of a choice do not depend on the batch; of two equal mixes within one another both matter."""
    given = parse(
        HEAD.format(size=1, light=DISTANT)
        + 'MakeNamedMaterial "half" "string type" "mix" "string materials" [ "red" "blue" ] '
        + mix_of("half", "half", "")
        + DISK
    )
    built = build(given)
    assert built.mixtures is not None and len(built.materials) == 1
    assert built.material_of.tolist() == [-1, -1, -1, 0, 0, 0, 0]
    rng, n = np.random.default_rng(4), 40_000
    none, up = np.zeros(n, dtype=np.int64), np.repeat([[0.0], [0.0], [1.0]], n, axis=1)
    wo = normalize(rng.normal(size=(3, n)))
    hit = SurfaceHit(rng.normal(size=(3, n)), up, wo, none, none, none, np.zeros((2, 1)))
    row = built.mixtures.rows(hit)
    counts = np.bincount(row, minlength=7)
    assert counts[:3].tolist() == [0, 0, 0]
    assert (np.abs(counts[3:] - n / 4) < 4.5 * np.sqrt(n * 3 / 16)).all()
    some = np.arange(0, n, 997)
    np.testing.assert_array_equal(built.mixtures.rows(hit.take(some)), row[some])


@pytest.mark.parametrize("moved", ["p", "wo"])
def test_a_choice_is_of_the_point_and_of_the_direction(moved: str) -> None:
    """A change of either by 1e-9 draws anew: of 4,000 choices of even chance half change, +-4.5 sigma."""
    built = build(parse(HEAD.format(size=1, light=DISTANT) + mix_of("red", "blue", "") + DISK))
    assert built.mixtures is not None
    n = 4000
    none, up = np.zeros(n, dtype=np.int64), np.repeat([[0.0], [0.0], [1.0]], n, axis=1)
    rng = np.random.default_rng(6)
    hit = SurfaceHit(rng.normal(size=(3, n)), up, rng.normal(size=(3, n)), none, none, none, np.zeros((2, 1)))
    other = replace(hit, p=hit.p + 1e-9) if moved == "p" else replace(hit, wo=hit.wo + 1e-9)
    changed = (built.mixtures.rows(hit) != built.mixtures.rows(other)).mean()
    assert abs(changed - 0.5) < 4.5 * 0.5 / np.sqrt(n)


def test_a_scene_without_mixes_has_none() -> None:
    assert build(scene('NamedMaterial "red"')).mixtures is None


@pytest.mark.parametrize("amount", ["", '"texture amount" "checks"', '"float amount" 0.125'])
def test_a_mix_is_written_and_read_back(amount: str) -> None:
    given = scene(mix_of("nest", "gold", amount) + DISK + mix_of("red", "blue", ""))
    again = parse(to_pbrt(given))
    images = [render(one, estimator="mis", spp=2, seed=3).image for one in (given, again)]
    np.testing.assert_array_equal(*images)
    material = again.shapes[0].material
    assert isinstance(material, MixedMaterial) and isinstance(material.first, MixedMaterial)
    assert material.needs_uv == ("texture" in amount)


MAKE = 'MakeNamedMaterial "m" "string type" "mix" "string materials" '


@pytest.mark.parametrize(
    ("body", "column", "words"),
    [
        ('Material "mix" "string materials" [ "a" ]', 16, ("two names, not 1",)),
        ('Material "mix"', 1, ("two names, not 0",)),
        ('Material "mix" "string materials" [ "a" "b" ]' + DISK, 16, ("no material is called 'a'",)),
        (f'{MAKE}[ "m" "m" ] NamedMaterial "m" {DISK}', 43, ("'m' is made of itself",)),
        (
            'Material "mix" "string materials" [ "i" "i" ] MakeNamedMaterial "i" "string type" "interface"'
            + DISK,
            16,
            ("interface",),
        ),
        ('Material "mix" "texture amount" "t" "string materials" [ "d" "d" ] '
         f'MakeNamedMaterial "d" "string type" "diffuse" {DISK}', 16, ("no float texture is called 't'",)),
    ],
)  # fmt: skip
def test_mixes_that_cannot_be_are_refused_where_they_stand(
    body: str, column: int, words: tuple[str, ...]
) -> None:
    world_fails(body, 1, column, *words)


def test_mixes_are_nested_six_deep_at_most() -> None:
    """Each level doubles the materials: 2^6 at most."""
    text = 'MakeNamedMaterial "0" "string type" "diffuse" '
    text += " ".join(
        f'MakeNamedMaterial "{i + 1}" "string type" "mix" "string materials" [ "{i}" "{i}" ]'
        for i in range(40)
    )
    assert isinstance(world(f'{text} NamedMaterial "5" {DISK}').shapes[0].material, MixedMaterial)
    with pytest.raises(SceneError, match="6 deep at most"):
        world(f'{text} NamedMaterial "40" {DISK}')


def test_one_colour_is_drawn_and_colours_are_changed() -> None:
    mix = MixedMaterial(Diffuse(RED), Diffuse(BLUE), np.full(3, 0.25))
    np.testing.assert_allclose(mix.normal_reflectance, 0.75 * RED + 0.25 * BLUE)
    changed = mix.map_colors(lambda colour: 0.5 * colour)
    np.testing.assert_allclose(changed.normal_reflectance, 0.5 * mix.normal_reflectance)


def test_mitsuba_is_given_mixes_of_diffuse_materials_as_one_and_no_others() -> None:
    red, blue = Diffuse(np.array([0.8, 0.2, 0.0])), Diffuse(np.array([0.0, 0.2, 0.4]))
    half = np.full(3, 0.5)
    plugin = bsdf(MixedMaterial(red, MixedMaterial(red, blue, half), half), np.eye(3), None)
    reflectance = plugin.values["one"].values["reflectance"]
    np.testing.assert_allclose(reflectance, [0.6, 0.2, 0.1])  # 0.75 red and 0.25 blue
    with pytest.raises(SceneError, match="MixedMaterial of diffuse"):
        bsdf(MixedMaterial(red, Conductor(np.ones(3), np.ones(3), 0.1), half), np.eye(3), None)
