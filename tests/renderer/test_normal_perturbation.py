"""Normal maps and bumps: shading normals against those of the surfaces that they stand for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.references.protocol import BACKENDS
from renderer import build, render
from renderer.plan.plan import make_plan
from scenes.description.normal_perturbation import BumpMap
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Disk, ShapeDescription, Sphere
from scenes.description.textures import Bilerp
from scenes.errors import SceneError
from scenes.hashing import hash_values
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse, parse_file
from tests.kit.exported import written
from tests.kit.scenes import GRAY
from tests.kit.scenes import scene as made

Array = NDArray[np.float64]

HEAD = """\
LookAt 0 0 6  0 0 0  0 1 0
Camera "perspective" "float fov" [ 20 ]
Film "rgb" "integer xresolution" [ 24 ] "integer yresolution" [ 24 ]
PixelFilter "box"
Integrator "path" "integer maxdepth" [ 1 ]
WorldBegin
"""
TO_LIGHT = np.array([0.36, 0.48, 0.8])
SUN = 'LightSource "distant" "point3 from" [ .36 .48 .8 ] "point3 to" [ 0 0 0 ] "rgb L" [ 2 2 2 ]\n'
UV = '"point2 uv" [ 0 0  1 0  1 1  0 1 ]'
CORNERS = "-2 -2 0  2 -2 0  2 2 0  -2 2 0"
PLANE = f'Shape "trianglemesh" "point3 P" [ {CORNERS} ] {UV} "integer indices" [ 0 1 2 0 2 3 ]\n'


def shaded(scene: SceneDescription) -> Array:
    """(h, w) cosines with the sun: 0.5 / pi times 2 times the cosine is seen."""
    return render(scene, estimator="mis", spp=1).image[..., 0] * np.pi


def folder_with(tmp_path: Path, normal: Array) -> Path:
    """A folder with a normal map of one normal, and the path of a scene to be written into it."""
    image = np.broadcast_to((normal / np.linalg.norm(normal) + 1) / 2, (2, 2, 3))
    write_exr(tmp_path / "n.exr", {c: np.ascontiguousarray(image[..., i]) for i, c in enumerate("RGB")})
    return tmp_path / "scene.pbrt"


def mapped(path: Path, body: str) -> SceneDescription:
    path.write_text(HEAD + SUN + 'Material "diffuse" "string normalmap" "n.exr"\n' + body)
    return parse_file(path)


@pytest.mark.parametrize(
    ("place", "u"),
    [
        ("", (1, 0, 0)),
        ("Rotate 90 0 0 1", (0, 1, 0)),
        ("Scale -1 1 1", (-1, 0, 0)),  # the normal stays, as in pbrt: the frame is right-handed about it
        ("ReverseOrientation", (1, 0, 0)),
    ],
)
def test_a_normal_of_the_map_is_about_dp_du_and_the_normal(
    tmp_path: Path, place: str, u: tuple[float, ...]
) -> None:
    """pbrt's frame: x along dp/du, z the normal on the outside, y = z x x."""
    local = np.array([0.3, -0.2, 0.9])
    found = shaded(mapped(folder_with(tmp_path, local), f"{place}\n{PLANE}"))
    z = np.array([0.0, 0.0, -1.0 if "Reverse" in place else 1.0])
    x = np.array(u, dtype=np.float64)
    normal = x * local[0] + np.cross(z, x) * local[1] + z * local[2]
    normal *= np.sign(normal[2]) / np.linalg.norm(normal)  # seen from +z
    assert np.allclose(found, normal @ TO_LIGHT, rtol=1e-6)
    assert not np.allclose(found, TO_LIGHT[2], rtol=1e-2)


def test_a_flat_map_changes_nothing(tmp_path: Path) -> None:
    scene = mapped(folder_with(tmp_path, np.array([0.0, 0.0, 1.0])), PLANE)
    assert np.allclose(shaded(scene), TO_LIGHT[2], rtol=1e-6)


