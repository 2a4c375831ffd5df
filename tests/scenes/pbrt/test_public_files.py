"""What public scene files hold and pbrt-v4 renders: read as pbrt reads it, or refused with the reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.description.lights import Environment
from scenes.description.materials import Conductor, Dielectric, Diffuse
from scenes.description.scene import SceneDescription
from scenes.description.shapes import TriangleMesh
from scenes.errors import PenumbraError, SceneError
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse, parse_file
from scenes.ply.mesh import read_ply
from tests.kit.scene_texts import HEAD, TRIANGLE, world, world_fails

BALL = 'Shape "sphere"\n'
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
GLOW = 'AreaLightSource "diffuse" "rgb L" [ 1 1 1 ]\n'


def strict(body: str) -> SceneDescription:
    """A scene of which pbrt makes the same image: --strict takes it."""
    return parse(HEAD + body, strict=True)


def reflectance(body: str) -> np.ndarray:
    material = world(body + BALL).shapes[0].material
    assert isinstance(material, Diffuse)
    assert isinstance(material.reflectance, np.ndarray)
    return material.reflectance


def sky(scene: SceneDescription) -> Environment:
    (light,) = scene.lights
    assert isinstance(light, Environment)
    return light


@pytest.mark.parametrize("body", ['ObjectBegin "o" {glow}', '{glow}ObjectBegin "o" '])
def test_a_shape_in_an_object_loses_its_light_as_in_pbrt(body: str) -> None:
    scene = strict(body.format(glow=GLOW) + f'{BALL}ObjectEnd ObjectInstance "o" Translate 3 0 0 {BALL}')
    assert [shape.emission is None for shape in scene.shapes] in ([True, True], [False, True])
    assert ["is left out, as in pbrt" in note for note in scene.notes] == [True]


def test_blocks_nest_deeper_than_any_file_does() -> None:
    depth = 300
    scene = world("AttributeBegin Translate 1 0 0\n" * depth + BALL + "AttributeEnd\n" * depth + TRIANGLE)
    assert scene.shapes[0].geometry.corners.max(axis=0)[0] == depth + 1
    assert isinstance(scene.shapes[1].geometry, TriangleMesh)
    assert scene.shapes[1].geometry.vertices.max() == 1


def test_more_than_a_thousand_includes(tmp_path: Path) -> None:
    (tmp_path / "part.pbrt").write_text(BALL)
    (tmp_path / "main.pbrt").write_text(HEAD + 'Include "part.pbrt"\n' * 1200)
    assert len(parse_file(tmp_path / "main.pbrt").shapes) == 1200


@pytest.mark.parametrize("end", ["AttributeEnd", "TransformEnd"])
def test_an_end_too_many_is_ignored_as_in_pbrt(end: str) -> None:
    scene = strict(f"Translate 1 0 0 {end} {BALL}")
    assert scene.shapes[0].geometry.corners.max(axis=0)[0] == 2
    assert ["is ignored, as in pbrt" in note for note in scene.notes] == [True]


def test_an_unknown_coordinate_system_is_ignored_as_in_pbrt() -> None:
    scene = strict(f'Translate 1 0 0 CoordSysTransform "nowhere" {BALL}')
    assert scene.shapes[0].geometry.corners.max(axis=0)[0] == 2
    assert ["nowhere" in note for note in scene.notes] == [True]


@pytest.mark.parametrize("flat", ["Scale 1 1 0", "ConcatTransform [ 1 0 0 0  0 1 0 0  0 0 0 0  0 0 0 1 ]"])
def test_a_transformation_without_inverse_flattens_meshes_and_no_more(flat: str) -> None:
    around_nothing = strict(f"AttributeBegin {flat} AttributeEnd {BALL}")
    assert around_nothing.content_hash() == world(BALL).content_hash()
    mesh = 'Shape "trianglemesh" "point3 P" [ 0 0 5  1 0 6  0 1 7 ] "normal N" [ 0 1 1  0 1 1  0 1 1 ]'
    geometry = strict(f"{flat} {mesh}").shapes[0].geometry
    assert isinstance(geometry, TriangleMesh)
    assert geometry.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    world_fails(f"{flat}\n{BALL}", 2, 1, "flattens space")
    world_fails(f'ObjectBegin "o" {BALL}ObjectEnd {flat}\nObjectInstance "o"', 3, 1, "flattens space")


def test_a_camera_needs_an_inverse() -> None:
    with pytest.raises(SceneError, match=r"2:1: .*flattens space"):
        parse(f"Scale 1 1 0 {HEAD}")


def test_a_light_of_negative_scale_is_none_where_substitutes_are_allowed() -> None:
    body = 'LightSource "infinite" "rgb L" [ 1 2 3 ] "float scale" -3.5\n'
    world_fails(body, 1, 42, "negative scale", "--substitute")
    scene = parse(HEAD + body, substitute=True)
    assert sky(scene).radiance.tolist() == [0, 0, 0]
    assert len(scene.substitutions) == 1


@pytest.mark.parametrize(
    ("reflectance_of", "expected"),
    [
        # pbrt divides Planck's law by its peak, at 483 nm for 6000 K; 0.86 of it are left at 630 nm, 0.96 at
        # 550 nm. Luminance 1, as of a light, would brighten all by 6 %.
        ('"blackbody reflectance" 6000', [0.85, 0.96, 0.98]),
        # The peak is at 2.9 micrometres for 1000 K, far beyond what is seen: nearly black.
        ('"blackbody reflectance" 1000', [0.01, 0.0, 0.0]),
        # k of aluminium is above 4 for all that is seen, and a diffuse surface clamps at 1.
        ('"spectrum reflectance" "metal-Al-k"', [1, 1, 1]),
        ('"spectrum reflectance" "glass-BK7"', [1, 1, 1]),
    ],
)
def test_every_spectrum_may_be_a_reflectance(reflectance_of: str, expected: list[float]) -> None:
    assert reflectance(f'Material "diffuse" {reflectance_of}\n') == pytest.approx(expected, abs=0.02)


def test_an_illuminant_as_a_reflectance_has_a_mean_of_one_under_the_eye() -> None:
    """Catches a table taken as it stands: the CIE's D65 is 100 at 560 nm, which would clamp to white."""
    color = reflectance('Material "diffuse" "spectrum reflectance" "stdillum-A"\n')
    assert color[2] < 0.5 < 0.8 < color[0] <= 1


