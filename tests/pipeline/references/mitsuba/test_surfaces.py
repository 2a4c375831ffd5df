"""Textures through Mitsuba against what pbrt's formulas say."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from scenes.description.lights import DistantLight
from scenes.description.materials import Diffuse
from scenes.description.shapes import (
    Array,
    BilinearMesh,
    Disk,
    Emission,
    Geometry,
    ShapeDescription,
    Sphere,
    TriangleMesh,
)
from scenes.description.textures import Checkerboard, ImageTexture, Mix, Product, Texture, UVMapping
from tests.kit.mitsuba_checks import BACKEND, lit, picture
from tests.kit.mitsuba_scenes import look_at, rectangle, scene, vector

X, Y, Z = np.eye(3)


def mostly_slow(names: Iterable[str], quick: str) -> list[Any]:
    """All of them in the slow tier, but for those whose name has `quick` in it: each is a process of its
    own.
    """
    return [name if re.search(quick, name) else pytest.param(name, marks=pytest.mark.slow) for name in names]


O = np.zeros(3)  # noqa: E741


def look_up(texture: Texture, uv: Array) -> Array:
    """pbrt's textures at uv (..., 2), written down anew: (..., 3)."""
    match texture:
        case ImageTexture():
            return image_at(texture, uv)
        case Checkerboard():
            even = np.floor(placed(texture.mapping, uv)).sum(axis=-1, keepdims=True) % 2 == 0
            return np.where(even, look_up(texture.first, uv), look_up(texture.second, uv))
        case Product():
            return look_up(texture.first, uv) * look_up(texture.second, uv)
        case Mix():
            amount = look_up(texture.amount, uv)
            return (1 - amount) * look_up(texture.first, uv) + amount * look_up(texture.second, uv)
        case _:
            return np.broadcast_to(texture, (*uv.shape[:-1], 3))


def placed(mapping: UVMapping, uv: Array) -> Array:
    return uv * (mapping.su, mapping.sv) + (mapping.du, mapping.dv)


def image_at(texture: ImageTexture, uv: Array) -> Array:
    height, width = texture.image.shape[:2]
    s, t = np.moveaxis(placed(texture.mapping, uv), -1, 0)
    x, y = s * width, (1 - t) * height

    def texel(i: Array, j: Array) -> Array:
        inside = ((i >= 0) & (i < width) & (j >= 0) & (j < height))[..., None]
        if texture.wrap == "repeat":
            return texture.image[np.int64(j % height), np.int64(i % width)]
        value = texture.image[np.int64(np.clip(j, 0, height - 1)), np.int64(np.clip(i, 0, width - 1))]
        return np.where(inside, value, 0.0) if texture.wrap == "black" else value

    if texture.filter == "point":
        return texel(np.floor(x), np.floor(y))
    i, j = np.floor(x - 0.5), np.floor(y - 0.5)
    a, b = (x - 0.5 - i)[..., None], (y - 0.5 - j)[..., None]
    upper = (1 - a) * texel(i, j) + a * texel(i + 1, j)
    return (1 - b) * upper + b * ((1 - a) * texel(i, j + 1) + a * texel(i + 1, j + 1))


RNG = np.random.default_rng(11)
BITS = RNG.random((2, 3, 3))
FINE = RNG.random((4, 3, 3))
GRAY = np.repeat(RNG.random((3, 2, 1)), 3, axis=2)
SHIFTED = UVMapping(1.5, -0.8, 0.2, 0.3)
RED, BLUE = vector(0.9, 0.1, 0.2), vector(0.1, 0.2, 0.8)
TEXTURES: dict[str, Texture] = {
    "point": ImageTexture(BITS, filter="point"),
    "bilinear, repeated": ImageTexture(BITS, SHIFTED),
    "bilinear, clamped": ImageTexture(BITS, SHIFTED, "clamp"),
    "bilinear, black around": ImageTexture(BITS, SHIFTED, "black"),
    "one texel wide": ImageTexture(BITS[:, :1], SHIFTED),
    "checkerboard": Checkerboard(RED, BLUE, UVMapping(3.0, 2.0, 0.1, 0.2)),
    "checkerboard of images": Checkerboard(
        ImageTexture(BITS), Checkerboard(RED, BLUE, UVMapping(5.0, 5.0)), UVMapping(2.0, 3.0)
    ),
    "product": Product(ImageTexture(BITS, filter="point"), ImageTexture(GRAY, filter="point")),
    "product with a constant": Product(Checkerboard(RED, ImageTexture(FINE)), np.full(3, 0.5)),
    "mix": Mix(ImageTexture(BITS), Checkerboard(RED, BLUE, SHIFTED), np.full(3, 0.25)),
    "mix by an image": Mix(ImageTexture(BITS), RED, ImageTexture(GRAY)),
    "mix of constants by a checkerboard": Mix(RED, BLUE, Checkerboard(np.full(3, 0.2), np.full(3, 0.7))),
}
SIZE, SIDE = 24, 8


