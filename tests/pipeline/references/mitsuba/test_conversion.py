"""Does what reaches Mitsuba mean what the description says: place, side, size, scale, radiance, and what is
refused.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.references.backends.mitsuba import MitsubaBackend
from pipeline.references.mitsuba.limits import reason
from pipeline.references.mitsuba.scene import convert, normalising_frame
from pipeline.references.protocol import BACKENDS, ReferenceRequest, refusal
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Array, BilinearMesh, Disk, Emission, Sphere, TriangleMesh
from scenes.errors import PenumbraError, SceneError
from tests.kit.mitsuba_scenes import above, floor, look_at, moved, project, rectangle, scene, shape, vector

BACKEND = MitsubaBackend()
X, Y, Z = np.eye(3)


def render(given: SceneDescription, spp: int, batches: int = 64) -> tuple[Array, Array]:
    """Mean and standard error over the whole image, (3,) each."""
    image = BACKEND.render(given, ReferenceRequest(spp, batches))
    pixels = image.mean[..., 0].size
    return image.mean.mean(axis=(0, 1)), np.sqrt(image.variance.sum(axis=(0, 1))) / pixels


@pytest.mark.parametrize("size", [(90, 64), (64, 90)])
@pytest.mark.usefixtures("mitsuba")
def test_points_appear_where_pbrts_camera_sees_them(size: tuple[int, int]):
    """Four glowing balls of one colour each: the centroids of their images against the projection of their
    centres.

    0.1 pixel would catch a mirrored or turned image (tens of pixels), fov on the other side (10), half a
    pixel's shift.
    """
    camera = look_at(vector(3, 4, -6), vector(0.2, 0.5, 0.1), vector(0.1, 1, 0))
    centers = [vector(-1.2, 1, 0.3), vector(0.8, 0.4, 0.9), vector(0.4, 1.9, -0.2)]
    balls = [shape(Sphere(center, 0.12), 0.0, 3 * np.eye(3)[i]) for i, center in enumerate(centers)]
    given = scene(balls, camera, 38.0, *size)
    mean = BACKEND.render(given, ReferenceRequest(256, 2)).mean
    y, x = np.mgrid[: size[1], : size[0]] + 0.5
    for channel, center in enumerate(centers):
        weight = mean[..., channel] / mean[..., channel].sum()
        assert mean[..., channel].max() == pytest.approx(3.0, rel=1e-6)
        np.testing.assert_allclose([(x * weight).sum(), (y * weight).sum()], project(given, center), atol=0.1)


def lights(turned: bool) -> list[tuple[Array, TriangleMesh | BilinearMesh | Sphere | Disk]]:
    """One light of every kind over a place of its own, facing the floor, or turned away from it by the
    description's own means.
    """
    places = [vector(-6, 0, -6), vector(6, 0, -6), vector(-6, 0, 6), vector(6, 0, 6)]
    up = [place + 1.5 * Y for place in places]
    corners = up[2] + np.array([[-0.5, 0, -0.5], [0.5, 0, -0.5], [0, 0, 0.7]])
    return list(
        zip(
            places,
            (
                rectangle(up[0], 0.5 * X, 0.5 * Z, reverse=turned),
                Disk(up[1], Y if turned else -Y, 0.5),
                TriangleMesh(corners, np.array([[0, 1, 2]]), reverse=turned),
                Sphere(up[3], 0.5, reverse=turned),
            ),
            strict=True,
        )
    )


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.usefixtures("mitsuba")
def test_a_light_shines_on_its_own_side_only(turned: bool):
    placed = lights(turned)
    shapes = [floor(), *(shape(geometry, 0.0, (1, 2, 3)) for _, geometry in placed)]
    # From above and outside, looking down: the places are seen past the lights.
    given = scene(shapes, look_at(vector(0, 30, 0), vector(0, 0, 0), Z), 32.0, 32, 32)
    mean = BACKEND.render(given, ReferenceRequest(64, 4)).mean
    if turned:  # only their own backs, now fronts, are seen: nothing reaches the floor
        seen = mean.reshape(-1, 3)[mean.reshape(-1, 3).any(axis=1)]
        assert len(seen) < 60  # of 1024 pixels: three lights of about 1 m^2 in a view of 17 m x 17 m
        np.testing.assert_allclose(
            seen / seen[:, :1], np.broadcast_to([1.0, 2.0, 3.0], seen.shape), rtol=1e-5
        )
        return
    for place, _ in placed:
        column, row = project(given, place + 1.5 * Z).astype(int)  # beside the light's image
        # Its own light gives about 0.03; another, 12 m away and at grazing angles, 2e-5.
        assert mean[row - 1 : row + 2, column - 1 : column + 2, 0].mean() > 0.005


@pytest.mark.usefixtures("mitsuba")
def test_materials_are_two_sided():
    """A floor turned over by its corners' order: Mitsuba's plain diffuse is black from behind."""
    light = shape(rectangle(vector(0, 2, 0), X, Z), 0.0, (1, 1, 1))
    camera = look_at(vector(3, 4, -6), vector(0, 0, 0), Y)
    (a, ea), (b, eb) = (
        render(scene([floor(reverse=r), light], camera, 40.0, 16, 16), 2**13) for r in (False, True)
    )
    assert np.all(ea < 2e-3 * a)
    assert np.all(np.abs(a - b) < 4 * np.hypot(ea, eb))


def irradiance_of_polygon(corners: Array, normal: Array) -> float:
    """Irradiance at the origin from a polygon of radiance 1 wholly above the horizon: Lambert's formula."""
    a = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    b = np.roll(a, -1, axis=0)
    edge = np.cross(a, b)
    edge = edge / np.linalg.norm(edge, axis=1, keepdims=True)
    angle = np.arccos(np.clip(np.sum(a * b, axis=1), -1, 1))
    return abs(float(np.sum(angle * (edge @ normal)))) / 2


