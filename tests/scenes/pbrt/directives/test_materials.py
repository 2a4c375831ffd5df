"""`Material`: diffuse and conductors with pbrt-v4's defaults, and what of them is refused."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import color as colours
from scenes.description.materials import Coated, Conductor, Dielectric, Diffuse, Material
from tests.kit.scene_texts import world, world_fails

BALL = ' Shape "sphere"'


def material_of(body: str) -> Material:
    return world(body + BALL).shapes[0].material


def conductor(parameters: str) -> Conductor:
    material = material_of(f'Material "conductor" {parameters}')
    assert isinstance(material, Conductor)
    return material


def reflectance(parameters: str) -> np.ndarray:
    material = material_of(f'Material "diffuse" {parameters}')
    assert isinstance(material, Diffuse)
    assert isinstance(material.reflectance, np.ndarray)
    return material.reflectance


def test_a_diffuse_reflectance_may_be_a_spectrum() -> None:
    assert reflectance("").tolist() == [0.5, 0.5, 0.5]
    np.testing.assert_allclose(reflectance('"spectrum reflectance" [ 300 0.25 900 0.25 ]'), 0.25, atol=1e-12)
    ramp = reflectance('"spectrum reflectance" [ 360 0 830 1 ]')
    np.testing.assert_array_equal(ramp, colours.sampled([360.0, 830.0], [0.0, 1.0], role="reflectance"))


@pytest.mark.parametrize(
    ("parameters", "alpha"),
    [
        ('"float roughness" 0.25', 0.5),  # pbrt's RoughnessToAlpha is the square root
        ('"float roughness" 0.25 "bool remaproughness" false', 0.25),
        ('"float roughness" 0.25 "bool remaproughness" "false"', 0.25),
        ('"float uroughness" 0.09 "float vroughness" 0.09', 0.3),
        ('"float roughness" 0.09 "float vroughness" 0.09', 0.3),
        ('"float roughness" 0.001 "bool remaproughness" false', 0.001),
        ('"float roughness" 1e-6', 0.001),
        ("", 0.0),  # smooth, as pbrt's default
        ('"float roughness" 0', 0.0),
        ('"float roughness" 9e-4 "bool remaproughness" false', 0.0),  # pbrt takes it for smooth
    ],
)
def test_roughness_of_a_conductor(parameters: str, alpha: float) -> None:
    assert conductor(parameters).alpha == pytest.approx(alpha, rel=1e-15)


@pytest.mark.parametrize(
    ("parameters", "alpha", "alpha_v"),
    [
        ('"float uroughness" 0.04 "float vroughness" 0.09', 0.2, 0.3),
        ('"float roughness" 0.04 "float vroughness" 0.09', 0.2, 0.3),
        ('"float uroughness" 0.3 "bool remaproughness" false', 0.3, 1e-4),  # the other is 0, and held up
        ('"float uroughness" 9e-4 "float vroughness" 5e-4 "bool remaproughness" false', 0.0, None),
    ],
)
def test_roughness_may_differ_along_and_across(parameters: str, alpha: float, alpha_v: float | None) -> None:
    glass = material_of(f'Material "dielectric" {parameters}')
    assert isinstance(glass, Dielectric)
    for found in (conductor(parameters), glass):
        assert found.alpha == pytest.approx(alpha, rel=1e-15)
        assert found.alpha_v == (alpha_v and pytest.approx(alpha_v, rel=1e-15))


def test_copper_is_the_default() -> None:
    found, named = (
        conductor('"float roughness" 1'),
        conductor('"float roughness" 1 "spectrum eta" "metal-Cu-eta" "spectrum k" "metal-Cu-k"'),
    )
    eta, k = colours.metal("metal-Cu")
    for material in (found, named):
        np.testing.assert_array_equal(material.eta, eta)
        np.testing.assert_array_equal(material.k, k)


def test_metals_by_name_by_samples_and_by_three_numbers() -> None:
    gold = conductor('"float roughness" 1 "spectrum eta" "metal-Au-eta" "spectrum k" "metal-Au-k"')
    np.testing.assert_array_equal(gold.k, colours.metal("metal-Au")[1])
    plain = conductor('"float roughness" 1 "rgb eta" [ .2 .9 1.1 ] "rgb k" [ 3.9 2.4 2.2 ]')
    assert (plain.eta.tolist(), plain.k.tolist()) == ([0.2, 0.9, 1.1], [3.9, 2.4, 2.2])
    flat = conductor('"float roughness" 1 "spectrum eta" [ 300 1.5 900 1.5 ] "spectrum k" [ 300 2 900 2 ]')
    np.testing.assert_allclose(flat.eta, 1.5, rtol=1e-9)
    np.testing.assert_allclose(flat.k, 2, rtol=1e-9)
    mixed = conductor('"float roughness" 1 "rgb eta" [ 1 1 1 ]')
    np.testing.assert_array_equal(mixed.k, colours.named("metal-Cu-k", role="unbounded"))


def test_a_conductor_by_its_reflectance() -> None:
    """At normal incidence the Fresnel reflectance of eta + i k is what was asked for."""
    found = conductor('"float roughness" 1 "rgb reflectance" [ .2 .5 .9 ]')
    r = ((found.eta - 1) ** 2 + found.k**2) / ((found.eta + 1) ** 2 + found.k**2)
    np.testing.assert_allclose(r, [0.2, 0.5, 0.9], rtol=1e-12)


def test_named_conductors() -> None:
    make = 'MakeNamedMaterial "m" "string type" "conductor" "float roughness" 0.04 NamedMaterial "m"'
    material = material_of(make)
    assert isinstance(material, Conductor)
    assert material.alpha == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("body", "column", "words"),
    [
        ('Material "diffusetransmission" "texture transmittance" "t"' + BALL, 32, ("no spectrum",)),
        ('Material "diffusetransmission" "rgb transmittance" [ 1 2 ]', 32, ("transmittance",)),
        ('Material "dielectric" "float eta" 0', 23, ("eta must be positive",)),
        ('Material "dielectric" "spectrum eta" "glass-XY7"', 23, ("glass-BK7", "glass-F11")),
        ('Material "conductor" "float roughness" -1', 22, ("roughness must not be negative",)),
        ('Material "conductor" "float roughness" 1 "rgb reflectance" [ 1 1 2 ]', 42, ("at most 1",)),
        (('Material "conductor" "float roughness" 1 "rgb reflectance" [ 1 1 1 ] "rgb k" '
'[ 1 1 1 ]'), 42, ("not both",)),
        ('Material "conductor" "float roughness" 1 "rgb eta" [ 0 1 1 ]', 42, ("eta must be positive",)),
        ('Material "conductor" "float roughness" 1 "spectrum eta" "metal-Xx-eta"', 42, ("metal-Xx-eta",)),
        ('Material "conductor" "texture eta" "t"', 22, ('"texture eta"', "--substitute")),
        ('Material "diffuse" "string normalmap" "t.png"', 20, ("no such image file",)),
        ('MakeNamedMaterial "m" "string type" "hair"', 1, ('"hair"',)),
        ('Material "coateddiffuse" "integer nsamples" 0', 26, ("nsamples must be at least 1",)),
        ('Material "coateddiffuse" "float eta" -1', 26, ("eta must be positive",)),
        ('Material "coateddiffuse" "float roughness" -1', 26, ("roughness must not be negative",)),
        ('Material "coatedconductor" "float roughness" 0.1', 28, ('"float roughness" is not supported',)),
        ('Material "coatedconductor" "float interface.vroughness" -1', 28, ("interface.vroughness",)),
        (('Material "coatedconductor" "float g" 0 "rgb reflectance" [ 1 1 1 ] '
'"rgb conductor.k" [ 1 1 1 ]'), 40, ("not both",)),
        (('MakeNamedMaterial "m" "string type" "diffuse" MakeNamedMaterial "m" "string type" '
'"diffuse"'), 47, ("made twice",)),
    ],
)  # fmt: skip
def test_materials_that_cannot_be_are_refused_where_they_stand(
    body: str, column: int, words: tuple[str, ...]
) -> None:
    world_fails(body, 1, column, *words)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('"dielectric"', (1.5, 0.0, False)),
        ('"dielectric" "float eta" 1.33', (1.33, 0.0, False)),
        ('"dielectric" "float roughness" 0.25', (1.5, 0.5, False)),
        (
            '"dielectric" "float uroughness" 0.2 "float vroughness" 0.2 "bool remaproughness" false',
            (1.5, 0.2, False),
        ),
        ('"thindielectric" "float eta" 1.4', (1.4, 0.0, True)),
    ],
)
def test_glass(text: str, expected: tuple[float, float, bool]) -> None:
    glass = material_of(f"Material {text}")
    assert isinstance(glass, Dielectric)
    assert (glass.eta, glass.alpha, glass.thin) == pytest.approx(expected, rel=1e-15)


def test_a_glass_by_its_name_is_noted_to_have_no_dispersion() -> None:
    scene = world('Material "dielectric" "spectrum eta" "glass-BK7"' + BALL)
    glass = scene.shapes[0].material
    assert isinstance(glass, Dielectric) and glass.eta == 1.5168
    assert len(scene.notes) == 1 and "dispersion of glass-BK7 is left out" in scene.notes[0]


def coated(body: str) -> Coated:
    material = material_of(body)
    assert isinstance(material, Coated)
    return material


def test_a_coat_has_pbrts_defaults() -> None:
    varnish = coated('Material "coateddiffuse"')
    assert isinstance(varnish.base, Diffuse)
    np.testing.assert_array_equal(varnish.base.reflectance, np.full(3, 0.5))
    assert (varnish.coat.eta, varnish.coat.alpha, varnish.coat.alpha_v) == (1.5, 0.0, None)
    assert (varnish.thickness, varnish.g, varnish.max_depth, varnish.samples) == (0.01, 0.0, 10, 1)
    assert not varnish.albedo.any() and not varnish.needs_uv
    metal = coated('Material "coatedconductor"')
    bare = conductor("")
    assert isinstance(metal.base, Conductor)
    np.testing.assert_array_equal([metal.base.eta, metal.base.k], [bare.eta, bare.k])
    assert (metal.base.alpha, metal.coat.alpha, metal.coat.eta) == (0.0, 0.0, 1.5)


@pytest.mark.parametrize(
    "body",
    [
        'Material "coateddiffuse" "rgb reflectance" [ .1 .2 .3 ] "float roughness" 0.04',
        'MakeNamedMaterial "v" "string type" "coateddiffuse" "rgb reflectance" [ .1 .2 .3 ] '
        '"float roughness" 0.04 NamedMaterial "v"',
        'Texture "t" "spectrum" "constant" "rgb value" [ .1 .2 .3 ] '
        'Material "coateddiffuse" "texture reflectance" "t" "float roughness" 0.04',
        'Texture "t" "spectrum" "constant" "rgb value" [ .1 .2 .3 ] '
        'MakeNamedMaterial "v" "string type" "coateddiffuse" "texture reflectance" "t" '
        '"float uroughness" 0.04 "float vroughness" 0.04 NamedMaterial "v"',
    ],
)
def test_a_coat_lies_over_whatever_is_diffuse(body: str) -> None:
    varnish = coated(body)
    assert isinstance(varnish.base, Diffuse)
    np.testing.assert_array_equal(varnish.base.reflectance, [0.1, 0.2, 0.3])
    assert varnish.coat.alpha == pytest.approx(0.2)


def test_a_checkerboard_may_lie_under_a_coat() -> None:
    varnish = coated(
        'Texture "t" "spectrum" "checkerboard" Material "coateddiffuse" "texture reflectance" "t"'
    )
    assert varnish.needs_uv


def test_all_of_a_coat_is_read() -> None:
    varnish = coated(
        'Material "coateddiffuse" "spectrum reflectance" [ 300 0.25 900 0.25 ] "float uroughness" 0.04 '
        '"float vroughness" 0.09 "bool remaproughness" false "float thickness" 0.2 "float eta" 1.3 '
        '"float g" 2 "rgb albedo" [ .5 .6 .7 ] "integer maxdepth" 20 "integer nsamples" 4'
    )
    assert (varnish.coat.alpha, varnish.coat.alpha_v, varnish.coat.eta) == (0.04, 0.09, 1.3)
    assert (varnish.thickness, varnish.g, varnish.max_depth, varnish.samples) == (0.2, 1.0, 20, 4)
    np.testing.assert_array_equal(varnish.albedo, [0.5, 0.6, 0.7])


def test_all_of_a_coated_metal_is_read() -> None:
    """A roughness without a prefix is no parameter of it, as in pbrt."""
    metal = coated(
        'Material "coatedconductor" "float interface.roughness" 0.04 "spectrum interface.eta" "glass-BK7" '
        '"float conductor.uroughness" 0.25 "float conductor.vroughness" 0.09 "spectrum conductor.eta" '
        '"metal-Al-eta" "spectrum conductor.k" "metal-Al-k"'
    )
    bare = conductor('"spectrum eta" "metal-Al-eta" "spectrum k" "metal-Al-k"')
    assert isinstance(metal.base, Conductor)
    np.testing.assert_array_equal([metal.base.eta, metal.base.k], [bare.eta, bare.k])
    assert (metal.base.alpha, metal.base.alpha_v) == pytest.approx((0.5, 0.3))
    assert (metal.coat.alpha, metal.coat.eta) == pytest.approx((0.2, 1.5168))
    gray = coated('Material "coatedconductor" "rgb reflectance" [ .7 .7 .7 ]')
    assert isinstance(gray.base, Conductor)
    np.testing.assert_array_equal(gray.base.k, conductor('"rgb reflectance" [ .7 .7 .7 ]').k)


@pytest.mark.parametrize(
    ("body", "noted"),
    [
        ('Material "coateddiffuse" "float roughness" 0.1', True),
        ('Material "coatedconductor" "float interface.vroughness" 0.1', True),
        ('Material "coateddiffuse"', False),
        ('Material "coatedconductor" "float conductor.roughness" 0.1', False),
    ],
)
def test_of_rough_coats_a_note_says_how_pbrts_image_differs(body: str, noted: bool) -> None:
    assert any("rough coat" in note for note in world(body + BALL).notes) == noted


@pytest.mark.parametrize(
    ("coat", "share"),
    [("roughness", {0.0009: "1 %", 0.01: "4 %", 0.09: "10 %", 1.0: "17 %"}), ("vroughness", {0.09: "10 %"})],
)
def test_a_rough_coat_is_noted_with_the_difference_to_expect(coat: str, share: dict[float, str]) -> None:
    """The roughness is the square of alpha, at which the difference was measured."""
    for roughness, told in share.items():
        kind = f'Material "coateddiffuse" "float uroughness" 0.0009 "float {coat}" {roughness}'
        scene = world(kind.replace('"float uroughness" 0.0009 "float roughness"', '"float roughness"') + BALL)
        assert any(
            f"darker, by up to {told} of what this rough coat lets through" in note for note in scene.notes
        )
    smooth = world('Material "coateddiffuse" "float roughness" 0' + BALL)
    assert not any("rough coat" in note for note in smooth.notes)
