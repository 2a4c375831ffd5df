"""Coats with textures: each point is that of the coat with the numbers found there, walk by walk."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.materials.coated import CoatedMaterials
from renderer.records import SurfaceHit
from scenes.description.materials import Coated, Conductor, Dielectric, Diffuse, Roughness
from scenes.description.shapes import ShapeDescription, Sphere
from scenes.description.textures import Checkerboard, PlanarMapping, Texture, UVMapping
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse_file
from tests.kit.exported import written
from tests.kit.scene_texts import HEAD, TRIANGLE

N = 400
Parts = dict[str, Any]
WALL = Diffuse(np.array([0.8, 0.5, 0.1]))
COPPER = Conductor(np.array([0.21, 0.98, 1.2]), np.array([4.2, 2.6, 2.4]), 0.2)
BALL = Sphere(np.zeros(3), 1.0)


def board(even: float, odd: float) -> Checkerboard:
    return Checkerboard(np.full(3, even), np.full(3, odd), UVMapping(4.0, 4.0))


def hits() -> SurfaceHit:
    rng = np.random.default_rng(1)
    wo = rng.normal(size=(3, N))
    wo[2] = np.abs(wo[2]) + 0.1
    wo /= np.linalg.norm(wo, axis=0)
    none, normal = np.full(N, -1), np.repeat([[0.0], [0.0], [1.0]], N, axis=1)
    p, uv = rng.random((3, N)), rng.random((2, N))
    return SurfaceHit(p, normal, wo, np.zeros(N, dtype=np.int64), none, none, uv)


def directions() -> np.ndarray:
    wi = np.random.default_rng(2).normal(size=(3, N))
    return np.abs(wi) / np.linalg.norm(wi, axis=0)


def kind_of(material: Coated) -> CoatedMaterials:
    return CoatedMaterials.make([ShapeDescription(BALL, material)])


def roughened(u: Texture, v: Texture | None = None) -> Parts:
    rough = Roughness(u, v, remap=False)
    alpha, alpha_v = rough.mean_alphas()
    return {"alpha": alpha, "alpha_v": alpha_v, "varying": rough}


GLASS = Dielectric(1.5, 0.3)


def coats(*alphas: tuple[float, float | None]) -> list[Parts]:
    return [{"coat": replace(GLASS, alpha=u, alpha_v=v)} for u, v in alphas]


MILK = {"albedo": board(0.9, 0.2), "g": board(-0.5, 0.5), "thickness": 0.5}
CASES: list[tuple[Diffuse | Conductor, Parts, list[Parts]]] = [
    (WALL, {"coat": replace(GLASS, **roughened(board(0.1, 0.5)))}, coats((0.1, None), (0.5, None))),
    (
        WALL,
        {"coat": replace(GLASS, **roughened(board(0.1, 0.5), board(0.4, 0.2)))},
        coats((0.1, 0.4), (0.5, 0.2)),
    ),
    (
        COPPER,
        {"base": replace(COPPER, **roughened(board(0.1, 0.5)))},
        [{"base": replace(COPPER, alpha=alpha)} for alpha in (0.1, 0.5)],
    ),
    (WALL, {"thickness": board(0.0, 0.7)}, [{"thickness": 0.0}, {"thickness": 0.7}]),
    (
        WALL,
        MILK,
        [{"albedo": np.full(3, a), "g": g, "thickness": 0.5} for a, g in ((0.9, -0.5), (0.2, 0.5))],
    ),
]


@pytest.mark.parametrize(("base", "textured", "plain"), CASES)
def test_each_point_has_the_coat_of_its_texture(
    base: Diffuse | Conductor, textured: Parts, plain: list[Parts]
) -> None:
    """The walks are hashes of the point and its directions: where a mean stood for the texture, a walk in
    every few would differ by far more than rounding.
    """
    coated, hit, wi = Coated(GLASS, base), hits(), directions()
    varying = kind_of(replace(coated, **textured))
    found = varying.evaluate(hit, wi)
    even = np.floor(4 * hit.uv).sum(axis=0) % 2 == 0
    for rows, parts in zip((even, ~even), plain, strict=True):
        assert 100 < rows.sum() < 300
        alone = kind_of(replace(coated, **parts))
        np.testing.assert_allclose(found[:, rows], alone.evaluate(hit, wi)[:, rows], rtol=1e-11)
        if base is WALL:  # under metal the density follows the shape's mean roughness
            u = np.random.default_rng(3).random((2, N))
            np.testing.assert_allclose(varying.pdf(hit, wi)[rows], alone.pdf(hit, wi)[rows], rtol=1e-11)
            np.testing.assert_allclose(
                varying.sample(hit, u).wi[:, rows], alone.sample(hit, u).wi[:, rows], atol=1e-12
            )
    assert (found > 0).any()


def test_a_base_sees_its_solid_texture_at_the_point_of_the_coat() -> None:
    """A base whose textures looked at the origin of the layer's own space would be of one colour."""
    stripes = PlanarMapping(np.eye(4), np.array([8.0, 0, 0]), np.zeros(3), 0.0, 0.5)
    light, dark = np.full(3, 0.9), np.full(3, 0.1)
    hit, wi = hits(), directions()
    found = kind_of(Coated(GLASS, Diffuse(Checkerboard(light, dark, stripes)))).evaluate(hit, wi)
    even = np.floor(8 * hit.p[0]) % 2 == 0
    assert 100 < even.sum() < 300
    for rows, color in ((even, light), (~even, dark)):
        alone = kind_of(Coated(GLASS, Diffuse(color))).evaluate(hit, wi)
        np.testing.assert_allclose(found[:, rows], alone[:, rows], rtol=1e-11)


USES = (
    'Material "coateddiffuse" "texture roughness" "t"',
    'Material "coateddiffuse" "texture uroughness" "t" "float vroughness" 0.2 "texture thickness" "t"',
    'Material "coateddiffuse" "texture reflectance" "c" "texture albedo" "c" "texture g" "t"',
    'Material "coatedconductor" "texture interface.roughness" "t" "float conductor.roughness" 0.3',
    'Material "coatedconductor" "texture conductor.roughness" "t" "bool remaproughness" false',
    'Material "coatedconductor" "texture conductor.vroughness" "t" "float interface.uroughness" 0.1',
)


@pytest.mark.parametrize("use", USES)
def test_textured_coats_read_back_to_the_bit(use: str, tmp_path: Path) -> None:
    write_exr(tmp_path / "r.exr", {"Y": np.arange(8.0).reshape(2, 4) / 16})
    image = '"imagemap" "string filename" "r.exr" '
    textures = f'Texture "t" "float" {image} Texture "c" "spectrum" {image}'
    (tmp_path / "s.pbrt").write_text(f"{HEAD}{textures}{use} {TRIANGLE}")
    given = parse_file(tmp_path / "s.pbrt")
    material = given.shapes[0].material
    assert isinstance(material, Coated) and material.needs_uv
    assert material.has_textured_layer or "varying" in repr(material)
    (tmp_path / "back").mkdir()
    assert parse_file(written(given, tmp_path / "back")).content_hash() == given.content_hash()
