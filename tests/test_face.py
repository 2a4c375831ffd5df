"""`import penumbra as pn`, `penumbra` and `python -m penumbra`."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import penumbra as pn
from penumbra.rooms import ROOMS

SMALL = {"gap": 0.1, "xresolution": 16.0, "yresolution": 12.0}
SCRIPT = Path(sys.executable).with_name("penumbra")


def _start(command: Sequence[str], cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | variables
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=120)


def test_every_name_of_the_face_is_there_and_documented() -> None:
    assert set(pn.__all__) <= set(dir(pn))
    assert [name for name in pn.__all__ if not getattr(pn, name).__doc__] == []
    with pytest.raises(AttributeError, match="no attribute 'rendr'"):
        pn.rendr  # noqa: B018


@pytest.mark.usefixtures("processes")
def test_import_brings_no_numpy(tmp_path: Path) -> None:
    code = "import sys, penumbra; print([m for m in ('numpy', 'scenes', 'pipeline') if m in sys.modules])"
    assert _start([sys.executable, "-c", code], tmp_path).stdout == "[]\n"


def test_render_compare_and_their_pictures() -> None:
    scene = pn.load("touching-light", SMALL)
    image = pn.render(scene, estimator="solid-angle", spp=4)
    truth = pn.reference(scene, backend="closed-form")
    scores = pn.compare(image, truth, ["rmse", "relmse"])
    assert image.image.shape == (12, 16, 3) and image.variance is not None
    assert list(scores) == ["rmse", "relmse"]
    assert 0 < (scores["rmse"].value or 0) < 1
    assert image._repr_png_().startswith(b"\x89PNG")
    assert "stops</figcaption>" in image._repr_html_()
    assert image.exposed(-3)._repr_png_() != image.exposed(0)._repr_png_()
    assert scores._repr_html_().count("<tr>") == 3
    assert pn.compare(image.image, image.image, ["rmse"])["rmse"].value == 0


def test_a_sampler_of_dependent_samples_claims_no_variance() -> None:
    image = pn.render(pn.load("touching-light", SMALL), estimator="solid-angle", sampler="sobol", spp=4)
    assert image.variance is None


def test_check_passes_an_unbiased_estimator_and_stops_a_wrong_reference() -> None:
    scene = pn.load("touching-light", SMALL)
    truth = pn.reference(scene, backend="closed-form")
    assert pn.check(scene, "solid-angle", spp=2048, truth=truth).verdict == "unbiased"
    other = pn.reference(pn.load("touching-light", SMALL | {"gap": 0.3}), backend="closed-form")
    with pytest.raises(AssertionError, match="solid-angle: biased"):
        pn.check(scene, "solid-angle", spp=64, truth=other)


def test_a_black_render_shows_itself() -> None:
    scene = pn.load("touching-light", SMALL)
    image = pn.render(scene, estimator="solid-angle", spp=1)
    image.result.image[...] = 0.0
    assert np.all(image.image == 0.0)
    assert "+0.0 stops" in image._repr_html_()


@pytest.mark.parametrize("room", ROOMS)
@pytest.mark.usefixtures("processes")
def test_a_folder_with_a_package_of_our_name_is_one_clear_line(room: str, tmp_path: Path) -> None:
    (tmp_path / room).mkdir()
    (tmp_path / room / "__init__.py").write_text("")
    for command, variables in (
        ([sys.executable, "-m", "penumbra", "list", "samplers"], {}),
        ([str(SCRIPT), "list", "samplers"], {"PYTHONPATH": "."}),
    ):
        done = _start(command, tmp_path, **variables)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith(f"penumbra: {tmp_path / room} hides Penumbra's own package {room!r}")
        assert done.stderr.count("\n") == 1
    code = "import penumbra as pn; pn.load"
    assert "hides Penumbra's own package" in _start([sys.executable, "-c", code], tmp_path).stderr


@pytest.mark.usefixtures("processes")
def test_the_command_and_its_workers_find_our_packages_beside_others(tmp_path: Path) -> None:
    for room in ROOMS:
        (tmp_path / room).mkdir()
        (tmp_path / room / "__init__.py").write_text("raise SystemExit('not ours')")
    small = ("-D", "xresolution=16", "-D", "yresolution=12")
    for command in (
        ["reference", "soft-shadow", "--spp", "64", "--cache", "kept", *small],
        ["baseline", "soft-shadow", "-o", "cheap.exr", *small],
    ):
        done = _start([str(SCRIPT), *command, "--quiet"], tmp_path)
        assert done.returncode == 0, done.stderr


@pytest.mark.usefixtures("processes")
def test_version() -> None:
    for command in ([str(SCRIPT)], [sys.executable, "-m", "penumbra"]):
        done = _start([*command, "--version"], SCRIPT.parent)
        assert (done.returncode, done.stdout) == (0, f"penumbra {version('penumbra')}\n")
