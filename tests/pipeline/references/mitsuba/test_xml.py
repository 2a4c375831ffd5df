"""Exported Mitsuba XML, loaded by Mitsuba itself, is the image that our conversion gives it."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from typer.testing import CliRunner

from pipeline.cli import app
from pipeline.references.backends.mitsuba import working_variant
from pipeline.references.mitsuba.process import llvm_library, run_task
from pipeline.references.mitsuba.scene import convert
from pipeline.references.mitsuba.worker import Task
from pipeline.references.mitsuba.xml import to_xml
from scenes.description.lights import DistantLight, Environment, PointLight, SpotLight
from scenes.description.materials import Conductor, Diffuse, Material
from scenes.description.scene import Film, PixelFilter, SceneDescription
from scenes.description.shapes import Array, Disk, Emission, ShapeDescription, Sphere, TriangleMesh
from scenes.description.textures import Checkerboard, ImageTexture, UVMapping
from scenes.errors import PenumbraError
from scenes.images.exr import write_exr
from scenes.pbrt.parser import parse
from tests.kit.mitsuba_scenes import floor, look_at, rectangle, scene, shape, vector

X, Y, Z = np.eye(3)
RNG = np.random.default_rng(2)
IMAGE = RNG.random((4, 4, 3)).astype(np.float32).astype(np.float64)
SEED, SPP = 7, 16
LOAD = f"""
import sys, numpy, mitsuba
mitsuba.set_variant(sys.argv[1])
scene = mitsuba.load_file(sys.argv[2])
numpy.save(sys.argv[3], numpy.array(mitsuba.render(scene, seed={SEED}, spp={SPP})))
"""


def everything(metal: bool = False) -> SceneDescription:
    """One of each, far from the origin."""
    checks = Checkerboard(ImageTexture(IMAGE), vector(0.1, 0.7, 0.2), UVMapping(3.0, 3.0))
    ball: Material = (
        Conductor(vector(0.2, 0.9, 1.5), vector(3.9, 2.4, 2.0), 0.3) if metal else Diffuse(np.full(3, 0.6))
    )
    lamp = Emission(vector(3, 2, 1), two_sided=True)
    triangle = TriangleMesh(vector(2, 0, 0, 2, 1, 0, 2, 0, 1).reshape(3, 3), np.array([[0, 1, 2]]))
    shapes = [
        dataclasses.replace(floor(), material=Diffuse(checks)),
        ShapeDescription(
            rectangle(vector(0, 2, 0), 0.5 * Z, 0.5 * X),
            Diffuse(np.zeros(3)),
            Emission(np.full(3, 9.0), image=IMAGE),
        ),
        ShapeDescription(Sphere(vector(0.5, 0.6, 0.3), 0.3), ball),
        ShapeDescription(Disk(vector(-1, 1, -0.5), vector(0.6, 0.8, 0), 0.4), Diffuse(np.full(3, 0.3)), lamp),
        ShapeDescription(triangle, Diffuse(ImageTexture(IMAGE, filter="point"))),
        shape(dataclasses.replace(triangle, vertices=triangle.vertices + vector(-3, 0.5, 1)), 0.5, (1, 1, 2)),
    ]
    lights = (
        PointLight(vector(2, 3, 1), vector(3, 3, 5)),
        SpotLight(vector(-2, 3, 1), vector(0.6, -0.8, 0), vector(5, 9, 5), 35.0, 20.0),
        DistantLight(vector(0, 0.8, -0.6), vector(0.2, 0.3, 0.2)),
        Environment(vector(0.2, 0.3, 0.4), hemisphere=True, frame=np.stack([Z, X, Y], axis=1)),
    )
    made = scene(shapes, look_at(vector(3, 4, -6), vector(0, 0.5, 0), Y), 40.0, 40, 30)
    return dataclasses.replace(made, lights=lights)


def loaded(path: Path) -> Array:
    """What Mitsuba renders of the file."""
    library = llvm_library()
    environment = os.environ | ({"DRJIT_LIBLLVM_PATH": library} if library else {})
    target = path.with_suffix(".npy")
    subprocess.run(
        [sys.executable, "-c", LOAD, working_variant(), str(path), str(target)], check=True, env=environment
    )
    return np.load(target).astype(np.float64)


def written(given: SceneDescription, folder: Path) -> Path:
    files = to_xml(given, "scene")
    for name, image in files.images.items():
        write_exr(
            folder / name,
            dict(zip("RGB" if image.shape[2] == 3 else "Y", np.moveaxis(image, -1, 0), strict=True)),
        )
    for name, mesh in files.meshes.items():
        (folder / name).write_bytes(mesh)
    path = folder / "scene.xml"
    path.write_text(files.text)
    return path


def converted(given: SceneDescription) -> Array:
    (image,) = run_task(Task(working_variant(), convert(given), SPP, (SEED,)))
    return image


@pytest.mark.parametrize("mesh", [False, True])
@pytest.mark.usefixtures("mitsuba")
def test_the_file_renders_to_our_references_image(mesh: bool, tmp_path: Path):
    """The same seed, so that nothing but rounding differs: one sample in 19,200 that falls on the other side
    of an edge is allowed for.

    With the mesh as the only light, or without it: Mitsuba's order of emitters, by which it draws them, is
    another for meshes from files.
    """
    given = everything()
    dark = (*(dataclasses.replace(one, emission=None) for one in given.shapes[:-1]), given.shapes[-1])
    given = (
        dataclasses.replace(given, shapes=dark, lights=())
        if mesh
        else dataclasses.replace(given, shapes=given.shapes[:-1])
    )
    ours, theirs = converted(given), loaded(written(given, tmp_path))
    same = np.all(np.abs(ours - theirs) <= 1e-5 * ours.mean(), axis=-1)
    print(f"largest difference {np.abs(ours - theirs).max():.1e}, {np.count_nonzero(~same)} pixels differ")
    assert ours.std() > 0.1 * ours.mean() > 0
    assert np.count_nonzero(~same) <= 2 and theirs.mean() == pytest.approx(ours.mean(), rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["triangle", "gaussian"])
@pytest.mark.usefixtures("mitsuba")
def test_metals_and_filters_are_mitsubas_own_and_the_file_says_so(kind: str, tmp_path: Path):
    """Loaded, they render to nearly the same image: means within 2 %."""
    given = everything(metal=True)
    given = dataclasses.replace(given, film=Film(40, 30, "", PixelFilter(kind, 2.0, 2.0)))
    path = written(given, tmp_path)
    text = path.read_text()
    for words in (
        "roughconductor",
        "correlated by height",
        "splats",
        "tent" if kind == "triangle" else kind,
    ):
        assert words in text
    assert loaded(path).mean() == pytest.approx(converted(given).mean(), rel=2e-2)


def test_filters_without_a_counterpart_are_refused():
    for chosen in (PixelFilter("box", 1.0, 1.0), PixelFilter("gaussian", 1.5, 2.0)):
        with pytest.raises(PenumbraError, match="Mitsuba has no"):
            to_xml(dataclasses.replace(everything(), film=Film(4, 4, "", chosen)), "scene")


def test_the_command_writes_all_files_and_says_what_was_moved(tmp_path: Path):
    target = tmp_path / "a b.xml"
    done = CliRunner().invoke(app, ["export", "soft-shadow", "--to", "mitsuba", "-o", str(target)])
    assert (done.exit_code, done.stdout) == (0, "")
    assert (
        "a point p of the scene is at" in done.stderr and "a point p of the scene is at" in target.read_text()
    )
    root = ElementTree.parse(target).getroot()
    names = {item.get("value") for item in root.iter("string") if item.get("name") == "filename"}
    assert names == {path.name for path in tmp_path.iterdir()} - {target.name}


@pytest.mark.parametrize("to", ["mitsuba", "pbrt"])
def test_what_has_files_beside_it_needs_a_file(to: str, tmp_path: Path):
    write_exr(tmp_path / "sky.exr", {name: np.ones((2, 2)) for name in "RGB"})
    path = tmp_path / "sky.pbrt"
    path.write_text(
        'Camera "perspective"\nWorldBegin\nLightSource "infinite" "string filename" "sky.exr"\nShape '
        '"sphere"\n'
    )
    before = sorted(tmp_path.iterdir())
    done = CliRunner().invoke(app, ["export", str(path), "--to", to])
    assert isinstance(done.exception, PenumbraError) and "-o FILE" in str(done.exception)
    assert sorted(tmp_path.iterdir()) == before


def test_a_file_that_cannot_be_written_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    done = CliRunner().invoke(
        app, ["export", "soft-shadow", "--to", "mitsuba", "-o", str(tmp_path / "a.xml")]
    )
    assert isinstance(done.exception, PenumbraError) and "No space left" in str(done.exception)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("material", "kind", "noted"),
    [
        ('"dielectric" "float eta" 1.4', "dielectric", False),
        ('"thindielectric" "float eta" 1.4', "thindielectric", False),
        ('"dielectric" "float roughness" 0.3', "roughdielectric", True),
        ('"conductor"', "conductor", False),
    ],
)
def test_glass_and_mirrors_are_mitsubas_own_and_their_masking_is_noted(
    material: str, kind: str, noted: bool
) -> None:
    text = f'Camera "perspective"\nWorldBegin\nLightSource "infinite"\nMaterial {material}\nShape "sphere"\n'
    files = to_xml(parse(text), "ball")
    assert f'<bsdf type="{kind}"' in files.text
    assert any("correlated by height" in note for note in files.notes) == noted