def test_the_first_row_of_a_map_lies_at_v_1(tmp_path: Path) -> None:
    upper, lower = np.array([0.3, -0.2, 0.9]), np.array([-0.4, 0.1, 0.8])
    upper, lower = (n / np.linalg.norm(n) for n in (upper, lower))
    image = np.repeat([upper] * 32 + [lower] * 32, 64, axis=0).reshape(64, 64, 3) / 2 + 0.5
    write_exr(tmp_path / "n.exr", {c: np.ascontiguousarray(image[..., i]) for i, c in enumerate("RGB")})
    found = shaded(mapped(tmp_path / "scene.pbrt", PLANE))
    assert np.allclose(found[0], upper @ TO_LIGHT, rtol=1e-5)
    assert np.allclose(found[-1], lower @ TO_LIGHT, rtol=1e-5)


RAMP = """\
Texture "ramp" "float" "imagemap" "string filename" "ramp.exr" "string wrap" "clamp"
Material "diffuse" "texture displacement" "ramp"
"""


@pytest.fixture
def ramps(tmp_path: Path) -> Path:
    """An image that rises by 0.25 along u, read between the centres of its texels."""
    steps = np.broadcast_to(np.arange(64) / 64 * 0.25, (64, 64)).copy()
    write_exr(tmp_path / "ramp.exr", dict.fromkeys("RGB", steps))
    return tmp_path


def bumped(folder: Path, body: str) -> SceneDescription:
    (folder / "scene.pbrt").write_text(HEAD + SUN + RAMP + body)
    return parse_file(folder / "scene.pbrt")


def test_a_bump_that_rises_shades_as_the_plane_that_rises(ramps: Path) -> None:
    """0.25 over 4 units along x: the normal leans by a slope of 1/16."""
    found = shaded(bumped(ramps, PLANE))[:, 2:-2]
    normal = np.array([-1 / 16, 0.0, 1.0]) / np.hypot(1, 1 / 16)
    assert np.allclose(found, normal @ TO_LIGHT, rtol=1e-5)


def test_a_bump_by_points_rises_where_they_are(ramps: Path) -> None:
    """s = x / 4 + 1/2 is u: the point moves with its step as u does."""
    planar = '"string mapping" "planar" "vector3 v1" [ 0.25 0 0 ] "vector3 v2" [ 0 0.25 0 ]'
    planar += ' "float udelta" 0.5 "float vdelta" 0.5'
    (ramps / "scene.pbrt").write_text(HEAD + SUN + RAMP.replace('"clamp"', '"clamp" ' + planar) + PLANE)
    found = shaded(parse_file(ramps / "scene.pbrt"))[:, 2:-2]
    normal = np.array([-1 / 16, 0.0, 1.0]) / np.hypot(1, 1 / 16)
    assert np.allclose(found, normal @ TO_LIGHT, rtol=1e-5)


def test_a_bump_by_directions_sees_the_geometric_normal(ramps: Path) -> None:
    """As pbrt's texture context has it: on a flat face a mix by the normal is constant, whatever N."""
    mix = 'Texture "d" "float" "directionmix" "vector3 dir" [ 1 0 0 ] "float tex1" 9 "float tex2" 0\n'
    material = 'Material "diffuse" "texture displacement" "d"\n'
    normals = '"normal N" [ -1 0 1 1 0 1 1 0 1 -1 0 1 ]'
    smooth = PLANE.replace('"integer', normals + ' "integer')
    (ramps / "scene.pbrt").write_text(HEAD + SUN + mix + material + smooth)
    bumped_, plain = parse_file(ramps / "scene.pbrt"), parse(HEAD + SUN + smooth)
    np.testing.assert_allclose(shaded(bumped_), shaded(plain), rtol=1e-9)


