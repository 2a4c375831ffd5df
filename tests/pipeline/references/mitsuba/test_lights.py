"""Lights that are no shapes, and lights with two sides, through Mitsuba against closed forms."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.references.mitsuba import environment as mitsuba_environment
from pipeline.references.mitsuba.lights import FALLOFF_ERROR, falloff
from pipeline.references.mitsuba.limits import reason
from pipeline.references.mitsuba.scene import convert, normalising_frame
from scenes.description.lights import (
    DistantLight,
    Environment,
    GoniometricLight,
    Light,
    PointLight,
    PortalLight,
    ProjectionLight,
    SpotLight,
)
from scenes.description.shapes import Array, Disk, Emission, Geometry, ShapeDescription, Sphere, TriangleMesh
from scenes.errors import SceneError
from tests.kit.mitsuba_checks import BACKEND, irradiance, lit, picture, render
from tests.kit.mitsuba_scenes import above, floor, look_at, rectangle, scene, shape, vector

X, Y, Z = np.eye(3)
POINT = vector(0.7, 0, -0.4)
RGB = vector(1, 2, 3)
AXIS = vector(0.2, -1, 0.3) / np.linalg.norm([0.2, -1, 0.3])


def unit(*xyz: float) -> Array:
    return vector(*xyz) / np.linalg.norm(xyz)


def spot_over(degrees: float) -> SpotLight:
    """2 above POINT, which it sees at that angle off its axis."""
    turn = np.radians(degrees)
    axis = vector(np.sin(turn), -np.cos(turn), 0)
    return SpotLight(POINT + 2 * Y, axis, RGB, 40.0, 15.0)


def smoothstep(degrees: float, start: float, end: float) -> float:
    x = (np.cos(np.radians(degrees)) - np.cos(np.radians(end))) / (
        np.cos(np.radians(start)) - np.cos(np.radians(end))
    )
    x = min(max(x, 0.0), 1.0)
    return x * x * (3 - 2 * x)


def turned(up: Array, mirrored: bool = False) -> Array:
    """A frame whose z is `up`."""
    x = unit(*np.cross(up, vector(0.3, 0.5, -0.8)))
    return np.stack([x, np.cross(up, x) * (-1 if mirrored else 1), up], axis=1)


DELTA: dict[str, tuple[Light, Array]] = {
    "point": (
        PointLight(POINT + vector(0.6, 1.4, -0.3), RGB),
        RGB * 1.4 / np.linalg.norm([0.6, 1.4, 0.3]) ** 3,
    ),
    "distant": (DistantLight(unit(1, 2, -1), RGB), RGB * 2 / np.sqrt(6)),
    "spot, full": (spot_over(14.0), RGB / 4),
    "spot, falling off": (spot_over(29.0), RGB / 4 * smoothstep(29, 15, 40)),
    "spot, nearly out": (spot_over(38.5), RGB / 4 * smoothstep(38.5, 15, 40)),
    "spot, out": (spot_over(41.0), RGB * 0),
    "spot with an edge, in": (dataclasses.replace(spot_over(39.5), falloff_start=40.0), RGB / 4),
    "spot with an edge, out": (dataclasses.replace(spot_over(40.5), falloff_start=40.0), RGB * 0),
    "below the floor": (DistantLight(unit(1, -2, -1), RGB), RGB * 0),
}


def projector(column: int, row: int, mirrored: bool = False) -> tuple[Light, Array]:
    """2 from POINT, which lies in the middle of that texel of 3 by 2, all different, and what arrives."""
    slide = 1 + np.arange(18.0).reshape(2, 3, 3)
    frame = turned(unit(0.3, -1, 0.2), mirrored)
    half = np.tan(np.radians(25)) * np.array([1.5, 1.0])
    x, y = (np.array([column, row]) + 0.5) / [1.5, 1.0] - 1
    way = frame @ [x * half[0], -y * half[1], 1.0]
    way /= np.linalg.norm(way)
    light = ProjectionLight(POINT - 2 * way, frame, RGB, slide, 50.0)
    return light, RGB * slide[row, column] / 4 * -way[1]


for _texel in ((0, 0), (2, 0), (0, 1), (1, 1)):
    DELTA[f"projector, texel {_texel}"] = projector(*_texel)
DELTA["projector, mirrored"] = projector(1, 0, True)


def test_lights_that_mitsuba_lacks_are_refused_by_name():
    sky, corners = Environment(RGB), np.array([[0.0, 1, 0], [0, 1, 1], [1, 1, 1], [1, 1, 0]])
    for light in (PortalLight(sky, corners), GoniometricLight(POINT + Y, np.eye(3), RGB, np.ones((2, 2)))):
        why = BACKEND.refuses(lit([floor()], [light], above(POINT, 2e-3, 0.1)))
        assert why is not None
        assert type(light).__name__ in why


@pytest.mark.parametrize("name", DELTA)
@pytest.mark.usefixtures("mitsuba")
def test_a_delta_light_gives_its_irradiance(name: str):
    """Nothing is random but where in its pixel, of 2e-3 at most, a ray starts: 2e-5 of the value is caught, a
    factor
    of 2 or pi, a scale that is not squared and an axis the wrong way round with it. A spot's falloff is an
    image, good to 1e-4 of full.
    """
    light, want = DELTA[name]
    image = picture(lit([floor()], [light], above(POINT, 2e-3, 0.1)))
    spare = 1.5 * FALLOFF_ERROR / 4 if "falling" in name or "nearly" in name else 0.0
    error = np.abs(image.mean(axis=(0, 1)) - want / (2 * np.pi))
    print(f"{name}: relative error {error.max() / max(want.max() / (2 * np.pi), 1e-9):.1e}")
    assert np.all(error <= 2e-5 * want / (2 * np.pi) + spare * RGB / (2 * np.pi))


@pytest.mark.parametrize(("cone", "start"), [(40.0, 15.0), (40.0, 38.0), (87.0, 20.0), (5.0, 0.0)])
def test_a_spots_picture_is_its_falloff(cone: float, start: float):
    """Interpolated at random places of the cone, as Mitsuba does."""
    light = SpotLight(vector(0, 0, 0), Z, RGB, cone, start)
    image = falloff(light)[..., 0]
    rng = np.random.default_rng(1)
    radius, turn = np.sqrt(rng.random(4000)), rng.uniform(0, 2 * np.pi, 4000)
    want = [
        smoothstep(float(t), start, cone) for t in np.degrees(np.arctan(radius * np.tan(np.radians(cone))))
    ]
    at = (np.stack([radius * np.sin(turn), radius * np.cos(turn)]) + 1) / 2 * len(image) - 0.5
    low = np.clip(np.floor(at).astype(int), 0, len(image) - 2)
    (b, a), (j, i) = at - low, low
    got = (1 - b) * ((1 - a) * image[j, i] + a * image[j, i + 1]) + b * (
        (1 - a) * image[j + 1, i] + a * image[j + 1, i + 1]
    )
    print(f"{len(image)} texels, error {np.abs(got - want).max():.1e}")
    assert np.abs(got - want).max() <= 1.5 * FALLOFF_ERROR


def test_spots_that_mitsuba_cannot_have_are_refused():
    for cone, start, word in ((89.0, 10.0, "beyond"), (30.0, 29.99, "too steep")):
        given = lit([floor()], [SpotLight(2 * Y, -Y, RGB, cone, start)], above(POINT, 0.1))
        assert word in str(BACKEND.refuses(given))


IMAGE = np.random.default_rng(5).random((7, 7, 3))
IMAGE[2, 5] = (40, 30, 5)
ENVIRONMENTS: dict[str, list[Environment]] = {
    "constant": [Environment(RGB)],
    "half": [Environment(RGB, frame=turned(unit(1, 1, 0.5)), hemisphere=True)],
    "equal-area, mirrored half": [
        Environment(RGB, IMAGE, frame=turned(unit(1, 1, 0.5), mirrored=True), hemisphere=True)
    ],
    "latitude-longitude": [Environment(RGB, IMAGE[:4], "latitude-longitude", turned(unit(-1, 0.3, 0.5)))],
    "three at once": [
        Environment(RGB, IMAGE, frame=turned(Y)),
        Environment(RGB[::-1].copy(), IMAGE[:4], "latitude-longitude", turned(X)),
        Environment(RGB),
    ],
}


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sixteenth of the texels, for speed; how much the number of them matters is
    test_mitsuba_environment's.
    """
    monkeypatch.setattr(mitsuba_environment, "ROWS", 256)
    monkeypatch.setattr(mitsuba_environment, "SUBCELLS", 1024)


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("name", ENVIRONMENTS)
@pytest.mark.usefixtures("mitsuba")
def test_an_environment_gives_its_irradiance(name: str):
    """At 4 standard errors 0.4 % is caught; an axis astray or a mirrored image changes these by 5 % or
    more.
    """
    given = ENVIRONMENTS[name]
    value, error = render(lit([floor()], given, above(POINT, 0.01, 0.3)), 2**16)
    want = np.sum([irradiance(one, Y) for one in given], axis=0) / (2 * np.pi)
    print(f"{name}: relative error {value / want - 1}, would have caught {(4 * error / want).max():.2%}")
    assert np.all(4 * error < 4e-3 * want)
    assert np.all(np.abs(value - want) < 4 * error + 4e-4 * want)


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("mapping", ["equal-area", "latitude-longitude"])
@pytest.mark.usefixtures("mitsuba")
def test_an_environment_is_seen_where_pbrt_looks_it_up(mapping: str, mirrored: bool):
    """The nearest texel along each pixel's ray, written down anew; texels are 30 pixels wide, so that few
    pixels see an edge.
    """
    frame = turned(unit(0.4, 0.5, 0.8), mirrored)
    environment = Environment(RGB, IMAGE, mapping, frame)
    camera = look_at(vector(1, 2, 3), vector(0.2, 1, 0.5), vector(0.1, 1, 0))
    size, fov = 48, 70.0
    seen = picture(lit([], [environment], (camera, fov), size), 1024)
    y, x = (np.mgrid[:size, :size] + 0.5) / size * 2 - 1
    d = np.stack([x, -y, np.full_like(x, 1 / np.tan(np.radians(fov / 2)))], -1)
    d = (d / np.linalg.norm(d, axis=-1, keepdims=True)) @ camera[:3, :3].T @ frame
    height, width = IMAGE.shape[:2]
    if (
        mapping == "equal-area"
    ):  # the texel whose middle is nearest, corners apart: found by search, not by the formula under test
        fine = (np.arange(width * 32) + 0.5) / (width * 32)
        places = np.stack(np.meshgrid(fine, fine), -1).reshape(-1, 2)
        from scipy.spatial import cKDTree  # pyright: ignore[reportMissingTypeStubs]

        place = places[cKDTree(_sphere(places)).query(d.reshape(-1, 3))[1]].reshape(*d.shape[:2], 2)
        column, row = np.int64(place[..., 0] * width), np.int64(place[..., 1] * height)
    else:
        row = np.int64(np.arccos(d[..., 2]) / np.pi * height)
        column = np.int64(np.mod(np.arctan2(d[..., 1], d[..., 0]), 2 * np.pi) / (2 * np.pi) * width)
    same = np.all(np.abs(seen - RGB * IMAGE[row, column]) < 1e-3 * RGB, axis=-1)
    assert same.mean() > 0.7


