"""Translucent sheets: their density over the whole sphere, their two sides in closed form, their textures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from pipeline.references.mitsuba.surfaces import bsdf
from renderer import render
from renderer.interfaces.material import LAMBERTIAN, Lobes, lobes_of
from renderer.materials.diffuse_transmission import DiffuseTransmissionMaterials
from renderer.math.vectors import dot, frame_about, normalize
from renderer.records import SurfaceHit
from scenes.description.materials import DiffuseTransmission
from scenes.description.scene import SceneDescription
from scenes.description.shapes import ShapeDescription, Sphere
from scenes.errors import SceneError
from scenes.pbrt.parser import parse
from scenes.pbrt.write.scene import to_pbrt

NORMAL = normalize(np.array([[0.3], [-0.5], [-0.7]]))
RED, GREEN = np.array([0.6, 0.2, 0.1]), np.array([0.1, 0.3, 0.2])
HEAD = """LookAt 0 0 5  0 0 0  0 1 0
Camera "perspective" "float fov" [ 1 ] Sampler "independent" "integer pixelsamples" [ 1 ]
Film "rgb" "integer xresolution" [ 1 ] "integer yresolution" [ 1 ]
Integrator "path" "integer maxdepth" [ 1 ]
WorldBegin
"""
SHEET = 'Shape "disk" "float radius" 2'


def sheet(material: DiffuseTransmission) -> ShapeDescription:
    return ShapeDescription(Sphere(np.zeros(3), 1.0), material)


def hits(count: int) -> SurfaceHit:
    none = np.zeros(count, dtype=np.int64)
    n, x = np.repeat(NORMAL, count, axis=1), frame_about(NORMAL)[0]
    wo = np.repeat(normalize(NORMAL + x), count, axis=1)
    return SurfaceHit(np.zeros((3, count)), n, wo, none, none, none, np.zeros((2, 1)))


def test_directions_follow_their_density_on_both_sides() -> None:
    """The cosine's square, above and below, is uniform by the sides' chances, 2 : 1; 1e5 samples catch a
    chance that is off by 0.6 %, and a cell of 20 by 6 %.
    """
    material, count = DiffuseTransmissionMaterials.make([sheet(DiffuseTransmission(RED, GREEN))]), 100_000
    hit = hits(count)
    sample = material.sample(hit, np.random.default_rng(1).random((2, count)))
    cosine = dot(sample.wi, NORMAL)
    share = np.where(cosine > 0, 2 / 3, 1 / 3)
    np.testing.assert_allclose(sample.pdf, share * np.abs(cosine) / np.pi, rtol=1e-12)
    np.testing.assert_array_equal(sample.pdf, material.pdf(hit, sample.wi))
    np.testing.assert_array_equal(sample.value, material.evaluate(hit, sample.wi))
    assert sample.specular is None
    edges = np.linspace(-1, 1, 21)
    observed, _ = np.histogram(np.sign(cosine) * cosine**2, edges)
    expected = count / 10 * np.where(edges[1:] > 1e-9, 2 / 3, 1 / 3)
    assert chi2.sf(((observed - expected) ** 2 / expected).sum(), 19) > 1e-3
    x, y, _ = frame_about(NORMAL)
    turn = np.arctan2(dot(sample.wi, y), dot(sample.wi, x))
    around, _ = np.histogram(turn, np.linspace(-np.pi, np.pi, 13))
    assert chi2.sf(((around - count / 12) ** 2 / (count / 12)).sum(), 11) > 1e-3


def test_each_lobe_is_told_by_what_is_not_black() -> None:
    black, through = np.zeros(3), Lobes.TRANSMISSION | Lobes.DIFFUSE
    found = [
        lobes_of(sheet(DiffuseTransmission(*parts)))
        for parts in ((RED, GREEN), (RED, black), (black, GREEN), (black, black), (RED, GREEN, 0.0))
    ]
    assert found == [LAMBERTIAN | through, LAMBERTIAN, through, Lobes.NONE, Lobes.NONE]


def test_nothing_is_sampled_where_all_is_black() -> None:
    material = DiffuseTransmissionMaterials.make([sheet(DiffuseTransmission(np.zeros(3), np.zeros(3)))])
    sample = material.sample(hits(4), np.full((2, 4), 0.3))
    assert not sample.pdf.any() and not sample.value.any()


def lit(material: str, towards: float, sheet_: str = SHEET) -> SceneDescription:
    """A sheet of normal z lit from 60 degrees off it, from the side of z = towards."""
    light = 'LightSource "distant" "rgb L" [ 3 2 1 ] "point3 to" [ 0 0 0 ] '
    light += f'"point3 from" [ {np.sqrt(3)} 0 {towards} ]'
    return parse(f"{HEAD}{light} {material} {sheet_}")


@pytest.mark.parametrize("estimator", ["mis", "cosine", "solid-angle", "area", "bsdf"])
@pytest.mark.parametrize(("towards", "share"), [(1.0, RED), (-1.0, GREEN)], ids=["front", "back"])
@pytest.mark.parametrize("seen_from_inside", [False, True])
def test_a_distant_light_shows_its_cosine_over_pi(
    towards: float, share: np.ndarray, seen_from_inside: bool, estimator: str
) -> None:
    """L cos R / pi from in front, L cos T / pi from behind, whichever way the surface is oriented."""
    text = 'Material "diffusetransmission" "rgb reflectance" [ .6 .2 .1 ] "rgb transmittance" [ .1 .3 .2 ]'
    scene = lit(text + (" ReverseOrientation" if seen_from_inside else ""), towards)
    image = render(scene, estimator=estimator, spp=1).image
    np.testing.assert_allclose(image[0, 0], np.array([3, 2, 1]) * 0.5 * share / np.pi, rtol=1e-6)


@pytest.mark.parametrize(
    ("parameters", "near", "far"),
    [
        ("", 0.25, 0.25),
        ('"float scale" 2 "rgb reflectance" [ .3 .3 .3 ] "rgb transmittance" [ .7 .7 .7 ]', 0.6, 1.0),
        ('"texture reflectance" "half" "texture transmittance" "checks"', 0.5, 0.4),
        ('"texture reflectance" "half" "texture transmittance" "checks" "float scale" 1.5', 0.75, 0.6),
        ('"texture reflectance" "checks" "float scale" 4', 1.0, 1.0),
        ('"spectrum transmittance" [ 300 .1 900 .1 ] "float scale" -1', 0.0, 0.0),
    ],
)
def test_scale_multiplies_both_and_what_is_above_1_is_clamped(
    parameters: str, near: float, far: float, tmp_path: Path
) -> None:
    """As pbrt has it, of textures too; the text that is written says the same."""
    textures = """Texture "half" "spectrum" "constant" "rgb value" [ .5 .5 .5 ]