POINT = vector(0.7, 0, -0.4)
TILTED = rectangle(
    POINT + vector(1.9, 1.6, 1.2), vector(0.5, 0.1, -0.3), vector(0.3, 0.1, 0.6), reverse=False
)
CLOSED_FORMS = {
    # On the axis of a disk: pi r^2 / (r^2 + h^2).
    "disk": (Disk(POINT + 1.5 * Y, -Y, 0.8), np.pi * 0.8**2 / (0.8**2 + 1.5**2)),
    # A whole sphere above the horizon: pi (r / d)^2 cos.
    "sphere": (Sphere(POINT + vector(-1, 1.5, 1), 0.4), np.pi * 0.4**2 / 4.25 * 1.5 / np.sqrt(4.25)),
    "rectangle": (TILTED, irradiance_of_polygon(TILTED.vertices[[0, 1, 3, 2]] - POINT, Y)),
    # Three sides of a square and more: not a rectangle, so a mesh to Mitsuba.
    "quadrilateral": (
        BilinearMesh(
            POINT + np.array([[0, 1, 0], [0.8, 1, 0], [0, 1, 0.9], [1.3, 1, 1.1]]),
            np.array([[0, 2, 1, 3]]),
            True,
        ),
        irradiance_of_polygon(np.array([[0, 1, 0], [0.8, 1, 0], [1.3, 1, 1.1], [0, 1, 0.9]]), Y),
    ),
}


@pytest.mark.parametrize("names", [("disk", "sphere", "rectangle"), ("quadrilateral",)], ids="+".join)
@pytest.mark.usefixtures("mitsuba")
def test_a_floor_point_agrees_with_its_closed_form(names: tuple[str, ...]):
    """A patch of side 0.01: irradiance differs from its middle's by less than (0.01 / 1)^2.

    At 4 standard errors 0.2 % are caught.
    """
    shapes = [shape(CLOSED_FORMS[name][0], 0.0, (1, 2, 3)) for name in names]
    camera, fov = above(POINT, 0.01, distance=0.3)
    value, error = render(scene([floor(), *shapes], camera, fov), 2**18)
    want = 0.5 / np.pi * sum(CLOSED_FORMS[name][1] for name in names) * vector(1, 2, 3)
    print(f"relative error {value / want - 1}, would have caught {(4 * error / want).max():.2%}")
    assert np.all(error < 5e-4 * want)
    assert np.all(np.abs(value - want) < 4 * error + 1e-4 * want)


def everything() -> SceneDescription:
    shapes = [
        floor(),
        shape(rectangle(vector(0, 2, 0), X, Z), 0.0, (1, 2, 3)),
        shape(Sphere(vector(0.5, 0.6, 0.3), 0.3)),
        shape(Disk(vector(-1, 1, -0.5), vector(0.6, 0.8, 0), 0.4)),
        shape(TriangleMesh(vector(2, 0, 0, 2, 1, 0, 2, 0, 1).reshape(3, 3), np.array([[0, 1, 2]]))),
    ]
    return scene(shapes, look_at(vector(3, 4, -6), vector(0, 0.5, 0), Y), 40.0, 32, 24)


@pytest.fixture(scope="module")
def image(mitsuba: None) -> Array:
    return BACKEND.render(everything(), ReferenceRequest(256, 2)).mean


@pytest.mark.parametrize(("scale", "offset"), [(1.0, 1e5), (1e-6, 0.0), (1e6, -3e8)])
@pytest.mark.usefixtures("mitsuba")
def test_an_image_depends_on_neither_place_nor_scale(image: Array, scale: float, offset: float):
    """Same seeds, so that only rounding differs.

    Untreated, Mitsuba reads 0.9 % low at 1e5 and nothing but black at 1e-6.
    """
    there = BACKEND.render(
        moved(everything(), scale, offset * vector(1, 2, -1)), ReferenceRequest(256, 2)
    ).mean
    assert there.mean() == pytest.approx(image.mean(), rel=1e-4)
    assert np.quantile(np.abs(there - image), 0.99) < 1e-4 * image.mean()


