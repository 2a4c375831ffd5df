"""Mitsuba's XML as pbrt text: the same image, by closed forms, by the way back, and by Mitsuba itself."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.convert.document import Document, write
from pipeline.convert.mitsuba.scene import convert
from pipeline.convert.mitsuba.shapes import vertex_normals
from pipeline.references.mitsuba.xml import to_xml
from renderer import render
from scenes import catalog
from scenes.description.materials import Coated, Conductor, Dielectric, Diffuse
from scenes.description.scene import SceneDescription
from scenes.description.shapes import TriangleMesh
from scenes.errors import PenumbraError, SceneError
from scenes.images.exr import write_exr
from tests.pipeline.commands.test_commands import Penumbra, penumbra

__all__ = ["penumbra"]

SENSOR = """<sensor type="perspective"><float name="fov" value="90"/>
<transform name="to_world"><lookat origin="0 0 0" target="0 0 1" up="0 1 0"/></transform>
<film type="hdrfilm"><integer name="width" value="9"/><integer name="height" value="3"/>
<rfilter type="box"/></film></sensor>
"""
SPHERE = '<shape type="sphere"><point name="center" z="5"/>{}</shape>'


def converted(
    folder: Path, body: str, sensor: str = SENSOR, **given: str
) -> tuple[SceneDescription, Document]:
    """The scene of a body, read back from its pbrt text."""
    path = folder / "s.xml"
    path.write_text(f'<?xml version="1.0"?>\n<scene version="3.0.0">\n{sensor}{body}</scene>')
    document = convert(path, given, "s")
    return write(document, "s.xml", folder / "s.pbrt"), document


@pytest.mark.parametrize("name", ["soft-shadow", "sphere-light", "cornell-direct", "penumbra"])
def test_our_own_export_comes_back_as_the_same_image(name: str, tmp_path: Path) -> None:
    """Meshes and coordinates went through float32 and the reference's units: 1e-5 of a pixel's value where
    no edge runs through it. Mirroring the camera or turning a light would change most pixels by all of it.
    """
    scene = catalog.load(name)
    scene = replace(scene, film=replace(scene.film, width=24, height=18))
    files = to_xml(scene, "s")
    (tmp_path / "s.xml").write_text(files.text)
    for file, mesh in files.meshes.items():
        (tmp_path / file).write_bytes(mesh)
    document = convert(tmp_path / "s.xml", {}, "s")
    back = write(document, name, tmp_path / "s.pbrt")
    first, second = (render(one, spp=16, seed=1, sampler="sobol").image for one in (scene, back))
    close = np.abs(first - second) <= 1e-5 * first.max()
    assert close.mean() > 0.97
    assert document.losses.lines() == ()
    assert back.lights == () or len(back.lights) == len(scene.lights)


def test_the_camera_looks_along_z_with_x_to_the_left(tmp_path: Path) -> None:
    """Squares of 2 at distance 3 fill the three thirds of a film that reaches 3 to each side: the one at
    x = +2 is on the left, and the one turned away is black.
    """
    square = (
        '<shape type="rectangle"><transform name="to_world">{}<translate x="{}" z="3"/></transform>'
        '<emitter type="area"><rgb name="radiance" value="{}"/></emitter></shape>'
    )
    turned = '<rotate y="1" angle="180"/>'
    body = (
        square.format(turned, 2, "1 2 3") + square.format(turned, 0, "4 5 6") + square.format("", -2, "7 8 9")
    )
    scene, document = converted(tmp_path, body)
    image = render(scene, spp=4).image
    assert document.losses.lines() == ()
    np.testing.assert_allclose(image[:, :3], np.broadcast_to([1.0, 2, 3], (3, 3, 3)), rtol=1e-12)
    np.testing.assert_allclose(image[:, 3:6], np.broadcast_to([4.0, 5, 6], (3, 3, 3)), rtol=1e-12)
    assert not image[:, 6:].any()


@pytest.mark.parametrize(
    ("axis", "width", "height", "half"),
    [("x", 9, 3, 1 / 3), ("y", 9, 3, 1.0), ("x", 3, 9, 1.0), ("y", 3, 9, 1 / 3), ("smaller", 3, 9, 1.0),
     ("larger", 9, 3, 1 / 3), ("diagonal", 9, 3, 1 / np.sqrt(10))],
)  # fmt: skip
def test_the_angle_is_over_the_side_that_is_named(
    axis: str, width: int, height: int, half: float, tmp_path: Path
) -> None:
    """half: the tangent of half the angle over the shorter side, where 90 degrees are over the named one."""
    sensor = SENSOR.replace('"90"/>', f'"90"/><string name="fov_axis" value="{axis}"/>')
    sensor = sensor.replace('value="9"', f'value="{width}"').replace('value="3"/>\n', f'value="{height}"/>\n')
    scene, _ = converted(tmp_path, SPHERE.format(""), sensor)
    left, top, _, _ = scene.camera.film_plane(scene.film)
    assert min(-left, top) == pytest.approx(half, rel=1e-12)


def test_an_orthographic_film_reaches_one_to_each_side(tmp_path: Path) -> None:
    sensor = SENSOR.replace('"perspective"', '"orthographic"').replace(
        '<transform name="to_world">', '<transform name="to_world"><scale x="2" y="2"/>'
    )
    scene, _ = converted(tmp_path, SPHERE.format('<emitter type="area"/>'), sensor)
    image = render(scene, spp=64).image  # 4 wide, a pixel 4/9: the sphere of radius 1 covers 4.5 of them
    assert (image[1, :, 0] > 0).tolist() == [False] * 2 + [True] * 5 + [False] * 2
    assert 4.3 < image[1, :, 0].sum() < 4.6


LIGHTS = [
    ('<emitter type="point"><point name="position" y="2"/><rgb name="intensity" value="4 8 12"/></emitter>',
     1.0),
    ('<emitter type="point"><transform name="to_world"><translate y="2"/></transform>'
     '<rgb name="intensity" value="4 8 12"/></emitter>', 1.0),
    ('<emitter type="directional"><vector name="direction" y="-1"/><rgb name="irradiance" value="1 2 3"/>'
     "</emitter>", 1.0),
    ('<emitter type="spot"><transform name="to_world"><lookat origin="0 2 0" target="0 0 0" up="0 0 1"/>'
     '</transform><rgb name="intensity" value="4 8 12"/></emitter>', 1.0),
    ('<emitter type="constant"><rgb name="radiance" value="1 2 3"/></emitter>', np.pi),
]  # fmt: skip


@pytest.mark.parametrize(("light", "irradiance"), LIGHTS)
def test_lights_give_their_irradiance(light: str, irradiance: float, tmp_path: Path) -> None:
    """A pixel that looks down at the origin of a floor of reflectance 0.5 sees 0.5 / pi of it."""
    sensor = """<sensor type="perspective"><float name="fov" value="0.01"/><transform name="to_world">
    <lookat origin="0 1 -1" target="0 0 0" up="0 1 0"/></transform><film type="hdrfilm">
    <integer name="width" value="1"/><integer name="height" value="1"/><rfilter type="box"/></film>
    </sensor>"""
    floor = (
        '<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/></transform>'
        '<bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>'
    )
    scene, _ = converted(tmp_path, floor + light, sensor)
    image = render(scene, estimator="cosine", spp=16).image
    np.testing.assert_allclose(image[0, 0], 0.5 / np.pi * irradiance * np.array([1.0, 2, 3]), rtol=1e-4)


def material(folder: Path, bsdf: str) -> object:
    return converted(folder, SPHERE.format(bsdf))[0].shapes[0].material


def test_bsdfs_become_materials(tmp_path: Path) -> None:
    made = material(
        tmp_path,
        '<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="#ff0000"/></bsdf></bsdf>',
    )
    assert isinstance(made, Diffuse)
    assert np.asarray(made.reflectance).tolist() == [1, 0, 0]
    made = material(tmp_path, '<bsdf type="roughconductor"><rgb name="eta" value="1 2 3"/>'
                    '<rgb name="k" value="3 2 1"/><float name="alpha" value="0.3"/></bsdf>')  # fmt: skip
    assert isinstance(made, Conductor)
    assert (made.eta.tolist(), made.k.tolist(), made.alpha) == ([1, 2, 3], [3, 2, 1], 0.3)
    made = material(tmp_path, '<bsdf type="conductor"/>')
    assert isinstance(made, Conductor)
    np.testing.assert_allclose(
        made.normal_reflectance, 1.0, atol=2e-4
    )  # Mitsuba's "none" is a perfect mirror
    made = material(tmp_path, '<bsdf type="dielectric"><string name="int_ior" value="water"/></bsdf>')
    assert isinstance(made, Dielectric)
    assert made.eta == pytest.approx(1.333 / 1.000277)
    made = material(tmp_path, '<bsdf type="thindielectric"><float name="int_ior" value="1.5"/>'
                    '<float name="ext_ior" value="1"/></bsdf>')  # fmt: skip
    assert isinstance(made, Dielectric)
    assert (made.thin, made.eta) == (True, 1.5)
    made = material(
        tmp_path, '<bsdf type="roughplastic"><rgb name="diffuse_reflectance" value="0.2"/></bsdf>'
    )
    assert isinstance(made, Coated)
    assert made.coat.alpha == 0.1
    assert isinstance(made.base, Diffuse)
    assert material(tmp_path, '<bsdf type="hair"/>').__class__ is Diffuse


def test_a_light_without_a_bsdf_is_black_and_another_shape_gray(tmp_path: Path) -> None:
    for part, value in (('<emitter type="area"/>', 0.0), ("", 0.5)):
        made = material(tmp_path, part)
        assert isinstance(made, Diffuse)
        assert np.asarray(made.reflectance).tolist() == [value] * 3


def test_references_defaults_and_includes(tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text(
        '<scene version="3.0.0"><bsdf type="twosided" id="m"><bsdf type="diffuse">'
        '<rgb name="reflectance" value="$gray"/></bsdf></bsdf></scene>'
    )
    body = '<default name="gray" value="0.25"/><include filename="part.xml"/>' + SPHERE.format(
        '<ref id="m"/>'
    )
    for given, value in (({}, 0.25), ({"gray": "0.75"}, 0.75)):
        made = converted(tmp_path, body, **given)[0].shapes[0].material
        assert isinstance(made, Diffuse)
        assert np.asarray(made.reflectance).tolist() == [value] * 3


def test_instances_stand_for_the_shapes_of_their_group(tmp_path: Path) -> None:
    group = f'<shape type="shapegroup" id="g">{SPHERE.format("")}</shape>'
    placed = '<ref id="g"/><transform name="to_world"><translate x="{}"/></transform>'
    instance = f'<shape type="instance">{placed}</shape>'
    scene, _ = converted(tmp_path, group + instance.format(1) + instance.format(-2))
    low = [shape.geometry.bounds().extent(np.eye(3))[0][0] for shape in scene.shapes]
    assert low == [0, -3]


BAD = [
    ('<shape type="sphere"><float name="radius" value="x"/></shape>', 7, 22, "no list of numbers"),
    ('<shape type="sphere"><ref id="none"/></shape>', 7, 22, "no plug-in has the id"),
    ('<shape type="sphere"><float value="1"/></shape>', 7, 22, "needs the attribute 'name'"),
    ('<shape type="sphere"><float name="radius" value="$r"/></shape>', 7, 22, "nothing is given for \\$r"),
    ('<bsdf type="twosided" id="a"><ref id="a"/></bsdf>', 7, 1, "refers to itself"),
    ('<include filename="s.xml"/>', 7, 1, "includes itself"),
    ('<include filename="../s.xml"/>', 7, 1, "outside the folder"),
    ('<shape type="ply"><string name="filename" value="no.ply"/></shape>', 7, 1, "no.ply"),
    ("<shape>", 7, 1, "needs the attribute 'type'"),
]


@pytest.mark.parametrize(("body", "line", "column", "message"), BAD)
def test_mistakes_are_told_at_their_place(
    body: str, line: int, column: int, message: str, tmp_path: Path
) -> None:
    with pytest.raises(SceneError, match=message) as caught:
        converted(tmp_path, body if "</" in body or "/>" in body else f"{body}</shape>")
    where = caught.value.location
    assert where is not None
    assert (where.line, where.column) == (line, column)
    assert not (tmp_path / "s.pbrt").exists()


def test_malformed_xml_and_document_types_are_refused_at_once(tmp_path: Path) -> None:
    """A billion laughs would take gigabytes: three lines of it are refused before an entity is read."""
    path = tmp_path / "s.xml"
    path.write_text('<scene version="3.0.0">\n  <shape type="sphere">\n</scene>')
    with pytest.raises(SceneError, match=r"s.xml:3:\d+: no XML that can be read: mismatched tag"):
        convert(path, {}, "s")
    entities = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 30))
    path.write_text(f'<?xml version="1.0"?>\n<!DOCTYPE s [<!ENTITY l0 "ha">{entities}]><scene>&l29;</scene>')
    with pytest.raises(SceneError, match=r"s.xml:2:\d+: a document type declaration is not read"):
        convert(path, {}, "s")
    path.write_text('<!DOCTYPE s SYSTEM "http://localhost/x.dtd"><scene version="3.0.0"/>')
    with pytest.raises(SceneError, match="document type"):
        convert(path, {}, "s")


def test_what_is_lost_is_listed_by_kind(tmp_path: Path) -> None:
    body = '<integrator type="path"/>' + 2 * SPHERE.format('<bsdf type="mask"><bsdf type="diffuse"/></bsdf>')
    lost = converted(tmp_path, f'{body}<shape type="heightfield"/>')[1].losses.lines()
    assert [line.split(" (")[0] for line in lost] == [
        "of integrator 'path' the direct light is kept",
        "BSDF 'mask' is left out, and what it wraps is kept",
        "a diffuse that is not twosided is black from behind in Mitsuba alone",
        "shape 'heightfield' is left out",
    ]
    assert "and 1 more" in lost[1]


def test_vertex_normals_are_weighted_by_angles() -> None:
    """At the corner of a cube three faces of right angles meet, one of them in two triangles."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]])
    faces = np.array([[0, 1, 4], [0, 4, 2], [0, 2, 3], [0, 3, 1]])
    np.testing.assert_allclose(vertex_normals(vertices, faces)[0], np.full(3, np.sqrt(1 / 3)))