def _sphere(places: Array) -> Array:
    from tests.kit.mitsuba_checks import towards

    return towards(places)


TWO_SIDED: dict[str, tuple[Geometry, float]] = {
    # Irradiance 1 below and 1 above; each light is symmetrical about the plane y = 0.
    "rectangle": (rectangle(vector(0, 0, 0), 0.5 * X, 0.5 * Z), 0.0),
    "disk": (Disk(vector(0, 0, 0), Y, 0.5), np.pi * 0.25 / 1.25),
    "mesh": (
        TriangleMesh(np.array([[-0.5, 0, -0.5], [0.5, 0, -0.5], [0, 0, 0.7]]), np.array([[0, 1, 2]])),
        0.0,
    ),
    "sphere": (Sphere(vector(0, 0, 0), 0.5), np.pi * 0.25),
}


def two_sided(geometry: Geometry) -> ShapeDescription:
    return dataclasses.replace(shape(geometry, 0.0), emission=Emission(RGB, two_sided=True))


def irradiance_of_polygon(corners: Array) -> float:
    """Irradiance at the origin, normal +y, from a polygon of radiance 1 above the horizon: Lambert's
    formula.
    """
    a = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    b = np.roll(a, -1, axis=0)
    edge = np.cross(a, b)
    angle = np.arccos(np.clip(np.sum(a * b, axis=1), -1, 1))
    return abs(float(np.sum(angle * edge[:, 1] / np.linalg.norm(edge, axis=1)))) / 2


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("name", TWO_SIDED)
@pytest.mark.usefixtures("mitsuba")
def test_a_two_sided_light_shines_on_both_sides(name: str, side: int):
    """A floor below and one above: each sees one side of the light, and the light hides the other floor's
    reflection from nothing.

    At 4 standard errors 0.5 % is caught: a side that is missing, half as bright or in the other's shadow is
    50 to 100 %.
    """
    geometry, want = TWO_SIDED[name]
    if isinstance(geometry, TriangleMesh):
        want = irradiance_of_polygon(geometry.vertices + Y)
    elif name == "rectangle":
        want = irradiance_of_polygon(geometry.vertices[[0, 1, 3, 2]] + Y)  # pyright: ignore[reportAttributeAccessIssue]
    plane = shape(rectangle(-side * Y, 8 * X, 8 * Z))
    camera = look_at(-0.2 * side * Y, -side * Y, Z)
    value, error = render(scene([plane, two_sided(geometry)], camera, 1.0), 2**16)
    if name == "sphere":  # the camera is in it and sees the inside
        np.testing.assert_allclose(value, RGB, rtol=1e-5)
        outside = look_at(-0.7 * side * Y, -side * Y, Z)
        value, error = render(scene([plane, two_sided(geometry)], outside, 1.0), 2**16)
    want = want * RGB / (2 * np.pi)
    print(f"{name}: relative error {value / want - 1}, would have caught {(4 * error / want).max():.2%}")
    assert np.all(4 * error < 5e-3 * want)
    assert np.all(np.abs(value - want) < 4 * error + 2e-4 * want)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.usefixtures("mitsuba")