Texture "checks" "spectrum" "checkerboard" "rgb tex1" [ .4 .4 .4 ] "rgb tex2" [ .4 .4 .4 ] """
    for towards, share in ((1.0, near), (-1.0, far)):
        scene = lit(f'{textures} Material "diffusetransmission" {parameters}', towards)
        image = render(scene, estimator="mis", spp=1).image
        np.testing.assert_allclose(image[0, 0], np.array([3, 2, 1]) * 0.5 * share / np.pi, rtol=1e-6)
        again = parse(to_pbrt(scene))
        np.testing.assert_array_equal(render(again, estimator="mis", spp=1).image, image)
        material = again.shapes[0].material
        assert isinstance(material, DiffuseTransmission) and material.needs_uv == ("checks" in parameters)


def test_the_plan_keeps_light_from_behind_a_sheet_and_drops_it_from_a_wall() -> None:
    """A wall that faces away from the lamp traces no shadow ray at all; a sheet traces its own."""
    lamp = 'AreaLightSource "diffuse" "rgb L" [ 9 9 9 ] Translate 0 0 -2 Shape "sphere"'
    lamp = f"AttributeBegin {lamp} AttributeEnd"
    shown = {}
    for kind in ("diffuse", "diffusetransmission"):
        scene = parse(f'{HEAD}{lamp} Material "{kind}" {SHEET}')
        shown[kind] = render(scene, estimator="solid-angle", spp=4096)
    assert not shown["diffuse"].image.any() and shown["diffuse"].rays.shadow == 0
    # A sphere of radius 1 at a distance of 2 in front gives pi L / 4 [howell2021, C-41].
    found, error = (
        shown["diffusetransmission"].image[0, 0],
        np.sqrt(shown["diffusetransmission"].variance[0, 0]),
    )
    assert (np.abs(found - 0.25 * 9 / 4) < 4.5 * error + 1e-6).all() and (error < 0.01).all()


def test_colours_of_both_sides_are_changed_and_one_is_drawn() -> None:
    leaf = DiffuseTransmission(RED, GREEN, 1.5)
    np.testing.assert_allclose(leaf.normal_reflectance, 1.5 * RED)
    gray = leaf.map_colors(lambda color: np.full(3, color[1]))
    assert (gray.reflectance[0], gray.transmittance[0], gray.scale) == (0.2, 0.3, 1.5)
    assert replace(leaf, scale=9.0).normal_reflectance.max() == 1


def test_mitsuba_refuses_sheets_by_name() -> None:
    with pytest.raises(SceneError, match="DiffuseTransmission"):
        bsdf(DiffuseTransmission(RED, GREEN), np.eye(3), None)