def test_flags_and_counts_are_checked(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="true or false"):
        converted(tmp_path, '<shape type="sphere"><boolean name="flip_normals" value="1"/></shape>')
    with pytest.raises(SceneError, match="whole number"):
        converted(tmp_path, "", SENSOR.replace('"9"', '"0"'))


def test_the_command_writes_all_or_nothing(penumbra: Penumbra, tmp_path: Path) -> None:
    path, out = tmp_path / "s.xml", tmp_path / "out.pbrt"
    path.write_text(f'<scene version="3.0.0">{SENSOR}<integrator type="path"/>{SPHERE.format("")}</scene>')
    code, stdout, stderr = penumbra("convert", path, "-o", out, "--json")
    assert code == 0
    answer = json.loads(stdout)
    assert (answer["shapes"], answer["lights"], answer["output"]) == (1, 0, str(out))
    assert "lost: of integrator 'path'" in stderr
    assert sorted(one.name for one in tmp_path.iterdir()) == ["out.pbrt", "s.xml"]
    before = out.read_bytes()
    for text, target in (("<scene", out), (path.read_text(), tmp_path / "none" / "a.pbrt")):
        path.write_text(text)
        assert penumbra("convert", path, "-o", target, "--quiet")[0] == 2
    assert out.read_bytes() == before
    assert sorted(one.name for one in tmp_path.iterdir()) == ["out.pbrt", "s.xml"]


