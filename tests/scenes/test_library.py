"""What the library's scenes promise in their headers, checked by numbers."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import trimesh

import scenes
from scenes.catalog import LIBRARY, find
from scenes.description.scene import SceneDescription
from scenes.description.shapes import BilinearMesh, Disk, ShapeDescription, Sphere, TriangleMesh
from scenes.errors import PenumbraError, SceneError
from scenes.pbrt.text.template import ANY
from scenes.ply.mesh import read_ply
from tests.kit.scene_texts import HEAD, face_normals

NAMES = [
    "cornell-direct", "disk-light", "environment-map", "forest", "furnace", "grazing", "knife-edge", "large-light", "many-lights",  # noqa: E501
    "penumbra", "sealed-box", "sky", "soft-shadow", "sphere-light", "touching-light", "veach-mis",
]  # fmt: skip
ONE_LIGHT = [
    "disk-light",
    "grazing",
    "knife-edge",
    "large-light",
    "penumbra",
    "soft-shadow",
    "sphere-light",
    "touching-light",
]


def light_of(scene: SceneDescription) -> ShapeDescription:
    (light,) = [shape for shape in scene.shapes if shape.emission is not None]
    return light


def rectangle_of(scene: SceneDescription) -> BilinearMesh:
    geometry = light_of(scene).geometry
    assert isinstance(geometry, BilinearMesh)
    return geometry


def on_film(scene: SceneDescription, points: np.ndarray) -> np.ndarray:
    """Where points of the world fall, (m, 2), x to the right and y up; the shorter side of the film is [-1,
    1].
    """
    to_camera = np.linalg.inv(scene.camera.camera_to_world)
    x, y, z = (points @ to_camera[:3, :3].T + to_camera[:3, 3]).T
    assert z.min() > 0
    return np.stack([x, y], axis=1) / z[:, None] / np.tan(np.radians(scene.camera.fov) / 2)


def floor_points_in_view(scene: SceneDescription, extent: np.ndarray, pixels: int = 25) -> np.ndarray:
    """Points of the floor (y = 0, within extent [[x0, x1], [z0, z1]]) on camera rays through a grid of the
    whole film.
    """
    aspect = scene.film.width / scene.film.height
    x, y = np.meshgrid(np.linspace(-aspect, aspect, pixels), np.linspace(-1, 1, pixels))
    half = np.tan(np.radians(scene.camera.fov) / 2)
    directions = np.stack([x.ravel() * half, y.ravel() * half, np.ones(x.size)], axis=1)
    directions = directions @ scene.camera.camera_to_world[:3, :3].T
    eye = scene.camera.camera_to_world[:3, 3]
    down = directions[:, 1] < -1e-9
    points = eye - directions[down] * (eye[1] / directions[down, 1])[:, None]
    inside = np.all((points[:, [0, 2]] >= extent[:, 0]) & (points[:, [0, 2]] <= extent[:, 1]), axis=1)
    return points[inside]


def test_the_library_is_what_it_should_be() -> None:
    assert [scene.name for scene in scenes.library()] == NAMES


@pytest.mark.parametrize("entry", scenes.library(), ids=NAMES)
def test_every_scene_tells_what_it_shows_and_what_can_be_set(entry: scenes.catalog.LibraryScene) -> None:
    assert len(entry.title) > 20
    assert entry.doc.startswith(entry.title)
    assert entry.doc.count("\n") >= 3
    parameters = {parameter.name: parameter for parameter in entry.parameters}
    square = entry.name == "cornell-direct"
    assert (parameters["xresolution"].default, parameters["yresolution"].default) == (
        240 if square else 320,
        240,
    )
    for parameter in entry.parameters:
        assert parameter.meaning.startswith(("scene units: ", "pixels: ", "degrees: ", "factor")), (
            parameter.meaning
        )
        assert parameter.interval != ANY
    scene = scenes.load(entry.name, {"xresolution": 64.0, "yresolution": 48.0})
    assert (scene.name, scene.film.width, scene.film.height) == (entry.name, 64, 48)


@pytest.mark.parametrize("name", ONE_LIGHT)
def test_every_scene_is_gray_but_for_its_one_light(name: str) -> None:
    scene = scenes.load(name)
    light = light_of(scene)
    assert light.emission is not None
    assert not light.emission.two_sided
    assert light.material.reflectance.tolist() == [0, 0, 0]
    for shape in scene.shapes:
        assert np.ptp(shape.material.reflectance) == 0


@pytest.mark.parametrize("name", NAMES)
def test_no_picture_is_mirrored(name: str) -> None:
    to_world = scenes.load(name).camera.camera_to_world
    assert to_world[0, 0] > 0.8  # +x lies to the right,
    assert to_world[1, 1] > 0.7  # +y up,
    assert to_world[2, 2] > 0.7  # and the view goes along +z


def test_a_scene_is_found_by_path_too(tmp_path: Path) -> None:
    copy = tmp_path / "mine.pbrt"
    copy.write_text(HEAD)
    assert scenes.load(str(copy)).name == "mine"
    library = scenes.load(str(LIBRARY / "touching-light.pbrt"), {"gap": 0.5})
    assert library.content_hash() == scenes.load("touching-light", {"gap": 0.5}).content_hash()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        (
            "soft-shadows",
            "unknown scene 'soft-shadows'; there are: cornell-direct, disk-light, environment-map, forest",
        ),
        ("gone.pbrt", "there is no scene file 'gone.pbrt'"),
        ("some/where", "there is no scene file"),
        (str(LIBRARY), "is no file"),
        ("", "is no file"),
        ("nul\0", "unknown scene"),
        ("x" * 5000, "unknown scene"),
    ],
)
def test_what_is_no_scene_is_refused(name: str, words: str) -> None:
    with pytest.raises(PenumbraError, match=words):
        find(name)


def test_parameters_of_another_scene_are_refused() -> None:
    with pytest.raises(PenumbraError, match=r"no parameter 'gap'; it has: size, height, radiance"):
        scenes.load("soft-shadow", {"gap": 0.1})
    with pytest.raises(PenumbraError, match="finite"):
        scenes.load("touching-light", {"gap": float("nan")})
    with pytest.raises(SceneError, match=r"touching-light.pbrt:.*\$xresolution = 1.5 is not a whole number"):
        scenes.load("touching-light", {"xresolution": 1.5})


@pytest.mark.parametrize("size", [0.35, 0.01, 1.1])
def test_disk_and_sphere_have_the_same_power_and_else_the_same_scene(size: float) -> None:
    disk, sphere = (scenes.load(name, {"size": size}) for name in ("disk-light", "sphere-light"))
    flat, round_ = light_of(disk), light_of(sphere)
    assert isinstance(flat.geometry, Disk)
    assert isinstance(round_.geometry, Sphere)
    assert flat.emission is not None
    assert round_.emission is not None
    power = np.pi * flat.emission.radiance * np.pi * flat.geometry.radius**2
    np.testing.assert_allclose(
        power, np.pi * round_.emission.radiance * 4 * np.pi * round_.geometry.radius**2, rtol=1e-14
    )
    np.testing.assert_array_equal(flat.geometry.center, round_.geometry.center)
    assert flat.geometry.normal.tolist() == [0, -1, 0]
    assert not round_.geometry.reverse
    rest = [SceneDescription("rest", s.camera, s.film, s.shapes[:-1]).content_hash() for s in (disk, sphere)]
    assert rest[0] == rest[1]


@pytest.mark.parametrize("gap", [1.0, 0.1, 0.01, 1e-3, 1e-5, 1e-9, 0.0])
def test_touching_light_stands_exactly_its_gap_above_the_floor(gap: float) -> None:
    scene = scenes.load("touching-light", {"gap": gap})
    light = rectangle_of(scene)
    assert len(scene.shapes) == 2
    assert sorted(set(light.vertices[:, 1].tolist())) == [gap, gap + 0.8]
    assert np.ptp(light.vertices[:, 0]) == 2
    assert np.all(light.vertices[:, 2] == 0)
    assert face_normals(light.vertices, light.faces, light.reverse).tolist() == [[0, 0, -1]]
    floor = scene.shapes[0].geometry
    assert isinstance(floor, TriangleMesh)
    assert np.all(floor.vertices[:, 1] == 0)
    assert np.ptp(floor.vertices, axis=0).tolist() == [4, 0, pytest.approx(3.2)]


def test_touching_light_and_its_foot_are_in_the_picture() -> None:
    scene = scenes.load("touching-light")
    where = on_film(
        scene, np.concatenate([rectangle_of(scene).vertices, [[-1, 0, 0], [1, 0, 0], [0, 0, -1.5]]])
    )
    assert np.abs(where[:, 0]).max() < 4 / 3
    assert np.abs(where[:, 1]).max() < 1


def knife(parameters: dict[str, float]) -> tuple[SceneDescription, np.ndarray, np.ndarray, np.ndarray]:
    """The scene, its light's corners, and the bounds of occluder and floor."""
    scene = scenes.load("knife-edge", parameters)
    floor, occluder = (shape.geometry for shape in scene.shapes[:2])
    assert isinstance(floor, TriangleMesh)
    assert isinstance(occluder, TriangleMesh)
    bounds = [np.stack([g.vertices.min(axis=0), g.vertices.max(axis=0)]) for g in (occluder, floor)]
    return scene, rectangle_of(scene).vertices, bounds[0], bounds[1]