@pytest.mark.parametrize("name", ["metal-Al-k", "metal-Au-eta", "glass-F11", "stdillum-F4"])
def test_every_named_spectrum_may_be_a_light_of_luminance_one(name: str) -> None:
    light = sky(world(f'LightSource "infinite" "spectrum L" "{name}"'))
    assert np.array([0.2126, 0.7152, 0.0722]) @ light.radiance == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize(
    ("eta", "expected", "notes"),
    [
        ('"spectrum eta" [ 300 1.4 900 1.4 ]', 1.4, 0),
        ('"spectrum eta" [ 487.6 1.6 687.6 1.4 ]', 1.5, 1),
        ('"rgb eta" [ 1.25 1.25 1.25 ]', 1.25, 0),
        ('"rgb eta" [ 1 1.5 1 ]', 1.3576, 1),
        ('"spectrum eta" "metal-Au-k"', 2.5, 1),
    ],
)
def test_the_index_of_a_glass_may_be_any_spectrum(eta: str, expected: float, notes: int) -> None:
    scene = world(f'Material "dielectric" {eta}\n{BALL}')
    material = scene.shapes[0].material
    assert isinstance(material, Dielectric)
    assert material.eta == pytest.approx(expected, abs=0.5 if "Au" in eta else 1e-9)
    assert len(scene.notes) == notes


def test_an_infinite_light_takes_the_first_of_several_spectra_as_in_pbrt() -> None:
    """pbrt-v3's second number, a factor, is a second temperature to pbrt-v4, which only this light allows."""
    one = strict('LightSource "infinite" "blackbody L" 6000')
    two = strict('LightSource "infinite" "blackbody L" [ 6000 1 ]')
    assert two.content_hash() == one.content_hash()
    assert ["first holds" in note for note in two.notes] == [True]
    rgb = strict('LightSource "infinite" "rgb L" [ 1 2 3  4 5 6 ]')
    assert sky(rgb).radiance.tolist() == [1, 2, 3]
    world_fails('LightSource "point" "blackbody I" [ 6000 1 ]', 1, 21, "one temperature", "`scale`")
    world_fails('LightSource "infinite" "rgb L" [ 1 2 3 4 ]', 1, 24, "three numbers")