def test_vertex_normals_take_pbrts_frame(ramps: Path) -> None:
    """pbrt's dp/dv of a smoothly shaded face is s x dp/du, so that the slope along u is that of dp/du."""
    normals = '"normal N" [ 0 0 1 0 0 1 0 0 1 0 0 1 ]'
    smooth = shaded(bumped(ramps, PLANE.replace('"integer', normals + ' "integer')))[:, 2:-2]
    normal = np.array([-1 / 16, 0.0, 1.0]) / np.hypot(1, 1 / 16)
    assert np.allclose(smooth, normal @ TO_LIGHT, rtol=1e-5)


def test_a_sphere_bumps_about_its_axis(ramps: Path) -> None:
    """Along u, which is the angle about z: the slope at radius 1 is 0.25 / (2 pi sin theta)."""
    body = 'Rotate -90 1 0 0 Shape "sphere" "float radius" 1\n'
    found = shaded(bumped(ramps, body))
    scene = bumped(ramps, body)
    middle = found[11:13, 11:13].mean()
    flat = shaded(parse(HEAD + SUN + body))[11:13, 11:13].mean()
    # In the middle n = z, sin theta = 1, and u grows to the right: x is (1, 0, 0). There u = 3/4.
    height = 0.25 * 0.75
    slope = 0.25 / (2 * np.pi) / (1 + height)
    normal = np.array([-slope, 0.0, 1.0]) / np.hypot(1, slope)
    assert abs(middle - flat - (normal - [0, 0, 1]) @ TO_LIGHT) < 2e-3
    assert abs(middle - flat) > 1e-2
    assert scene.shapes[0].perturbation is not None


def test_the_plan_tells_and_a_scene_without_maps_does_nothing(ramps: Path) -> None:
    scene, plain = bumped(ramps, PLANE), parse(HEAD + SUN + PLANE)
    assert [build(one).perturbations is None for one in (scene, plain)] == [False, True]
    decided = [{d.effect: d.needed for d in make_plan(build(one)).decisions} for one in (scene, plain)]
    assert [one["shading normals"] for one in decided] == [True, False]


@pytest.mark.parametrize("backend", ["closed-form", "mitsuba"])
def test_a_reference_without_bump_maps_refuses_them(ramps: Path, backend: str) -> None:
    assert "normal map" in str(BACKENDS[backend].refuses(bumped(ramps, PLANE)))


def test_maps_are_written_and_read_back(ramps: Path) -> None:
    out = ramps / "out"
    out.mkdir()
    normal = mapped(folder_with(ramps, np.array([0.1, 0.2, 0.9])), PLANE)
    for scene in (bumped(ramps, PLANE), normal):
        again = parse_file(written(scene, out))
        assert [hash_values(s) for s in again.shapes] == [hash_values(s) for s in scene.shapes]


def test_named_materials_carry_their_maps(ramps: Path) -> None:
    named = RAMP.replace('Material "diffuse"', 'MakeNamedMaterial "m" "string type" "diffuse"')
    (ramps / "scene.pbrt").write_text(HEAD + SUN + named + 'NamedMaterial "m"\n' + PLANE)
    assert parse_file(ramps / "scene.pbrt").shapes[0].perturbation is not None


MIXED = """\
Texture "ramp" "float" "imagemap" "string filename" "ramp.exr" "string wrap" "clamp"
MakeNamedMaterial "a" "string type" "diffuse"
MakeNamedMaterial "b" "string type" "diffuse" "string normalmap" "n.exr"
MakeNamedMaterial "c" "string type" "diffuse" "texture displacement" "ramp"
MakeNamedMaterial "bc" "string type" "mix" "string materials" [ "b" "c" ] "float amount" 0.5
MakeNamedMaterial "m" "string type" "mix" "string materials" [ "a" "bc" ] "float amount" 0.5
NamedMaterial "m"
"""


