"""Estimators and metrics of a user's own file: found by every process, and keyed by their text."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from renderer import image_fingerprint
from renderer.interfaces.estimator import ESTIMATORS
from scenes import plugins
from scenes.errors import PenumbraError

HALF = """
from dataclasses import dataclass
from renderer.interfaces.estimator import ESTIMATORS, Estimator, Reflected

@dataclass(frozen=True)
class Half(Estimator):
    def refuses(self, scene):
        return None
    def dimensions(self, scene):
        return ESTIMATORS["solid-angle"].dimensions(scene)
    def estimate(self, scene, plan, hit, u):
        whole = ESTIMATORS["solid-angle"].estimate(scene, plan, hit, u)
        return Reflected(FACTOR * whole.radiance, whole.shadow_rays)

ESTIMATORS.add("half", Half("half", "a fraction of the light"))
"""
TWICE = """
from dataclasses import replace
from pipeline.scoring.metric import METRICS
METRICS.add("bias-of-mine", METRICS["bias"])
"""
SWEEP = """
title = "mine"
plugins = ["half.py", "metric.py"]
[[study]]
name = "mine"
scenes = ["touching-light"]
metrics = ["mse", "bias-of-mine"]
reference = { backend = "closed-form" }
[study.axes]
estimator = ["solid-angle", "half"]
spp = [4]
seeds = 1
parameters = { xresolution = [16], yresolution = [12], gap = [0.5] }
"""


@pytest.mark.usefixtures("processes")
def test_a_sweep_renders_plug_ins_and_after_an_edit_theirs_alone(tmp_path: Path) -> None:
    """The plug-in loses half of the reflected light; after the edit a quarter."""
    (tmp_path / "sweep.toml").write_text(SWEEP)
    (tmp_path / "metric.py").write_text(TWICE)

    def run(factor: float) -> dict[str, object]:
        (tmp_path / "half.py").write_text(HALF.replace("FACTOR", str(factor)))
        command = [
            sys.executable,
            "-m",
            "penumbra",
            "run",
            "sweep.toml",
            "-o",
            "out",
            "-w",
            "1",
            "--json",
            "-q",
        ]
        done = subprocess.run(
            command,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)["made"]

    def mean(estimator: str) -> float:
        manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
        (key,) = (c["key"] for c in manifest["studies"][0]["cells"] if c["job"]["estimator"] == estimator)
        import numpy as np

        with np.load(tmp_path / "out" / "cells" / key / "state.npz") as state:
            return float(state["mean"].mean())

    assert run(0.5) == {"references": 1, "cells": 2, "scores": 2}
    whole, half = mean("solid-angle"), mean("half")
    assert run(0.75) == {"references": 0, "cells": 1, "scores": 1}
    assert whole - half > 0.01 * whole  # the rest of the image is emission in view
    assert whole - mean("half") == pytest.approx((whole - half) / 2, rel=1e-12)


@pytest.fixture
def used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """Uses a text as the plug-in `mine.py`; what it registers goes with the test."""
    monkeypatch.setenv(plugins.VARIABLE, "")
    ESTIMATORS.names()
    monkeypatch.setattr(ESTIMATORS, "_entries", dict(ESTIMATORS._entries))
    monkeypatch.setattr(ESTIMATORS, "_files", dict(ESTIMATORS._files))

    def use(text: str) -> Path:
        file = tmp_path / "mine.py"
        file.write_text(text)
        plugins.use(file)
        return file

    return use


def test_an_edit_changes_the_key_of_its_own_images_alone(used: Callable[[str], Path]) -> None:
    file = used(HALF.replace("FACTOR", "0.5"))
    mine, other = image_fingerprint("half", "sobol"), image_fingerprint("mis", "sobol")
    assert os.environ[plugins.VARIABLE] == str(file)
    file.write_text("not what was run")
    assert image_fingerprint("half", "sobol") == mine
    used(HALF.replace("FACTOR", "0.25"))
    assert image_fingerprint("half", "sobol") != mine
    assert image_fingerprint("mis", "sobol") == other
    assert len({other, image_fingerprint("mis", "independent"), image_fingerprint("area", "sobol")}) == 3


def test_what_no_file_registered_has_no_key(used: Callable[[str], Path]) -> None:
    exec(HALF.replace("FACTOR", "1"), {"__name__": "__main__"})
    with pytest.raises(PenumbraError, match="estimator 'half' comes from no file"):
        image_fingerprint("half", "sobol")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\ndef f(:", r"mine\.py:2: SyntaxError: "),
        ("x = 1\n\ny = x / 0", r"mine\.py:3: ZeroDivisionError: division by zero"),
        ("import nobody", r"mine\.py:1: ModuleNotFoundError: No module named 'nobody'"),
        (
            "from renderer.interfaces.estimator import ESTIMATORS\nESTIMATORS.add('mis', 1)",
            r"mine\.py:2: ValueError: estimator 'mis' is registered twice",
        ),
    ],
)
def test_a_plug_in_that_fails_is_told_with_its_line(
    used: Callable[[str], Path], text: str, message: str
) -> None:
    with pytest.raises(PenumbraError, match=rf"^plug-in .*{message}"):
        used(text)
