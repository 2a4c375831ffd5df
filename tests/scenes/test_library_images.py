"""The library's scenes rendered small, and what those promise that came with environments, metals and
instances.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import scenes
from renderer import RenderScene, build, render
from renderer.interfaces.estimator import ESTIMATORS, RADIANCE
from scenes.catalog import LIBRARY
from scenes.description.lights import DistantLight, Environment
from scenes.description.materials import Conductor, Diffuse
from scenes.description.scene import SceneDescription
from scenes.description.shapes import BilinearMesh, Disk, ShapeDescription, Sphere, TriangleMesh
from scenes.errors import PenumbraError
from scenes.images.exr import read_rgb
from scenes.ply.mesh import read_ply

pytestmark = pytest.mark.usefixtures("thorough")

SMALL = {"xresolution": 40, "yresolution": 30}
NAMES = [scene.name for scene in scenes.library()]
COLOURED = ("cornell-direct",)


def small(name: str, **parameters: float) -> SceneDescription:
    return scenes.load(name, {**SMALL, **parameters})


def lights_of(scene: SceneDescription) -> list[ShapeDescription]:
    return [shape for shape in scene.shapes if shape.emission is not None]


def made_by(script: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(script, LIBRARY / "meshes" / f"{script}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", [name for name in NAMES if name != "sealed-box"])
def test_every_picture_shows_something(name: str) -> None:
    """Catches a camera that looks the wrong way, a light that faces away, and pictures too dark or too bright
    to see anything in.
    """
    image = render(small(name), spp=4).image
    assert np.isfinite(image).all()
    gray = image.mean(axis=-1)
    assert 0.02 < np.median(gray) <= 1.0 or name in ("veach-mis", "cornell-direct", "penumbra")
    assert np.mean(gray > 0.03) > 0.35
    assert np.mean(gray > 1.0) < 0.2
    assert np.std(np.clip(gray, 0, 1)) > 0.04


@pytest.mark.parametrize("name", NAMES)
def test_surfaces_are_gray_where_pbrt_compares(name: str) -> None:
    for shape in small(name).shapes:
        assert isinstance(shape.material, Diffuse | Conductor)
        if isinstance(shape.material, Diffuse) and isinstance(shape.material.reflectance, np.ndarray):
            assert np.ptp(shape.material.reflectance) == 0 or name in COLOURED
        if isinstance(shape.material, Conductor):
            assert np.ptp(shape.material.k) == 0


@pytest.mark.parametrize("entry", scenes.library(), ids=NAMES)
def test_values_that_make_no_sense_are_refused_in_words(entry: scenes.catalog.LibraryScene) -> None:
    for parameter in entry.parameters:
        interval = parameter.interval
        bad = [interval.high * 2 + 1, -1.0 if interval.low >= 0 else interval.low * 2]
        bad += [interval.low] if interval.above else []
        for value in bad:
            with pytest.raises(
                PenumbraError, match=f"parameter {parameter.name} = .*: it must be .* and .*"
            ) as told:
                scenes.load(entry.name, {parameter.name: value})
            assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("name", "parameter"),
    [
        ("large-light", "size"),
        ("penumbra", "light_size"),
        ("penumbra", "occluder_height"),
        ("soft-shadow", "size"),
    ],
)
def test_nothing_may_have_no_size(name: str, parameter: str) -> None:
    for value in (0.0, -0.5):
        with pytest.raises(
            PenumbraError, match=f"parameter {parameter} = {value:g}: it must be above 0 and at most"
        ):
            scenes.load(name, {parameter: value})


# takes the closed form and adds what shadows change: nothing on the average only
CONTROL = "analytic-visibility-unbiased"


@pytest.mark.parametrize(
    "estimator",
    [name for name, entry in ESTIMATORS.items() if entry.quantity == RADIANCE and name != CONTROL],
)
def test_no_light_gets_into_the_sealed_box(estimator: str) -> None:
    """Not one sample, nothing being left out by the plan, however near the lamps stand to the walls."""
    for gap in (1e-4, 1e-3, 0.3):
        scene = scenes.load("sealed-box", {"xresolution": 24, "yresolution": 18, "gap": gap})
        if ESTIMATORS[estimator].refuses(scene):  # neither the sky nor, for one of them, round lamps
            flat = tuple(
                s for s in scene.shapes if not (s.emission and isinstance(s.geometry, Disk | Sphere))
            )
            shapes = flat if estimator == "projected-solid-angle" else scene.shapes
            scene = SceneDescription("some lights", scene.camera, scene.film, shapes, scene.lights[1:])
        assert not render(scene, estimator=estimator, spp=2, prune=False).image.any()


def test_no_light_gets_into_the_sealed_box_on_the_average_of_a_control_variate() -> None:
    scene = scenes.load("sealed-box", {"xresolution": 24, "yresolution": 18})
    image = render(scene, estimator=CONTROL, spp=64, prune=False)
    mean, error = image.image.mean(), np.sqrt(image.variance[..., 0].sum()) / image.variance[..., 0].size
    assert 0 < abs(mean) < 5 * error


def test_the_sealed_box_is_dark_for_its_walls_alone() -> None:
    """Without them the same lights are seen and light the ball: it is the walls that are tested."""
    scene = small("sealed-box")
    opened = SceneDescription("open", scene.camera, scene.film, scene.shapes[1:], scene.lights)
    assert (render(opened, spp=1).image > 0).all()


def inside_the_ball(scene: RenderScene) -> np.ndarray:
    """(h, w): pixels whose four corners all see the ball."""
    y, x = np.meshgrid(np.arange(31.0), np.arange(41.0), indexing="ij")
    d = scene.camera.corner + scene.camera.du * x.ravel() + scene.camera.dv * y.ravel()
    t, _ = scene.analytic.closest(np.arange(1), scene.camera.origin, d / np.linalg.norm(d, axis=0))
    corner = np.isfinite(t).reshape(31, 41)
    return corner[:-1, :-1] & corner[:-1, 1:] & corner[1:, :-1] & corner[1:, 1:]


@pytest.mark.parametrize("reflectance", [0.0, 0.25, 1.0])
def test_the_furnace_gives_back_the_reflectance(reflectance: float) -> None:
    """By cosine sampling every single sample is the answer; around the ball there is the light itself, of
    radiance 1.
    """
    scene = build(small("furnace", bright=reflectance, dark=reflectance))
    image, ball = render(scene, estimator="cosine", spp=1).image, inside_the_ball(scene)
    assert 200 < np.count_nonzero(ball) < 600
    np.testing.assert_allclose(image[ball], reflectance, rtol=1e-12)
    np.testing.assert_allclose(image[0], 1.0, rtol=1e-12)


def test_the_furnace_s_squares_are_seen() -> None:
    scene = build(small("furnace"))
    image, ball = render(scene, estimator="cosine", spp=4).image, inside_the_ball(scene)
    values = image[ball][:, 0]
    assert np.mean(np.isclose(values, 0.8)) > 0.2
    assert np.mean(np.isclose(values, 0.3)) > 0.2
    assert np.all((values > 0.3 - 1e-12) & (values < 0.8 + 1e-12))


def test_veach_s_lights_have_one_power_and_four_sizes() -> None:
    scene = scenes.load("veach-mis")
    balls = lights_of(scene)
    sizes = [shape.geometry.radius for shape in balls if isinstance(shape.geometry, Sphere)]
    powers = [
        r**2 * shape.emission.radiance[0] for r, shape in zip(sizes, balls, strict=True) if shape.emission
    ]
    assert sizes == [0.033333, 0.1, 0.3, 0.9]
    np.testing.assert_allclose(powers, 1.0, rtol=1e-3)
    plates = [shape.material.alpha for shape in scene.shapes if isinstance(shape.material, Conductor)]
    assert plates == [0.005, 0.02, 0.05, 0.1]


def test_each_technique_fails_in_the_other_s_corner_of_veach_s_plates() -> None:
    """The figure's point: the largest light in the smoothest plate and the smallest light in the roughest
    one.
    """
    scene = build(scenes.load("veach-mis", {"xresolution": 80, "yresolution": 60}))
    noise = {name: render(scene, estimator=name, spp=64).variance.mean(axis=-1) for name in ("bsdf", "area")}
    smooth_and_large, rough_and_small = (slice(26, 33), slice(56, 76)), (slice(51, 57), slice(8, 20))
    assert noise["area"][smooth_and_large].mean() > 4 * noise["bsdf"][smooth_and_large].mean()
    assert noise["bsdf"][rough_and_small].mean() > 4 * noise["area"][rough_and_small].mean()


@pytest.mark.parametrize("size", [0.05, 1.0, 4.0])
def test_the_large_light_has_one_power_and_stays_out_of_view(size: float) -> None:
    scene = scenes.load("large-light", {"size": size})
    (light,) = lights_of(scene)
    assert light.emission is not None and isinstance(light.geometry, BilinearMesh)
    power = np.pi * light.emission.radiance * size**2
    unit = scenes.load("large-light", {"size": 1.0})
    (one,) = lights_of(unit)
    assert one.emission is not None
    np.testing.assert_allclose(power, np.pi * one.emission.radiance, rtol=1e-12)
    assert not build(scene).camera.sees(light.geometry.vertices.T.copy())


def test_the_sky_is_an_environment_and_a_sun() -> None:
    sky, sun = scenes.load("sky", {"elevation": 30}).lights
    assert isinstance(sky, Environment) and isinstance(sun, DistantLight)
    assert sky.image is None
    assert sky.radiance[0] > sky.radiance[1] > 2 * sky.radiance[2]  # yellow
    assert sun.irradiance[0] > 2 * sun.irradiance[1] > 4 * sun.irradiance[2]  # orange
    assert sun.wi[1] == pytest.approx(0.5)


def test_ambient_occlusion_is_the_sky_s_light_alone() -> None:
    """reflectance times the sky's radiance times the open share of the hemisphere, within five standard
    errors.
    """
    scene = small("sky", sun=0)
    light, openness = (
        render(scene, estimator=name, spp=64, sampler="sobol") for name in ("cosine", "ambient-occlusion")
    )
    sky = scene.lights[0]
    assert isinstance(sky, Environment)
    floor = np.s_[24:, :]  # reflectance 0.5
    expected = 0.5 * sky.radiance * openness.image[floor]
    assert np.abs(light.image[floor].mean(axis=(0, 1)) / expected.mean(axis=(0, 1)) - 1).max() < 0.005


def test_the_map_that_is_checked_in_is_the_one_that_the_script_makes() -> None:
    image = made_by("make_sky").sky()
    np.testing.assert_array_equal(read_rgb(LIBRARY / "maps" / "sky.exr"), image)
    light = scenes.load("environment-map").lights[0]
    assert isinstance(light, Environment)
    assert light.image is not None and light.image.shape == (128, 128, 3)
    np.testing.assert_array_equal(light.frame @ [0, 0, 1], [0, 1, 0])  # the sky's zenith is up


def test_the_sun_is_small_and_gives_two_fifths_of_the_light_on_the_ground() -> None:
    make = made_by("make_sky")
    image, up = make.sky().mean(axis=2), np.maximum(make.directions()[..., 2], 0)
    sun = image > 50
    assert 0.0004 < sun.mean() < 0.0008
    assert 0.35 < (image * up)[sun].sum() / (image * up).sum() < 0.45


def test_the_tree_that_is_checked_in_is_the_one_that_the_script_makes() -> None:
    mesh, corners = read_ply(LIBRARY / "meshes" / "tree.ply"), made_by("make_tree").triangles()
    np.testing.assert_array_equal(mesh.vertices[mesh.triangles], corners)
    assert len(corners) == 1686
    assert corners[..., 1].min() == 0 and corners[..., 1].max() == 1
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(sides, axis=1).min() > 0


def test_the_forest_has_a_million_triangles() -> None:
    scene = small("forest")
    faces = [len(shape.geometry.faces) for shape in scene.shapes if isinstance(shape.geometry, TriangleMesh)]
    assert faces == [2, 640 * 1686]
    assert sum(faces) >= 1_000_000


def test_there_are_sixteen_lights_of_each_shape() -> None:
    kinds = [type(shape.geometry) for shape in lights_of(scenes.load("many-lights"))]
    assert {kind: kinds.count(kind) for kind in set(kinds)} == dict.fromkeys(
        (BilinearMesh, Disk, Sphere, TriangleMesh), 16
    )


def test_the_cornell_box_has_its_red_wall_at_the_left() -> None:
    image = render(scenes.load("cornell-direct", {"xresolution": 30, "yresolution": 30}), spp=4).image
    left, right = image[15, 3], image[15, 26]
    assert left[0] > 4 * left[1] and right[1] > 2 * right[0]


def test_files_of_the_library_are_small() -> None:
    sizes = {
        path.name: path.stat().st_size
        for path in Path(LIBRARY).rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    assert max(sizes.values()) < 300_000, sizes