@pytest.mark.parametrize("space", ["\f", "\v", "\u00a0", "\u2009", "\u200b"])
def test_white_space_that_is_none_to_pbrt_is_named(space: str) -> None:
    code = f"U+{ord(space):04X}"
    world_fails(f'Material{space}"diffuse"', 1, 1, "unknown directive", code)
    world_fails(f"Translate 1{space} 2 3", 1, 11, "is not a number", code)
    world_fails(f'Shape "sphere" "float{space}radius" 1', 1, 16, "is no parameter", code)


def test_what_stands_behind_the_name_of_a_parameter_is_of_no_effect_as_in_pbrt() -> None:
    scene = strict('Shape "sphere" "\tfloat  radius now" 3')
    assert scene.shapes[0].geometry.corners.max() == 3


def test_a_path_of_windows_is_found_or_explained(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "ball.pbrt").write_text(BALL)
    main = tmp_path / "main.pbrt"
    main.write_text(HEAD + r'Include "parts\\ball.pbrt"')
    assert len(parse_file(main).shapes) == 1
    for name, words in (
        (r"parts\\gone.pbrt", "nor one with / for its backslashes"),
        (r"parts\ball.pbrt", "begins an escape; write /"),
        (r"parts\Ball.pbrt", "in a path write /"),
    ):
        main.write_text(f'{HEAD}Include "{name}"')
        with pytest.raises(SceneError, match=words):
            parse_file(main)


@pytest.mark.parametrize(
    ("name", "directive"),
    [
        ("sky.exr", 'LightSource "infinite" "string filename" "sky.exr"'),
        ("t.png", 'Texture "t" "spectrum" "imagemap" "string filename" "t.png"'),
        ("m.ply", 'Shape "plymesh" "string filename" "m.ply"'),
        ("m.ply.gz", 'Shape "plymesh" "string filename" "m.ply.gz"'),
        ("part.pbrt", 'Include "part.pbrt"'),
        ("l.spd", 'LightSource "infinite" "spectrum L" "l.spd"'),
    ],
)
def test_a_pointer_of_git_lfs_is_called_so(tmp_path: Path, name: str, directive: str) -> None:
    (tmp_path / name).write_bytes(POINTER)
    (tmp_path / "main.pbrt").write_text(HEAD + directive)
    with pytest.raises(SceneError, match=r"main\.pbrt:7:.*is a Git LFS pointer.*git lfs pull"):
        parse_file(tmp_path / "main.pbrt")


def layered(path: Path, *names: str) -> None:
    write_exr(path, {name: np.full((2, 2), 0.25 * (i + 1)) for i, name in enumerate(names)})


def test_the_only_layer_of_an_image_is_taken_with_a_note(tmp_path: Path) -> None:
    layered(tmp_path / "sky.exr", "diffuse.R", "diffuse.G", "diffuse.B", "depth.Z")
    main = tmp_path / "main.pbrt"
    main.write_text(HEAD + 'LightSource "infinite" "string filename" "sky.exr"')
    scene = parse_file(main)
    image = sky(scene).image
    assert image is not None
    assert image[0, 0].tolist() == [0.25, 0.5, 0.75]
    assert ['layer "diffuse"' in note for note in scene.notes] == [True]
    layered(tmp_path / "sky.exr", "a.R", "a.G", "a.B", "b.R", "b.G", "b.B")
    with pytest.raises(SceneError, match=r"R, G and B in 2 layers; there are: .*a\.R"):
        parse_file(main)
    layered(tmp_path / "sky.exr", "a.R", "a.G", "b.B")
    with pytest.raises(SceneError, match="neither R, G and B"):
        parse_file(main)


def test_normals_of_a_mesh_file_that_are_no_numbers_leave_the_face_its_own(tmp_path: Path) -> None:
    rows = "0 0 0 nan nan nan\n1 0 0 0 0 1\n0 1 0 0 0 1\n"
    columns = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    head = f"ply\nformat ascii 1.0\nelement vertex 3\n{columns}element face 1\n"
    (tmp_path / "m.ply").write_text(
        f"{head}property list uchar int vertex_indices\nend_header\n{rows}3 0 1 2\n"
    )
    normals = read_ply(tmp_path / "m.ply").normals
    assert normals is not None
    assert np.isnan(normals[0]).all()
    (tmp_path / "main.pbrt").write_text(
        HEAD + 'Shape "plymesh" "string filename" "m.ply" "float edgelength" 2'
    )
    assert len(parse_file(tmp_path / "main.pbrt").shapes) == 1


