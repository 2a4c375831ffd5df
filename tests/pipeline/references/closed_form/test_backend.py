"""Closed-form images: against pbrt's and Mitsuba's, against brute force inside single pixels, and what is
refused.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import scenes
from pipeline.references.backends.closed_form import ClosedFormBackend
from pipeline.references.closed_form.film import film_plane, silhouette
from pipeline.references.closed_form.image import PixelImage, closed_form_image, radiance_at
from pipeline.references.closed_form.scene import analyse
from pipeline.references.protocol import BACKENDS, ReferenceImage, ReferenceRequest
from pipeline.statistics.welch import Moments, compare_images
from scenes.description.materials import Diffuse
from scenes.description.scene import Film, PerspectiveCamera, SceneDescription
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
from scenes.images.exr import read_rgb
from tests.kit.closed_form_scenes import LIGHTS, lit_by
from tests.kit.mitsuba_scenes import moved, project, rectangle, shape, vector

pytestmark = pytest.mark.usefixtures("thorough")

PBRT = Path(__file__).parents[5] / "shared" / "references"
GAPS = [1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 0.0]


def render(scene: SceneDescription) -> ReferenceImage:
    return ClosedFormBackend().render(scene, ReferenceRequest())


def at_tolerance(scene: SceneDescription, tolerance: float) -> PixelImage:
    return closed_form_image(analyse(scene), film_plane(scene.camera, scene.film), tolerance)


def exact(image: ReferenceImage, mean: Array | None = None) -> Moments:
    return Moments(image.mean if mean is None else mean, image.variance, np.inf)


@pytest.fixture(scope="module")
def touching() -> tuple[SceneDescription, Moments]:
    """pbrt's touching-light and the mean of its two images with the variance that they show."""
    if not PBRT.is_dir():
        pytest.skip(f"pbrt's images are not at {PBRT}")
    a, b = (read_rgb(PBRT / f"touching-light.{which}.exr") for which in "ab")
    return scenes.load(str(PBRT / "touching-light.pbrt")), Moments((a + b) / 2, (a - b) ** 2 / 4, 1)


def test_agrees_with_pbrt(touching: tuple[SceneDescription, Moments]) -> None:
    scene, pbrt = touching
    for result in compare_images(exact(render(scene)), pbrt, regions=(8, 8), alpha=1e-3):
        print(result)
        assert not result.reject
        assert result.name != "image" or result.smallest_detectable < 1e-3


def test_the_comparison_with_pbrt_can_fail(touching: tuple[SceneDescription, Moments]) -> None:
    """Mirrored, upside down, 0.5 % too bright, seen with 1 % more field of view: each is rejected."""
    scene, pbrt = touching
    image = render(scene)
    wider = replace(scene, camera=replace(scene.camera, fov=scene.camera.fov * 1.01))
    for wrong in (image.mean[:, ::-1], image.mean[::-1], image.mean * 1.005, render(wider).mean):
        results = compare_images(exact(image, np.ascontiguousarray(wrong)), pbrt, regions=(8, 8), alpha=1e-3)
        assert any(result.reject for result in results)


@pytest.mark.parametrize("light", ["sphere", "tilted disk"])
@pytest.mark.usefixtures("mitsuba")
def test_agrees_with_mitsuba(light: str) -> None:
    scene = lit_by(LIGHTS[light])
    other = BACKENDS["mitsuba"].render(scene, ReferenceRequest(spp=1024, batches=64))
    sampled = Moments(other.mean, other.variance, other.batches - 1)
    for result in compare_images(exact(render(scene)), sampled, alpha=1e-3):
        print(result)
        assert not result.reject
        assert result.name != "image" or result.smallest_detectable < 5e-3


@pytest.mark.parametrize("gap", GAPS)
def test_touching_light_at_every_gap(gap: float) -> None:
    """Accepted, finite, and within its own bound of an image with a 1000 times tighter one."""
    scene = scenes.load("touching-light", {"gap": gap, "xresolution": 64, "yresolution": 48})
    assert ClosedFormBackend().refuses(scene) is None
    loose, tight = at_tolerance(scene, 1e-6), at_tolerance(scene, 1e-9)
    error = np.abs(loose.mean - tight.mean)
    print(f"gap {gap:g}: largest error {error.max():.1e}, largest bound {loose.bound.max():.1e}")
    assert np.all(np.isfinite(loose.mean)) and loose.mean.max() > 1
    assert np.all(error <= loose.bound + 1e-14)
    lit = loose.mean > 0.01 * loose.mean.mean()
    assert np.all(loose.bound[lit] <= 4e-6 * loose.mean[lit])
    assert error.max() < 1e-10