def test_a_distant_light_leaves_the_centre_in_the_scene():
    far = shape(rectangle(vector(0, 1e6, 0), 500 * X, 500 * Z), 0.0, (1, 1, 1))
    frame = normalising_frame(scene([floor(), far], np.eye(4), 40.0))
    np.testing.assert_array_equal(frame.center, [0, 0, 0])
    assert np.log2(frame.scale) % 1 == 0


@pytest.mark.usefixtures("mitsuba")
def test_a_mirrored_camera_mirrors_the_image_and_its_scale_changes_nothing(image: Array):
    """`Scale -1 1 1` before LookAt, as pbrt's own scenes have it."""
    given = everything()
    mirrored = given.camera.camera_to_world @ np.diag([-2.0, 2, 2, 1])
    twin = dataclasses.replace(given, camera=dataclasses.replace(given.camera, camera_to_world=mirrored))
    flipped = BACKEND.render(twin, ReferenceRequest(256, 2)).mean
    assert np.mean((flipped[:, ::-1] - image) ** 2) < 0.02 * np.mean((flipped - image) ** 2)


def test_what_is_refused():
    dark = scene([floor()], np.eye(4), 40.0)
    assert "no lights" in str(BACKEND.refuses(dark))
    with pytest.raises(PenumbraError, match=r"by hand.*no lights"):
        BACKEND.render(dark, ReferenceRequest(2, 2))
    assert BACKEND.refuses(everything()) is None
    thick = Disk(1e-4 * Y, Y, 1.0)  # far enough off the floor for a light of one side, and not for one of two
    for both, refused in ((False, False), (True, True)):
        lamp = dataclasses.replace(shape(thick), emission=Emission(np.ones(3), two_sided=both))
        assert (
            "from other geometry" in str(BACKEND.refuses(scene([floor(), lamp], np.eye(4), 40.0)))
        ) == refused


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1.2e-4, 8e-5, 1e-6, 0.0])
def test_gaps_below_mitsubas_reach_are_refused(gap: float):
    """Measured, a 2x2 light reads 0 where the truth is 0.5 below a gap of about 9e-5."""
    for light in (
        rectangle(vector(0, gap, 0), X, Z),
        Disk(gap * Y, -Y, 1.0),
        Sphere(vector(0, 1 + gap, 0), 1.0),
    ):
        said = reason(scene([floor(), shape(light, 0.0, (1, 1, 1))], np.eye(4), 40.0))
        # A sphere reaches two radii up, and the rule takes the farthest point of a light: 1.8e-4 for it.
        assert (said is None) == (gap >= (1.8e-4 if isinstance(light, Sphere) else 9.2e-5))
        assert said is None or "overlook it" in said


def test_the_backend_that_is_named_instead_takes_the_scene():
    """The closed form where nothing stands on the floor, and not where something does."""
    light = shape(rectangle(vector(0, 1e-6, 0), X, Z), 0.0, (1, 1, 1))
    ball = shape(Sphere(vector(0, 3, 0), 0.2))
    for more, named in (([], True), ([ball], False)):
        given = scene([floor(), light, *more], np.eye(4), 40.0)
        told = str(refusal(BACKEND, given, "radiance"))
        assert "overlook it; " in told and ("closed-form" in told) is named
        assert (BACKENDS["closed-form"].refuses(given) is None) is named


def test_a_gap_to_a_small_triangle_of_a_large_mesh_is_found():
    rng = np.random.default_rng(3)
    corners = rng.uniform(-4, 4, (2000, 1, 3)) * (1, 0.2, 1) + rng.uniform(-0.05, 0.05, (2000, 3, 3))
    light = shape(rectangle(vector(0, 2, 0), X, Z), 0.0, (1, 1, 1))

    def refusal(corners: Array) -> str | None:
        mesh = TriangleMesh(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))
        return reason(scene([floor(), shape(mesh), light], np.eye(4), 40.0))

    assert refusal(corners) is None
    corners[1234] = vector(0.3, 2.00003, 0.2, 0.4, 2.1, 0.2, 0.3, 2.1, 0.3).reshape(3, 3)
    assert "3e-05 from other geometry" in str(refusal(corners))


@pytest.mark.usefixtures("mitsuba")
def test_a_view_finer_than_mitsubas_rays_is_an_error():
    camera, fov = above(vector(4, 0, 4), 1e-4)
    light = shape(rectangle(vector(0, 2, 0), X, Z), 0.0, (1, 1, 1))
    with pytest.raises(PenumbraError, match="pixels off the surfaces in view"):
        BACKEND.render(scene([floor(), light], camera, fov), ReferenceRequest(2, 2))


def test_a_concave_patch_has_no_counterpart():
    light = shape(Disk(2 * Y, -Y, 1.0), 0.0, (1, 1, 1))
    arrow = BilinearMesh(
        np.array([[0, 0, 0], [2, 0, 1], [1, 0, 2], [0.4, 0, 0.4]], dtype=float), np.array([[0, 1, 2, 3]])
    )
    with pytest.raises(SceneError, match="not convex"):
        convert(scene([shape(arrow), light], np.eye(4), 40.0))