def test_without_an_integrator_strict_refuses_and_others_note() -> None:
    text = HEAD.replace('Integrator "path" "integer maxdepth" [ 1 ]\n', "") + BALL
    assert ["no Integrator" in note for note in parse(text).notes] == [True]
    with pytest.raises(PenumbraError, match="<text>:5:1: the file has no Integrator"):
        parse(text, strict=True)


MOVE = "ActiveTransform EndTime Translate 1 0 0 ActiveTransform All "


def test_what_moves_is_rendered_as_it_stands_at_the_start_where_that_may_be() -> None:
    ends = "".join(f"ActiveTransform {end} Translate 2 0 0 " for end in ("StartTime", "EndTime"))
    still = ends + "ActiveTransform All "
    assert strict(still + BALL).content_hash() == world("Translate 2 0 0 " + BALL).content_hash()
    for moving, what in (
        (MOVE + BALL, "a shape"),
        (f'{MOVE}Shape "trianglemesh" "point3 P" [ 0 0 0  1 0 0  0 1 0 ]', "a shape"),
        (f'ObjectBegin "o" Shape "sphere" ObjectEnd {MOVE}ObjectInstance "o"', "an instance"),
    ):
        world_fails(moving.replace(MOVE, MOVE + "\n"), 2, 1, f"{what} that moves", "--substitute")
        scene = parse(HEAD + moving, substitute=True)
        assert scene.content_hash() == world(moving.replace(MOVE, "")).content_hash()
        assert [f"{what} that moves" in line for line in scene.substitutions] == [True]
    with pytest.raises(SceneError, match="a camera that moves"):
        parse(MOVE + HEAD)
    assert not parse(MOVE + "Identity " + HEAD).substitutions


def test_a_block_gives_back_what_moves_and_coordinate_systems_hold_both_ends() -> None:
    body = f"AttributeBegin {MOVE}AttributeEnd Translate 1 0 0 {BALL}"
    assert strict(body).content_hash() == world("Translate 1 0 0 " + BALL).content_hash()
    world_fails(f'{MOVE}CoordinateSystem "s" Identity CoordSysTransform "s"\n{BALL}', 2, 1, "that moves")


def test_of_options_given_twice_the_last_one_holds_as_in_pbrt() -> None:
    """Also where the first is none that is simulated."""
    text = 'Camera "realistic" "string lensfile" "a.dat" Integrator "lightpath" Film "rgb" "float iso" 200\n'
    scene = parse(text + HEAD, strict=True)
    assert scene.content_hash() == parse(HEAD).content_hash()
    assert len(scene.notes) == 3
    twice = 'Camera "perspective" "float fov" [ 40 ] Translate 1 0 0 Camera "perspective" "float fov" [ 40 ]'
    first = parse(HEAD.replace('Camera "perspective" "float fov" [ 40 ]', twice)).camera
    assert first.camera_to_world[0, 3] == -1


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ('"subsurface" "rgb reflectance" [ .1 .2 .3 ] "rgb mfp" [ 1 1 1 ]', [0.1, 0.2, 0.3]),
        ('"subsurface" "string name" "Ketchup"', [0.16, 0.01, 0.0]),
        # Without absorption all comes back; with nothing but absorption, nothing.
        ('"subsurface" "rgb sigma_a" [ 0 1 0 ] "rgb sigma_s" [ 1 0 2 ]', [1.0, 0.0, 1.0]),
        ('"measured" "string filename" "gone.bsdf"', [0.5, 0.5, 0.5]),
        ('"hair" "rgb color" [ .4 .5 .6 ] "float beta_m" .5', [0.4, 0.5, 0.6]),
        ('"hair" "rgb sigma_a" [ 0 0 0 ]', [1.0, 1.0, 1.0]),
        ('"hair" "float eumelanin" 0 "float beta_n" 0.3', [1.0, 1.0, 1.0]),
    ],
)
def test_materials_that_are_not_simulated_have_a_diffuse_stand_in(kind: str, expected: list[float]) -> None:
    world_fails(f"Material {kind}", 1, 1, "is not supported; --substitute renders it as diffuse")
    scene = parse(f"{HEAD}Material {kind} {BALL}", substitute=True)
    material = scene.shapes[0].material
    assert isinstance(material, Diffuse)
    np.testing.assert_allclose(np.asarray(material.reflectance), expected, rtol=1e-12)
    assert len(scene.substitutions) == 1