@pytest.mark.parametrize(
    "parameters",
    [{}, {"height": 0.05}, {"height": 2.9}, {"size": 0.001}, {"size": 8.0}, {"lamp": 20.0, "size": 18.0}],
)
def test_only_the_knife_s_edge_can_stand_before_the_light(parameters: dict[str, float]) -> None:
    """Every line from a floor point in view to the light crosses the occluder's plane inside all its other
    edges.
    """
    scene, light, occluder, floor = knife(parameters)
    points = floor_points_in_view(scene, floor[:, [0, 2]].T)
    assert len(points) > 200
    s = np.linspace(0, 1, 5)
    u, v = (grid.ravel()[:, None] for grid in np.meshgrid(s, s))
    on_light = light[0] + u * (light[1] - light[0]) + v * (light[2] - light[0])
    t = occluder[0, 1] / light[0, 1]  # where the line is as high as the occluder
    crossing = points[:, None] * (1 - t) + on_light[None] * t
    margin = 1.0
    assert np.abs(crossing[..., 0]).max() < occluder[1, 0] - margin
    assert crossing[..., 2].max() < occluder[1, 2] - margin
    # and so, by convexity, for each point of the whole floor and of the light, seen or not
    for axis in (0, 2):
        assert max(floor[1, axis], light[:, axis].max()) < occluder[1, axis] - margin
    assert min(floor[0, 0], light[:, 0].min()) > occluder[0, 0] + margin
    assert occluder[0, 2] == 0  # the edge itself