MANY = Path(__file__).with_name("many.xml")
RENDERED = """
import sys, numpy as np, mitsuba as mi
mi.set_variant("scalar_rgb")
np.save(sys.argv[2], np.array(mi.render(mi.load_file(sys.argv[1]), spp=600)))
"""


def test_mitsuba_renders_the_same_scene(mitsuba: None, tmp_path: Path) -> None:
    """Shapes, lights, textures and an envmap under an asymmetric camera, as blocks of 4 x 4 pixels. Of 24
    blocks and 3 channels all but few agree within 8 %, ten times what noise is; whatever is mirrored, turned
    or twice as bright changes whole blocks by more.
    """
    (tmp_path / "a.xml").write_bytes(MANY.read_bytes())
    (tmp_path / "o.obj").write_text(
        "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0.2\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "f 1/1 3/3 2/2\nf 1/1 4/4 3/3\n"
    )
    colors = np.array(
        [[[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]], [[1, 1, 1], [0, 0, 0], [0, 1, 1], [1, 0, 1]]]
    )
    sky = np.full((16, 32, 3), 0.3)
    sky[4:7, 5:9], sky[3:5, 20:22] = (6, 1, 1), (1, 1, 9)
    for name, image in (("t.exr", colors * 0.8), ("e.exr", sky)):
        write_exr(tmp_path / name, {c: image[..., i] for i, c in enumerate("RGB")})
    scene = write(convert(tmp_path / "a.xml", {}, "a"), "a.xml", tmp_path / "a.pbrt")
    ours = render(scene, spp=600, seed=2).image
    arguments = [sys.executable, "-c", RENDERED, str(tmp_path / "a.xml"), str(tmp_path / "a.npy")]
    subprocess.run(arguments, check=True, capture_output=True)
    first, second = (
        image.reshape(6, 4, 4, 4, 3).mean(axis=(1, 3)) for image in (ours, np.load(tmp_path / "a.npy"))
    )
    off = np.abs(first / second - 1)
    assert np.quantile(off, 0.95) < 0.08
    np.testing.assert_allclose(first.mean(axis=(0, 1)), second.mean(axis=(0, 1)), rtol=0.03)
    assert any(isinstance(shape.geometry, TriangleMesh) for shape in scene.shapes)


def test_a_name_that_nothing_stands_for_is_refused(tmp_path: Path) -> None:
    with pytest.raises(PenumbraError, match="nothing stands for \\$spp"):
        converted(tmp_path, SPHERE.format(""), spp="4")