def test_pigment_of_hair_gives_back_the_colour_that_it_was_fitted_to() -> None:
    """pbrt's fit is sigma_a = (ln c / f(beta_n))^2; its f(0.3) is 5.969 - 0.0645 + 0.22788 - 0.28971 + ..."""
    f = 5.969 - 0.215 * 0.3 + 2.532 * 0.09 - 10.73 * 0.027 + 5.574 * 0.0081 + 0.245 * 0.00243
    sigma_a = " ".join(str((np.log(c) / f) ** 2) for c in (0.2, 0.5, 0.9))
    scene = parse(f'{HEAD}Material "hair" "rgb sigma_a" [ {sigma_a} ] {BALL}', substitute=True)
    material = scene.shapes[0].material
    assert isinstance(material, Diffuse)
    np.testing.assert_allclose(np.asarray(material.reflectance), [0.2, 0.5, 0.9], rtol=1e-12)


def test_a_texture_is_the_stand_in_of_a_textured_subsurface() -> None:
    board = 'Texture "t" "spectrum" "checkerboard" '
    scene = parse(f'{HEAD}{board}Material "subsurface" "texture reflectance" "t" {BALL}', substitute=True)
    same = world(f'{board}Material "diffuse" "texture reflectance" "t" {BALL}')
    assert scene.content_hash() == same.content_hash()


@pytest.mark.parametrize("kind", ["mitchell", "sinc"])
def test_filters_that_sharpen_are_replaced_by_pbrts_own(kind: str) -> None:
    text = HEAD.replace('PixelFilter "box"', f'PixelFilter "{kind}" "float xradius" 3')
    scene = parse(text, substitute=True)
    assert scene.content_hash() == parse(HEAD.replace('PixelFilter "box"', "")).content_hash()
    assert len(scene.substitutions) == 1


def test_light_sources_in_objects_are_lights_of_the_scene_once_as_in_pbrt() -> None:
    scene = strict(
        f'ObjectBegin "o" Translate 1 0 0 LightSource "point" {BALL}ObjectEnd ObjectInstance "o" ' * 1
    )
    assert len(scene.lights) == 1
    assert ["one light of the scene" in note for note in scene.notes] == [True]


@pytest.mark.parametrize(
    "sampler", ['"stratified" "bool jitter" false', '"sobol" "string randomization" "none"']
)
def test_samplers_keep_their_randomness(sampler: str) -> None:
    """The image that both tend to is the same, so that --strict takes it."""
    scene = parse(f"Sampler {sampler}\n{HEAD}", strict=True)
    assert len(scene.notes) == 1


def test_arrays_of_a_mesh_that_do_not_fit_its_points_are_left_out_as_in_pbrt() -> None:
    mesh = 'Shape "trianglemesh" "point3 P" [ 0 0 0  1 0 0  0 1 0 ] '
    plain = strict(mesh).content_hash()
    for more in ('"normal N" [ 0 0 1 ]', '"point2 uv" [ 0 0 ]', '"integer indices" [ 0 1 2 1 ]'):
        scene = strict(mesh + more)
        assert scene.content_hash() == plain
        assert ["as in pbrt" in note for note in scene.notes] == [True]


def test_a_white_of_aces_is_white_on_a_surface_and_the_colour_of_its_white_as_a_light() -> None:
    """xy of D60 is 0.32163, 0.33774 [CIE 15]: X = 0.9523, Z = 1.0086. IEC 61966-2-1's matrix to linear sRGB
    gives 1.0636, 0.9870, 0.9413: a light taken for D65 is off by 6 %."""
    white = reflectance('ColorSpace "aces2065-1" Material "diffuse" "rgb reflectance" [ 1 1 1 ]\n')
    np.testing.assert_allclose(white, 1.0, atol=1e-9)
    light = sky(world('ColorSpace "ACES2065-1" LightSource "infinite" "rgb L" [ 1 1 1 ]'))
    matrix = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
    xyz = np.array([0.32163, 0.33774, 1 - 0.32163 - 0.33774]) / 0.33774
    np.testing.assert_allclose(light.radiance, matrix @ xyz, atol=0.01)
    assert ["rec709" in note for note in strict('ColorSpace "rec709"').notes] == [True]


