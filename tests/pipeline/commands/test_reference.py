"""`penumbra reference` by its own command line: kept, added to, stopped and gone on with, and never stale."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.references import default_cache
from scenes.images.exr import read_estimate_exr, write_exr
from tests.pipeline.commands.test_commands import Penumbra, answer, penumbra

pytestmark = pytest.mark.usefixtures("thorough")

__all__ = ["penumbra"]

ROOT = Path(__file__).parents[3]
TINY = ("-D", "xresolution=8", "-D", "yresolution=6")
OWN = ("--backend", "self")

SCENE = """
LookAt 0 2 -4  0 0 0  0 1 0
Camera "perspective" "float fov" [ 40 ]
Film "rgb" "integer xresolution" [ 8 ] "integer yresolution" [ 6 ]
WorldBegin
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 5 5 5 ]
  Translate 0 3 0
  Rotate 90 1 0 0
  Shape "disk" "float radius" [ 0.5 ]
AttributeEnd
Texture "paint" "spectrum" "imagemap" "string filename" "paint.exr"
Material "diffuse" "texture reflectance" "paint"
Shape "plymesh" "string filename" "floor.ply"
"""
PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
-3 {height} -3
-3 {height} 3
3 {height} 3
3 {height} -3
4 0 1 2 3
"""


def ask(penumbra: Penumbra, *arguments: str | Path) -> Any:
    return answer(penumbra, "reference", *arguments)


def test_it_is_kept_and_added_to(penumbra: Penumbra) -> None:
    first = ask(penumbra, "touching-light", *TINY, *OWN, "--spp", "128")
    assert (first["spp"], first["batches"], first["spp_kept"]) == (128, 64, 0)
    assert Path(first["stored"]).is_relative_to(default_cache()) and first["output"] is None
    again = ask(penumbra, "touching-light", *TINY, *OWN, "--spp", "128")
    assert (again["spp_kept"], again["provenance"]) == (128, first["provenance"])
    more = ask(penumbra, "touching-light", *TINY, *OWN, "--spp", "512")
    assert (more["stored"], more["spp_kept"], more["spp"]) == (first["stored"], 128, 512)
    assert more["rms_standard_error"] < 0.8 * first["rms_standard_error"]
    stored = read_estimate_exr(more["stored"])
    assert np.all(stored.count == 512) and stored.metadata == more["provenance"]
    folder = Path(more["stored"]).parent
    assert json.loads((folder / "provenance.json").read_text()) == more["provenance"]
    with np.load(folder / "reference.npz") as state:
        assert state["mean"].dtype == np.float64
        np.testing.assert_array_equal(state["mean"].astype(np.float32), stored.mean)


def test_it_goes_on_to_a_target_and_tells_median_and_percentile(penumbra: Penumbra) -> None:
    told = ask(penumbra, "touching-light", *TINY, *OWN, "--target-se", "0.02")
    relative = told["relative_standard_error"]
    assert relative["median"] <= 0.02 and relative["p99"] <= 0.2 and told["batches"] >= 64
    code, out, _ = penumbra("reference", "touching-light", *TINY, *OWN, "--target-se", "0.02")
    assert code == 0
    assert re.search(r"median [\d.]+, 99th percentile [\d.]+ of pixels \(target 0.02 and 0.2\)", out)
    assert "all of them kept" in out and "no independent check" in out


def test_copies_are_what_is_stored(penumbra: Penumbra, tmp_path: Path) -> None:
    for name in ("a.exr", "a.png"):
        told = ask(penumbra, "touching-light", *TINY, "--backend", "closed-form", "-o", tmp_path / name)
    assert (tmp_path / "a.exr").read_bytes() == Path(told["stored"]).read_bytes()
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert (told["batches"], told["independent"], told["quantity"]) == (0, True, "radiance")
    assert told["relative_standard_error"]["p99"] < 1e-6