def test_both_sides_of_a_light_are_seen_as_they_are(side: int):
    """Four lights, from above and from below: nothing but their radiance and black is seen, and each is
    seen.
    """
    where = dict(
        zip(TWO_SIDED, (vector(-1, 0, -1), vector(1, 0, -1), vector(-1, 0, 1), vector(1, 0, 1)), strict=True)
    )
    lights = [two_sided(moved_by(geometry, where[name])) for name, (geometry, _) in TWO_SIDED.items()]
    image = picture(scene(lights, look_at(6 * side * Y, vector(0, 0, 0), Z), 40.0, 64, 64), 1)
    whole, black = (np.all(np.abs(image / RGB - value) < 1e-6, axis=-1) for value in (1, 0))
    inside = np.all([np.roll(~black, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0)
    assert np.all(whole[inside])
    assert all(whole[quarter(i, j)].sum() > 20 for i in range(2) for j in range(2))


def quarter(i: int, j: int) -> tuple[slice, slice]:
    return slice(32 * i, 32 * i + 32), slice(32 * j, 32 * j + 32)


def moved_by(geometry: Geometry, offset: Array) -> Geometry:
    if isinstance(geometry, Sphere | Disk):
        return dataclasses.replace(geometry, center=geometry.center + offset)
    return dataclasses.replace(geometry, vertices=geometry.vertices + offset)


def test_the_frame_is_chosen_by_lights_that_have_a_place():
    far = normalising_frame(lit([floor()], [PointLight(vector(3, 100, -2), RGB)], above(POINT, 0.1)))
    np.testing.assert_array_equal(far.center, [3, 0, -2])
    np.testing.assert_array_equal(
        normalising_frame(lit([floor()], [Environment(RGB)], above(POINT, 0.1))).center, [0, 0, 0]
    )
    empty = lit([], [Environment(RGB)], above(POINT, 0.1))
    assert convert(empty).objects[0].kind == "constant"


def test_a_point_light_in_a_surface_is_refused():
    for height in (1e-2, 1e-6):
        said = reason(lit([floor()], [PointLight(height * Y, RGB)], above(POINT, 0.1)))
        assert (said is None) == (height > 1e-4), said


def test_a_hole_of_light_is_no_light():
    with pytest.raises(SceneError, match="beyond"):
        convert(lit([floor()], [SpotLight(2 * Y, -Y, RGB, 120.0, 10.0)], above(POINT, 0.1)))