def rays(view: Array, fov: float) -> tuple[Array, Array]:
    """Origin (3,) and directions (SIZE SIDE, SIZE SIDE, 3) of SIDE^2 rays a pixel of a square image, by
    pbrt's camera.
    """
    count = SIZE * SIDE
    y, x = (np.mgrid[:count, :count] + 0.5) / count * 2 - 1
    d = np.stack([x, -y, np.full_like(x, 1 / np.tan(np.radians(fov / 2)))], -1)
    return view[:3, 3], d @ view[:3, :3].T


def shrunk(fine: Array) -> Array:
    return fine.reshape(SIZE, SIDE, SIZE, SIDE, 3).mean(axis=(1, 3))


VIEW = look_at(vector(0.1, -0.05, -3), vector(0.1, -0.05, 0), Y), 33.0
SUN = DistantLight(vector(0.1, 0.2, -1) / np.linalg.norm([0.1, 0.2, 1]), np.full(3, np.pi))


def assert_seen(geometry: Geometry, texture: Texture, uv: Array, cosine: Array) -> None:
    """The shape under SUN reads its reflectance times the cosine; nan in uv: nothing is there.

    Pixels of edges are seen by other rays here and there, so that they count by their median.
    """
    image = picture(lit([ShapeDescription(geometry, Diffuse(texture))], [SUN], VIEW, SIZE), 256)
    there = ~np.isnan(uv[..., :1])
    want = shrunk(
        np.where(there, look_up(texture, np.nan_to_num(uv)) * np.maximum(cosine, 0)[..., None], 0.0)
    )
    error = np.abs(image - want)
    assert want.max() > 0.3 and np.ptp(want, axis=(0, 1)).max() > 0.2
    assert np.median(error) < 1e-3
    assert np.quantile(error, 0.97) < 0.06 and error.max() < 0.2


def on_plane() -> tuple[Array, Array]:
    """x and y where the rays of VIEW meet z = 0."""
    origin, d = rays(*VIEW)
    p = origin - d * (origin[2] / d[..., 2:])
    return p[..., 0], p[..., 1]


SQUARE = rectangle(O, 0.8 * Y, 0.8 * X)  # normal -z, towards the camera; u up, v to the right


def square_uv() -> Array:
    x, y = on_plane()
    uv = np.stack([(y / 0.8 + 1) / 2, (x / 0.8 + 1) / 2], -1)
    return np.where(((uv >= 0) & (uv <= 1)).all(axis=-1, keepdims=True), uv, np.nan)


@pytest.mark.parametrize("name", mostly_slow(TEXTURES, "black around|of images|by an image"))
@pytest.mark.usefixtures("mitsuba")
def test_a_texture_lies_as_pbrt_lays_it(name: str):
    """An image that is mirrored, turned, shifted by half a texel or interpolated where it should not be is
    0.1 or more off in most pixels.
    """
    assert_seen(SQUARE, TEXTURES[name], square_uv(), np.float64(-SUN.wi[2]))


def affine(uv: Array, corners: Array) -> Array:
    """uv of corners p00 p10 p01, (3, 2), carried over the square."""
    return corners[0] + uv[..., :1] * (corners[1] - corners[0]) + uv[..., 1:] * (corners[2] - corners[0])


UV = np.array([[0.1, 0.3], [1.2, 0.1], [-0.3, 1.1], [0.8, 0.9]])
CORNERS: dict[str, BilinearMesh | TriangleMesh] = {
    "reversed patch": dataclasses.replace(SQUARE, reverse=True),
    "patch with uv": dataclasses.replace(SQUARE, uv=UV),
    "reversed patch with uv": dataclasses.replace(SQUARE, uv=UV, reverse=True),
    "triangles with uv": TriangleMesh(SQUARE.vertices, np.array([[0, 1, 3], [0, 3, 2]]), False, UV),
    "triangles with uv, reversed": TriangleMesh(SQUARE.vertices, np.array([[0, 3, 1], [0, 2, 3]]), True, UV),
    "triangles": TriangleMesh(SQUARE.vertices, np.array([[0, 1, 3], [3, 2, 0]])),
    "triangles, reversed": TriangleMesh(SQUARE.vertices, np.array([[0, 1, 3], [3, 2, 0]]), True),
}