def test_the_knife_s_penumbra_is_in_the_picture() -> None:
    scene, light, occluder, _ = knife({})
    height, lamp, depth = occluder[0, 1], light[0, 1], np.ptp(light[:, 2])
    half = depth / 2 * height / (lamp - height)  # similar triangles through the edge
    penumbra = np.array([[x, 0, z] for x in (-0.8, 0.8) for z in (-half, half)])
    where = on_film(scene, penumbra)
    assert np.abs(where[:, 0]).max() < 4 / 3
    assert np.abs(where[:, 1]).max() < 1
    edge = on_film(scene, np.array([[x, height, 0] for x in (-0.8, 0.8)]))
    assert where[:, 1].max() < edge[:, 1].min()  # the occluder does not hide it
    assert np.ptp(where[:, 1]) > 0.3  # at least 15 % of the picture's height


def test_soft_shadow_shows_all_its_objects_and_not_its_light() -> None:
    scene = scenes.load("soft-shadow")
    light, _, _, knot, ball, box = scene.shapes
    assert isinstance(knot.geometry, TriangleMesh)
    assert isinstance(ball.geometry, Sphere)
    assert isinstance(box.geometry, TriangleMesh)
    around = ball.geometry.center + ball.geometry.radius * np.concatenate([np.eye(3), -np.eye(3)])
    for points in (knot.geometry.vertices, box.geometry.vertices, around):
        where = on_film(scene, points)
        assert np.abs(where[:, 0]).max() < 1.25
        assert np.abs(where[:, 1]).max() < 0.95
        assert points[:, 1].min() == pytest.approx(0, abs=1e-12)  # standing on the floor
    assert isinstance(light.geometry, BilinearMesh)
    assert on_film(scene, light.geometry.vertices)[:, 1].min() > 1


def test_the_boxes_point_outwards() -> None:
    for name in ("soft-shadow", "disk-light"):
        boxes = [s.geometry for s in scenes.load(name).shapes if isinstance(s.geometry, TriangleMesh)]
        (box,) = [g for g in boxes if len(g.faces) == 12]
        solid = trimesh.Trimesh(box.vertices, box.faces, process=False)
        assert solid.is_watertight
        assert solid.volume > 0
        assert not box.reverse


def maker() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_knot", LIBRARY / "meshes" / "make.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_knot_is_a_sound_mesh() -> None:
    mesh = read_ply(LIBRARY / "meshes" / "knot.ply")
    assert len(mesh.triangles) >= 5000
    assert len(mesh.quads) == 0
    knot = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    assert knot.is_watertight
    assert knot.is_winding_consistent
    assert knot.volume > 0
    assert knot.euler_number == 0  # a torus
    assert knot.area_faces.min() > 1e-5
    assert mesh.vertices[:, 1].min() == 0
    assert mesh.vertices[:, 1].max() == 1.5


def test_the_knot_that_is_checked_in_is_the_one_that_the_script_makes() -> None:
    make, mesh = maker(), read_ply(LIBRARY / "meshes" / "knot.ply")
    np.testing.assert_array_equal(mesh.vertices, make.placed(make.vertices()))
    np.testing.assert_array_equal(mesh.triangles, make.faces())


def test_the_knot_s_tube_does_not_cut_itself() -> None:
    make = maker()
    t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    p, _, _ = make.axis(t)
    distance = np.linalg.norm(p[:, None] - p[None], axis=2)
    apart = np.abs((t[:, None] - t[None] + np.pi) % (2 * np.pi) - np.pi) > 0.5
    assert distance[apart].min() > 2 * make.TUBE