PART = 'Texture "a" "spectrum" "constant" "rgb value" [ .6 .6 .6 ] '


def extinction(body: str) -> float:
    """k of a metal whose textures have stand-ins."""
    scene = parse(f"{HEAD}{body}{BALL}", substitute=True)
    material = scene.shapes[0].material
    assert isinstance(material, Conductor)
    assert len(scene.substitutions) == 1
    return float(material.k[0])


@pytest.mark.parametrize(
    ("textures", "expected"),
    [
        ('Texture "t" "spectrum" "constant" "rgb value" [ .3 .3 .3 ]\n', 0.3),
        ('Texture "t" "spectrum" "checkerboard" "rgb tex1" [ .2 .2 .2 ] "rgb tex2" [ .4 .4 .4 ]\n', 0.3),
        (f'{PART}Texture "t" "spectrum" "scale" "texture tex" "a" "float scale" .5\n', 0.3),
        # pbrt's default k is copper's; a texture that comes later is not known by then.
        ("\n", 3.273),
    ],
)  # fmt: skip
def test_a_texture_in_the_place_of_a_number_has_its_mean_for_a_stand_in(
    textures: str, expected: float
) -> None:
    metal = 'Material "conductor" "texture k" "t" "rgb eta" [ 1 1 1 ]\n'
    late = "" if "t" in textures else 'Texture "t" "spectrum" "constant"\n'
    world_fails(textures + metal + late, 2, 22, "texture k", "--substitute renders it as its")
    assert extinction(textures + metal + late) == pytest.approx(expected, rel=2e-4)


def test_the_mean_of_an_image_is_taken_as_pbrt_scales_it(tmp_path: Path) -> None:
    write_exr(tmp_path / "r.exr", {name: np.array([[0.1, 0.3], [0.2, 0.6]]) for name in "RGB"})
    image = 'Texture "t" "float" "imagemap" "string filename" "r.exr" "float scale" 2 '
    metal = 'Material "conductor" "texture roughness" "t" "bool remaproughness" false '
    (tmp_path / "main.pbrt").write_text(HEAD + image + metal + BALL)
    material = parse_file(tmp_path / "main.pbrt", substitute=True).shapes[0].material
    assert isinstance(material, Conductor)
    assert material.alpha == pytest.approx(0.6, rel=1e-6)


def test_a_displacement_of_one_number_turns_nothing() -> None:
    bumps = 'Texture "b" "float" "constant" Material "diffuse" "texture displacement" "b" '
    scene = world(bumps + BALL)
    assert scene.content_hash() == world('Material "diffuse"' + BALL).content_hash()


def test_an_infinite_light_may_stand_under_a_projection_which_turns_nothing(tmp_path: Path) -> None:
    """pbrt looks a direction up by the inverse's upper left part alone, which is that of the affine map."""
    write_exr(tmp_path / "sky.exr", {name: np.arange(4.0).reshape(2, 2) for name in "RGB"})
    main, sky_ = tmp_path / "main.pbrt", 'LightSource "infinite" "string filename" "sky.exr"'
    main.write_text(f"{HEAD}ConcatTransform [ 0 0 -1 0  -1 0 0 0  0 1 0 8.87  0 0 0 1 ] {sky_}")
    projected = parse_file(main, strict=True)
    main.write_text(f"{HEAD}ConcatTransform [ 0 0 -1 0  -1 0 0 0  0 1 0 0  0 0 0 1 ] {sky_}")
    assert projected.content_hash() == parse_file(main).content_hash()
    for what in (BALL, 'LightSource "point"', 'ObjectBegin "o" ObjectEnd ObjectInstance "o"'):
        with pytest.raises(SceneError, match="0 0 0 1: only an infinite light"):
            world(f"ConcatTransform [ 1 0 0 1  0 1 0 0  0 0 1 0  0 0 0 1 ] {what}")


def test_lights_do_not_move_as_in_pbrt() -> None:
    scene = strict(f'{MOVE}LightSource "point"')
    assert scene.content_hash() == world('LightSource "point"').content_hash()
    assert ["does not move" in note for note in scene.notes] == [True]


def test_a_world_that_ends_is_of_an_older_pbrt() -> None:
    world_fails(f"{BALL}WorldEnd", 2, 1, "WorldEnd is of pbrt-v3", "--upgrade")