def test_an_edited_scene_mesh_or_texture_is_never_served_a_stale_image(
    penumbra: Penumbra, tmp_path: Path
) -> None:
    scene, mesh, texture = tmp_path / "a.pbrt", tmp_path / "floor.ply", tmp_path / "paint.exr"
    scene.write_text(SCENE)
    mesh.write_text(PLY.format(height=0))
    write_exr(texture, dict.fromkeys("RGB", np.full((2, 2), 0.5)))
    request = (scene, *OWN, "--spp", "64")
    first = ask(penumbra, *request)
    assert ask(penumbra, *request)["spp_kept"] == 64
    seen = {first["key"]}
    for change in (
        lambda: scene.write_text(SCENE.replace("5 5 5", "6 5 5")),
        lambda: mesh.write_text(PLY.format(height=0.5)),
        lambda: write_exr(texture, dict.fromkeys("RGB", np.full((2, 2), 0.25))),
    ):
        change()
        told = ask(penumbra, *request)
        assert told["spp_kept"] == 0 and told["key"] not in seen
        seen.add(told["key"])
    scene.write_text("# a comment\n" + scene.read_text())
    assert ask(penumbra, *request)["key"] == told["key"], "a comment is no part of the image"


def test_damage_is_told_on_stderr_and_mended(penumbra: Penumbra, caplog: pytest.LogCaptureFixture) -> None:
    request = ("touching-light", *TINY, "--backend", "closed-form")
    told = ask(penumbra, *request)
    Path(told["stored"]).write_bytes(b"nonsense")
    again = ask(penumbra, *request)
    assert "damaged (reference.exr is not what was written); it will be made again" in caplog.text
    assert np.isfinite(read_estimate_exr(again["stored"]).mean).all()


def test_ambient_occlusion_is_a_quantity_of_its_own(penumbra: Penumbra) -> None:
    told = ask(penumbra, "touching-light", *TINY, *OWN, "--spp", "64", "--quantity", "ambient-occlusion")
    light = ask(penumbra, "touching-light", *TINY, *OWN, "--spp", "64")
    assert told["quantity"] == "ambient-occlusion" and max(told["mean"]) <= 1 and told["key"] != light["key"]
    code, _, err = penumbra(
        "reference", "touching-light", *TINY, "--backend", "closed-form", "--quantity", "ambient-occlusion"
    )
    assert code == 2 and "lights that may be in the way; backends that take it: mitsuba, self" in err


@pytest.mark.usefixtures("mitsuba")
def test_a_refusal_names_the_backends_that_take_the_scene(penumbra: Penumbra) -> None:
    code, _, err = penumbra("reference", "touching-light", *TINY, "-D", "gap=1e-7", "--backend", "mitsuba")
    assert code == 2
    (said,) = [line for line in err.splitlines() if line.strip()]
    assert "rays start" in said and said.endswith("backends that take it: closed-form, self")


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
@pytest.mark.usefixtures("processes")
def test_stopped_at_any_moment_it_goes_on(tmp_path: Path, sent: signal.Signals) -> None:
    """Killed or interrupted when the first batches are on disk; what is on disk then is not drawn again."""
    size = ("-D", "xresolution=64", "-D", "yresolution=48")
    command = [sys.executable, "-m", "pipeline.cli", "reference", "touching-light", *size, *OWN, "--json"]
    command += ["--spp", "2048", "--cache", str(tmp_path)]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        limit = time.monotonic() + 60
        while not list(tmp_path.glob("*.unfinished")):
            assert time.monotonic() < limit and process.poll() is None
            time.sleep(0.02)
        process.send_signal(sent)
        out, err = process.communicate()
    assert process.returncode == (130 if sent == signal.SIGINT else -signal.SIGKILL) and out == ""
    assert sent == signal.SIGKILL or "the same command goes on from there" in err
    environment = {**os.environ, "NO_COLOR": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    told = json.loads(done.stdout)
    assert 0 < told["spp_kept"] < told["spp"] == 2048 and told["batches"] == 64
    assert not list(tmp_path.glob("*.unfinished"))
    print(f"{told['spp_kept']} of 2048 samples a pixel were kept")