def test_each_point_of_a_mix_has_the_map_of_its_material(ramps: Path) -> None:
    """Of a flat material, one with a normal map and one with a ramp: half, a quarter and a quarter, and
    nothing between them, since the point of a sample is of one material alone.
    """
    local = np.array([0.3, -0.2, 0.9]) / np.linalg.norm([0.3, -0.2, 0.9])
    folder_with(ramps, local).write_text(HEAD + SUN + MIXED + PLANE)
    scene = parse_file(ramps / "scene.pbrt")
    slope = 0.25 * 0.25  # a quarter over the square's side of four
    cosines = np.array(
        [TO_LIGHT[2], local @ TO_LIGHT, np.array([-slope, 0, 1]) @ TO_LIGHT / np.hypot(1, slope)]
    )
    found = shaded(scene)
    apart = np.abs(found[..., None] - cosines)
    assert apart.min(axis=-1).max() < 1e-3
    assert np.diff(np.sort(cosines)).min() > 0.01
    shares = np.bincount(apart.argmin(axis=-1).ravel(), minlength=3) / found.size
    # 576 points: four standard errors of a half are 0.083, of a quarter 0.072.
    assert np.abs(shares - [0.5, 0.25, 0.25]).max() < 0.083, shares
    assert "normal map" in str(BACKENDS["mitsuba"].refuses(scene))
    (ramps / "out").mkdir()
    assert parse_file(written(scene, ramps / "out")).content_hash() == scene.content_hash()


def test_what_is_not_there_is_told(ramps: Path) -> None:
    with pytest.raises(SceneError, match=r"7:20: .*no such image file"):
        parse(HEAD + 'Material "diffuse" "string normalmap" "gone.png"')
    with pytest.raises(SceneError, match=r"no float texture is called 'gone'"):
        parse(HEAD + 'Material "diffuse" "texture displacement" "gone"\n' + PLANE)
    part = 'Shape "sphere" "float phimax" 90\n'
    with pytest.raises(SceneError, match=r"displacement on part of a sphere is not supported"):
        bumped(ramps, part)


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("kind", ["sphere", "disk"])
def test_bumps_are_those_of_the_raised_surface(kind: str, reverse: bool) -> None:
    """P(u, v) = p + h n, differentiated numerically: 2e-6 sees a derivative of the normal that is left out.

    Where the surface is turned, pbrt turns the normal that is raised and not its derivatives.
    """
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    center, radius, side = np.array([0.5, -1.0, 2.0]), 1.5, -1.0 if reverse else 1.0
    slope = BumpMap(Bilerp(*np.repeat([[0.0], [0.3], [0.5], [0.8]], 3, axis=1)))
    ball, plate = Sphere(center, radius, reverse, turn), Disk(center, turn[:, 2] * side, radius, turn)
    built = build(made([ShapeDescription(ball if kind == "sphere" else plate, GRAY, perturbation=slope)]))
    assert built.perturbations is not None
    assert built.coordinates is not None

    def place(u: float, v: float) -> tuple[Array, Array]:
        phi, theta = 2 * np.pi * u, np.pi * (1 - v)
        if kind == "disk":
            on = radius * (1 - v) * np.array([np.cos(phi), np.sin(phi), 0.0])
            return center + turn @ on, turn[:, 2]
        out = turn @ np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
        return center + radius * out, out

    e, face = 1e-6, (np.full(1, -1), np.zeros(1, dtype=np.int64))
    for u, v in np.random.default_rng(2).uniform(0.15, 0.85, (6, 2)):
        p, n = place(u, v)
        ways: list[Array] = []
        for du, dv, rise in ((e, 0.0, 0.5), (0.0, e, 0.3)):
            (ahead, after), (behind, before) = place(u + du, v + dv), place(u - du, v - dv)
            bend = (0.5 * u + 0.3 * v) * (after - before)
            ways.append((ahead - behind + bend) / (2 * e) + rise * side * n)
        want = np.cross(*ways)
        want *= np.sign(want @ n) * side / np.linalg.norm(want)
        at, normal = p[:, None].copy(), (side * n)[:, None]
        uv = built.coordinates.at(at, *face)
        got = built.perturbations.at(at, normal, uv, np.zeros(1, dtype=np.int64), face, normal)
        np.testing.assert_allclose(got[:, 0], want, atol=2e-6)