def _film_line(scene: SceneDescription, a: Array, b: Array, x: Array) -> Array:
    """Film y, in pixels, at film x (n,) of the line through the world points a and b."""
    (xa, ya), (xb, yb) = project(scene, a), project(scene, b)
    return ya + (yb - ya) * (x - xa) / (xb - xa)


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_pixel_at_the_contact(gap: float) -> None:
    """The pixel that the foot of the light crosses, integrated down its columns with panels graded towards
    the line of contact.

    Nothing of the adaptive quadrature, its measure or its cuts is in it; both are good to 1e-8.
    """
    scene = scenes.load("touching-light", {"gap": gap, "xresolution": 64, "yresolution": 48})
    parts, film = analyse(scene), film_plane(scene.camera, scene.film)
    left, right, lift = vector(-1, 0, 0), vector(1, 0, 0), vector(0, gap, 0)
    column, row = (int(v) for v in project(scene, vector(0.05, 0, 0)))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    x = column + (nodes + 1) / 2
    foot, edge = _film_line(scene, left, right, x), _film_line(scene, left + lift, right + lift, x)
    assert np.all((row < edge) & (edge <= foot) & (foot < row + 1))
    total = ((edge - row) * weights / 2).sum() * parts.radiance
    grades = np.concatenate(([0.0], np.logspace(-12, 0, 121)))
    pixel = film.x[1] - film.x[0]
    for lo, hi in pairwise(grades):
        depth = lo + (hi - lo) * (nodes + 1) / 2
        y = foot[:, None] + (row + 1 - foot[:, None]) * depth
        points = np.stack(
            (
                film.x[0] + pixel * np.broadcast_to(x[:, None], y.shape),
                film.y[0] - pixel * y,
                np.ones_like(y),
            ),
            -1,
        )
        seen = radiance_at(parts, film, points.reshape(-1, 3)).reshape(*y.shape, 3)
        w = np.outer(weights / 2 * (row + 1 - foot), weights / 2 * (hi - lo))
        total = total + np.einsum("ij,ijc->c", w, seen)
    np.testing.assert_allclose(render(scene).mean[row, column], total, rtol=1e-8)