@pytest.mark.parametrize("emits", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", mostly_slow(CORNERS, "reversed patch with uv|triangles, reversed"))
@pytest.mark.usefixtures("mitsuba")
def test_a_texture_follows_the_corners(name: str, emits: bool):
    """Emitting patches are rectangles to Mitsuba and the others triangles; a light of radiance 0 looks the
    same.
    """
    mesh, uv = CORNERS[name], square_uv()
    emits = emits and isinstance(mesh, BilinearMesh)
    if mesh.uv is not None:
        uv = affine(uv, mesh.uv)
    elif isinstance(mesh, TriangleMesh):  # (0,0), (1,0), (1,1) at p0, p1, p2 of each face
        u, v = np.moveaxis(uv, -1, 0)
        uv = np.where((v <= u)[..., None], np.stack([u, v], -1), 1 - np.stack([u, v], -1))
    texture = ImageTexture(BITS)
    given = lit(
        [ShapeDescription(mesh, Diffuse(texture), Emission(np.zeros(3)) if emits else None)],
        [SUN],
        VIEW,
        SIZE,
    )
    # A second emitter, though black, takes half of the samples.
    image = picture(given, 2**15 if emits else 256)
    want = shrunk(np.where(np.isnan(uv[..., :1]), 0.0, look_up(texture, np.nan_to_num(uv)) * -SUN.wi[2]))
    assert np.median(np.abs(image - want)) < (5e-3 if emits else 1e-3)
    assert np.quantile(np.abs(image - want), 0.97) < 0.06 and np.abs(image - want).max() < 0.2


FRAMES = {"right-handed": np.linalg.qr(RNG.normal(size=(3, 3)))[0]}
FRAMES["left-handed"] = FRAMES["right-handed"] * (1, -1, 1)
if np.linalg.det(FRAMES["right-handed"]) < 0:
    FRAMES = dict(zip(FRAMES, reversed(FRAMES.values()), strict=True))


@pytest.mark.parametrize("hand", mostly_slow(FRAMES, "left"))
@pytest.mark.usefixtures("mitsuba")
def test_a_texture_on_a_sphere_lies_as_pbrts(hand: str):
    """u is the angle from the object's x towards its y, v runs from the lower pole to the upper one."""
    frame, radius = FRAMES[hand], 0.8
    origin, d = rays(*VIEW)
    d = d / np.linalg.norm(d, axis=-1, keepdims=True)
    b = d @ origin
    inside = b * b - origin @ origin + radius**2
    p = origin + (-b - np.sqrt(np.where(inside > 0, inside, np.nan)))[..., None] * d
    own = p @ frame / radius
    u = np.mod(np.arctan2(own[..., 1], own[..., 0]), 2 * np.pi) / (2 * np.pi)
    uv = np.stack([u, 1 - np.arccos(np.clip(own[..., 2], -1, 1)) / np.pi], -1)
    assert_seen(
        Sphere(O, radius, frame=frame),
        ImageTexture(FINE, UVMapping(2.0, 2.0)),
        uv,
        np.nan_to_num(p @ SUN.wi / radius),
    )


@pytest.mark.parametrize(
    ("mirrored", "away"), [(True, True), pytest.param(False, False, marks=pytest.mark.slow)]
)
@pytest.mark.usefixtures("mitsuba")
def test_a_texture_on_a_disk_lies_as_pbrts(mirrored: bool, away: bool):
    """u is the angle, v is 0 at the rim and 1 in the middle. away: the normal is not the third axis but its
    opposite.
    """
    turn = np.array([[np.cos(0.4), -np.sin(0.4), 0], [np.sin(0.4), np.cos(0.4), 0], [0, 0, 1]])
    frame = turn * (1, -1 if mirrored else 1, 1)
    x, y = on_plane()
    own = np.stack([x, y, 0 * x], -1) @ frame / 0.8
    r = np.hypot(own[..., 0], own[..., 1])
    u = np.mod(np.arctan2(own[..., 1], own[..., 0]), 2 * np.pi) / (2 * np.pi)
    uv = np.where((r <= 1)[..., None], np.stack([u, 1 - r], -1), np.nan)
    assert_seen(Disk(O, -Z if away else Z, 0.8, frame), ImageTexture(FINE), uv, np.float64(-SUN.wi[2]))


def test_textures_that_mitsuba_cannot_have_are_refused():
    trapezium = BilinearMesh(
        np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 1, 0]]), np.array([[0, 1, 2, 3]])
    )
    image = ImageTexture(BITS)
    cases: dict[str, tuple[Geometry, Texture]] = {
        "no parallelogram": (trapezium, image),
        "one mapping": (SQUARE, Product(image, ImageTexture(GRAY))),
        "a gray one": (SQUARE, Mix(image, RED, BLUE)),
    }
    for words, (geometry, texture) in cases.items():
        given = lit([ShapeDescription(geometry, Diffuse(texture))], [SUN], VIEW)
        assert words in str(BACKEND.refuses(given))
    ball = ShapeDescription(Sphere(O, 1.0), Diffuse(RED), Emission(RED, image=BITS))
    assert "on at most 16 rectangles" in str(BACKEND.refuses(scene([ball], *VIEW)))
