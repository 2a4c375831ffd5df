"""Roughness from textures: at every point the BSDF of the one roughness that the texture has there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.references.protocol import BACKENDS
from renderer.interfaces.material import MATERIALS
from renderer.records import SurfaceHit
from scenes.description.lights import Environment
from scenes.description.materials import SMOOTHEST, Conductor, Dielectric, Roughness
from scenes.description.shapes import ShapeDescription, Sphere
from scenes.description.textures import Checkerboard, UVMapping
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse, parse_file
from scenes.pbrt.write.scene import to_pbrt
from tests.kit.exported import written
from tests.kit.scene_texts import HEAD, TRIANGLE, world, world_fails

FINE, COARSE = np.full(3, 0.04), np.full(3, 0.36)
BOARD = Checkerboard(FINE, COARSE, UVMapping(4.0, 4.0))
COPPER = Conductor(np.array([0.21, 0.98, 1.2]), np.array([4.2, 2.6, 2.4]), 0.4)
GLASS = Dielectric(1.5, 0.4)
BALL = Sphere(np.zeros(3), 1.0)


def hits(n: int) -> SurfaceHit:
    """Points of shape 0 under random directions, at random coordinates."""
    rng = np.random.default_rng(1)
    wo = rng.normal(size=(3, n))
    wo[2] = np.abs(wo[2]) + 0.1
    wo /= np.linalg.norm(wo, axis=0)
    normal = np.repeat([[0.0], [0.0], [1.0]], n, axis=1)
    tangent = np.repeat([[0.6], [0.8], [0.0]], n, axis=1)
    none = np.full(n, -1)
    uv = rng.random((2, n))
    return SurfaceHit(
        np.zeros((3, n)), normal, wo, np.zeros(n, dtype=np.int64), none, none, uv, tangent=tangent
    )


@pytest.mark.parametrize("kind", ["conductor", "dielectric"])
@pytest.mark.parametrize("remap", [False, True])
@pytest.mark.parametrize("across", [False, True])
def test_each_point_scatters_by_its_own_roughness(kind: str, remap: bool, across: bool):
    """Values, densities and samples are those of the plain material, row by row and to rounding."""
    bare = COPPER if kind == "conductor" else GLASS
    varying = Roughness(BOARD, Checkerboard(COARSE, FINE, UVMapping(4.0, 4.0)) if across else None, remap)
    alpha, alpha_v = varying.mean_alphas()
    textured = replace(bare, alpha=alpha, alpha_v=alpha_v, varying=varying)
    hit = hits(400)
    even = np.floor(4 * hit.uv).sum(axis=0) % 2 == 0
    rng = np.random.default_rng(2)
    u, wi = rng.random((2, 400)), rng.normal(size=(3, 400))
    wi /= np.linalg.norm(wi, axis=0)
    group = MATERIALS[kind].make([ShapeDescription(BALL, textured)])
    sample, value, pdf = group.sample(hit, u), group.evaluate(hit, wi), group.pdf(hit, wi)
    fine, coarse = (0.2, 0.6) if remap else (0.04, 0.36)
    assert 100 < even.sum() < 300
    for rows, here, there in ((even, fine, coarse), (~even, coarse, fine)):
        plain = replace(bare, alpha=here, alpha_v=there if across else None)
        alone = MATERIALS[kind].make([ShapeDescription(BALL, plain)])
        want = alone.sample(hit, u)
        np.testing.assert_allclose(value[:, rows], alone.evaluate(hit, wi)[:, rows], rtol=1e-12)
        np.testing.assert_allclose(pdf[rows], alone.pdf(hit, wi)[rows], rtol=1e-12)
        np.testing.assert_allclose(sample.wi[:, rows], want.wi[:, rows], rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(sample.pdf[rows], want.pdf[rows], rtol=1e-9)
    assert (value > 0).any()


def test_no_point_is_smoother_than_pbrts_roughest_mirror():
    rough = Roughness(BOARD, None, True)
    assert rough.alpha(np.array([-1.0, 0.0, 1e-8, 0.25])).tolist() == [SMOOTHEST, SMOOTHEST, SMOOTHEST, 0.5]
    assert rough.mean_alphas() == (pytest.approx(np.sqrt(0.2)), None)


USES = (
    'Material "conductor" "texture roughness" "t"',
    'Material "dielectric" "texture uroughness" "t" "float vroughness" 0.2 "bool remaproughness" false',
    'Material "dielectric" "texture vroughness" "t" "float roughness" 0.2',
    'MakeNamedMaterial "m" "string type" "conductor" "texture roughness" "t" NamedMaterial "m"',
    'Texture "d" "float" "fbm" Material "conductor" "texture roughness" "t" "texture displacement" "d"',
)


@pytest.mark.parametrize("use", USES)
def test_textured_roughness_reads_back_to_the_bit(use: str, tmp_path: Path):
    write_exr(tmp_path / "r.exr", {"Y": np.arange(8.0).reshape(2, 4) / 16})
    image = 'Texture "t" "float" "imagemap" "string filename" "r.exr" '
    (tmp_path / "s.pbrt").write_text(HEAD + image + use + " " + TRIANGLE)
    given = parse_file(tmp_path / "s.pbrt")
    material = given.shapes[0].material
    assert isinstance(material, Conductor | Dielectric)
    assert material.varying is not None and material.needs_uv
    assert material.alpha > 0 and (material.alpha_v is None) == (material.varying.v is None)
    (tmp_path / "back").mkdir()
    assert parse_file(written(given, tmp_path / "back")).content_hash() == given.content_hash()
    why = BACKENDS["mitsuba"].refuses(replace(given, lights=(Environment(np.ones(3)),)))
    assert why is not None
    if "displacement" not in use:
        assert "roughness that varies" in why


def test_a_constant_texture_is_its_number():
    """0.3 and, of the default remapping, its square root; a smooth one is a mirror."""
    for value in ("0.3", "0"):
        made = f'Texture "t" "float" "constant" "float value" {value} '
        textured = world(made + 'Material "conductor" "texture roughness" "t" ' + TRIANGLE)
        plain = world(f'Material "conductor" "float roughness" {value} ' + TRIANGLE)
        assert textured.content_hash() == plain.content_hash()


def test_a_solid_texture_needs_no_coordinates():
    text = 'Texture "t" "float" "wrinkled" Material "conductor" "texture roughness" "t" ' + TRIANGLE
    given = parse(HEAD + text)
    assert not given.shapes[0].material.needs_uv
    assert parse(to_pbrt(given)).content_hash() == given.content_hash()


def test_a_texture_that_is_not_there_is_told_at_its_name():
    world_fails('Material "conductor" "texture roughness" "t" ' + TRIANGLE, 1, 22, "no float texture", "'t'")
