"""Anisotropic microfacets through Mitsuba, which lie as in our own image, and not with their axes swapped."""

from __future__ import annotations

import dataclasses

import pytest

import renderer
from pipeline.references.backends.mitsuba import MitsubaBackend
from pipeline.references.protocol import ReferenceRequest
from scenes.description.materials import Microfacets
from scenes.description.scene import SceneDescription
from scenes.pbrt.parser import parse

TEXT = """\
LookAt 0 3 7  0 0.5 0  0 1 0
Camera "perspective" "float fov" [ 40 ]
Film "rgb" "integer xresolution" [ 24 ] "integer yresolution" [ 18 ]
PixelFilter "box"
Integrator "path" "integer maxdepth" [ 1 ]
WorldBegin
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 9 9 9 ] Translate 1 4 2 Rotate 80 1 0 0.2 Shape "disk"
AttributeEnd
Material "conductor" "float uroughness" [ 0.5 ] "float vroughness" [ 0.08 ] "bool remaproughness" false
AttributeBegin Translate -1.6 1 0 Rotate 40 1 0 .3 Shape "sphere" AttributeEnd
AttributeBegin
  Translate 1.6 .4 0 Rotate -70 1 0.1 0 Rotate 30 0 0 1 Shape "disk" "float radius" 1.2
AttributeEnd
Material "dielectric" "float uroughness" [ 0.08 ] "float vroughness" [ 0.5 ] "bool remaproughness" false
Shape "trianglemesh" "point3 P" [ -3 0 -3  -3 0 3  3 0 3  3 0 -3 ] "integer indices" [ 0 1 2 0 2 3 ]
  "point2 uv" [ 0 0  1 .3  1.4 1  .4 .7 ]
"""


def swapped(scene: SceneDescription) -> SceneDescription:
    shapes = (
        dataclasses.replace(s, material=dataclasses.replace(m, alpha=m.alpha_v, alpha_v=m.alpha))
        if isinstance(m := s.material, Microfacets) and m.alpha_v is not None
        else s
        for s in scene.shapes
    )
    return dataclasses.replace(scene, shapes=tuple(shapes))


@pytest.mark.usefixtures("mitsuba", "statistical")
def test_brushed_surfaces_lie_as_in_our_image() -> None:
    """A ball, a disk, whose u Mitsuba has across pbrt's, and glass with skewed coordinates.

    chi^2 of the pixels: noise alone gives 1, and swapped axes some ten times as much.
    """
    scene = parse(TEXT)
    theirs = MitsubaBackend().render(scene, ReferenceRequest(spp=1024))

    def chi2(ours: SceneDescription) -> float:
        made = renderer.render(ours, estimator="mis", spp=1024, seed=3)
        error = made.variance + theirs.variance
        seen = error > 0
        return float((((made.image - theirs.mean) ** 2)[seen] / error[seen]).mean())

    assert chi2(scene) < 1.3
    assert chi2(swapped(scene)) > 5


def test_parts_of_quadrics_with_brushed_metal_are_refused() -> None:
    text = TEXT.replace('"float vroughness" [ 0.08 ]', '"float vroughness" [ 0.1 ]').replace(
        'Shape "sphere"', 'Shape "sphere" "float phimax" 90'
    )
    assert "anisotropic roughness on a part" in str(MitsubaBackend().refuses(parse(text)))