def _grid(scene: SceneDescription, pixel: int, x: Array, y: Array) -> Array:
    """Radiance (n, m, 3) at shares x and y of a pixel."""
    film = film_plane(scene.camera, scene.film)
    corner = film.squares(np.array([pixel]))[0]
    points = corner[0] + x[:, None, None] * (corner[1] - corner[0]) + y[:, None] * (corner[3] - corner[0])
    return radiance_at(analyse(scene), film, points.reshape(-1, 3)).reshape(x.size, y.size, 3)


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.usefixtures("statistical")
def test_pixels_by_brute_force(light: str) -> None:
    """Cut pixels against 200 x 200 points, smooth ones against Gauss; the whole image within its bound of a
    tighter one.
    """
    scene = lit_by(LIGHTS[light])
    image, tight = at_tolerance(scene, 1e-6), at_tolerance(scene, 1e-9)
    assert np.all(np.abs(image.mean - tight.mean) <= image.bound + 1e-14)
    cut = silhouette(analyse(scene), film_plane(scene.camera, scene.film)).mixed
    share = (np.arange(200) + 0.5) / 200
    for pixel in cut[:: max(1, cut.size // 4)]:
        # A straight or slowly curving outline: of its up to 400 cells of 1/200^2 each, half a cell is the
        # most to be off by.
        grid = _grid(scene, int(pixel), share, share).mean(axis=(0, 1))
        np.testing.assert_allclose(image.mean[pixel], grid, atol=3 / 200, rtol=0)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    for pixel in (scene.film.width * row + column for row, column in ((34, 4), (34, 24), (30, 40))):
        grid = (
            np.einsum("i,j,ijc->c", weights, weights, _grid(scene, pixel, (nodes + 1) / 2, (nodes + 1) / 2))
            / 4
        )
        np.testing.assert_allclose(tight.mean[pixel], grid, rtol=1e-9, atol=1e-15)


def test_light_coverage_is_exact() -> None:
    """Area of a disk and a sphere on the film, seen along the axis: the ellipse is a circle and its area is
    known.
    """
    camera = PerspectiveCamera(np.eye(4), 40.0)
    scale = 30 / 2 / np.tan(np.radians(20))
    sine = 0.6 / 3.0
    for light, radius in (
        (Disk(vector(0, 0, 3), vector(0, 0, -1), 0.6), 0.6 / 3),
        (Sphere(vector(0, 0, 3), 0.6), sine / np.sqrt(1 - sine**2)),
    ):
        emitter = ShapeDescription(light, Diffuse(np.zeros(3)), Emission(np.ones(3)))
        image = render(SceneDescription("by hand", camera, Film(41, 30), (emitter,)))
        assert image.mean[..., 0].sum() == pytest.approx(np.pi * (radius * scale) ** 2, rel=1e-13)
        assert image.mean.max() == pytest.approx(1, rel=1e-14) and image.mean.min() == 0


def test_two_sided_light_shines_behind_itself() -> None:
    one = render(lit_by(LIGHTS["upright rectangle"])).mean
    other = render(lit_by(replace_reverse(LIGHTS["upright rectangle"]))).mean
    both = render(lit_by(LIGHTS["upright rectangle"], two_sided=True)).mean
    np.testing.assert_allclose(both, one + other, rtol=1e-7, atol=1e-12)
    assert other.max() > 0.01 and not np.allclose(one, other)


def replace_reverse(light: Geometry) -> BilinearMesh:
    assert isinstance(light, BilinearMesh)
    return replace(light, reverse=not light.reverse)


def test_centres_are_exact_radiance() -> None:
    """Smooth pixels differ from their centre by curvature alone; the light is seen as it is, the background
    is black.
    """
    scene = scenes.load("touching-light", {"gap": 0.1, "xresolution": 160, "yresolution": 120})
    film, image = film_plane(scene.camera, scene.film), render(scene).mean
    centres = radiance_at(analyse(scene), film, film.centers()).reshape(image.shape)
    near = np.abs(centres - image) <= 2e-3 * image
    assert near.mean() > 0.95  # all but the light's outline and the floor by its foot
    assert np.all(centres.reshape(-1, 3).max(axis=0) == (3, 2.6, 2)) and np.all(centres[0] == 0)


def test_tiling_and_orientation_of_the_receivers_do_not_matter() -> None:
    """One patch, four patches, eight triangles turned either way, two shapes: the same floor."""
    scene = lit_by(LIGHTS["upright rectangle"])
    want = render(scene).mean
    g = np.linspace(-2, 2, 3)
    p = np.array([(x, 0.0, z) for x in g for z in g])
    quads = np.array(
        [[3 * i + j, 3 * i + j + 3, 3 * i + j + 1, 3 * i + j + 4] for i in range(2) for j in range(2)]
    )
    triangles = np.concatenate((quads[:, [0, 1, 3]], quads[:, [0, 2, 3]]))
    halves = [shape(rectangle(vector(x, 0, 0), vector(1, 0, 0), vector(0, 0, 2))) for x in (-1.0, 1.0)]
    for floors in ([shape(BilinearMesh(p, quads))], [shape(TriangleMesh(p, triangles))], halves):
        image = render(replace(scene, shapes=(*floors, scene.shapes[1]))).mean
        np.testing.assert_allclose(image, want, rtol=3e-8, atol=1e-12)


def test_receivers_keep_their_own_albedo() -> None:
    scene = lit_by(LIGHTS["sphere"])
    want = render(scene).mean
    halves = [
        shape(rectangle(vector(x, 0, 0), vector(1, 0, 0), vector(0, 0, 2)), a)
        for x, a in ((-1.0, 0.0), (1.0, 1.0))
    ]
    image = render(replace(scene, shapes=(*halves, scene.shapes[1]))).mean
    dark = image[30:, 0] + image[30:, -1]
    np.testing.assert_allclose(dark, 2 * (want[30:, -1] if image[33, 0, 0] == 0 else want[30:, 0]), rtol=1e-7)


@pytest.mark.parametrize(("scale", "offset"), [(1e6, (0, 0, 0)), (1e-6, (0, 0, 0)), (1.0, (1e3, -2e3, 5e2))])
def test_size_and_place_do_not_matter(scale: float, offset: tuple[float, float, float]) -> None:
    """1e-9 is float64's rounding of the offset, 2e3 * 1e-16, over a pixel's hundredth of the gap."""
    scene = scenes.load("touching-light", {"gap": 1e-3, "xresolution": 48, "yresolution": 36})
    there = moved(scene, scale, vector(*offset))
    np.testing.assert_allclose(render(there).mean, render(scene).mean, rtol=1e-7, atol=1e-9)


def test_seen_from_below() -> None:
    """The scene mirrored in its floor, camera and all, makes the same picture: receivers have two sides."""
    scene = lit_by(LIGHTS["tilted disk"])
    mirror = np.diag([1.0, -1, 1, 1])
    light = LIGHTS["tilted disk"]
    assert isinstance(light, Disk)
    below = replace(light, center=light.center * (1, -1, 1), normal=light.normal * (1, -1, 1))
    camera = PerspectiveCamera(mirror @ scene.camera.camera_to_world, scene.camera.fov)
    emitter = replace(scene.shapes[1], geometry=below)
    image = render(replace(scene, camera=camera, shapes=(scene.shapes[0], emitter)))
    np.testing.assert_allclose(image.mean, render(scene).mean, rtol=1e-12, atol=1e-15)


def test_what_is_answered() -> None:
    scene, shares = lit_by(LIGHTS["upright rectangle"]), []
    image = BACKENDS["closed-form"].render(scene, ReferenceRequest(), shares.append)
    assert image.mean.shape == image.variance.shape == (36, 48, 3)
    assert (image.spp, image.batches, shares[-1]) == (0, 0, 1.0) and image.seconds > 0
    assert np.sqrt(image.variance.max()) == pytest.approx(float(image.provenance["largest_bound"]), rel=1e-2)
    assert 0 < np.sqrt(image.variance.max()) < 1e-7
    assert (
        image.provenance["version"] == ClosedFormBackend().version()
        and len(ClosedFormBackend().version()) == 16
    )
