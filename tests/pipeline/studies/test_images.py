"""Images of other renderers against a reference: planted biases are seen, noise alone is not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.cli import main
from pipeline.scoring.metric import Estimate, Reference
from pipeline.studies.images import judge_images
from scenes.errors import PenumbraError
from scenes.images.exr import write_estimate_exr, write_exr

SHAPE = (24, 32, 3)
TRUTH = np.linspace(0.2, 1.0, 32)[:, None] * np.ones(SHAPE)
SIGMA = 0.02  # of a pixel of one image: 0.7 % to 10 % of it


def noisy(seed: int, factor: np.ndarray | float = 1.0) -> Estimate:
    """Gamma noise, skewed as that of light is, of mean TRUTH times a factor."""
    shape = (TRUTH / SIGMA) ** 2
    return Estimate(np.random.default_rng(seed).gamma(shape, TRUTH / shape) * factor)


def reference(seed: int = 10**6) -> Reference:
    variance = np.full(SHAPE, (SIGMA / 8) ** 2)
    return Reference(TRUTH + np.random.default_rng(seed).normal(0.0, SIGMA / 8, SHAPE), variance, 64)


def test_false_alarms_are_as_rare_as_claimed() -> None:
    """At 5 %, 400 sets of five images raise 20 alarms on average; 36 or more have a chance of 4e-4."""
    alarms = sum(
        judge_images([noisy(5 * i + k) for k in range(5)], reference(10**6 + i), alpha=0.05).verdict
        == "differs"
        for i in range(400)
    )
    assert alarms < 36


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_one_percent_of_bias_is_seen_in_five_images(factor: float) -> None:
    found = judge_images([noisy(k, factor) for k in range(5)], reference())
    assert found.verdict == "differs"
    clean = judge_images([noisy(k) for k in range(5)], reference())
    assert clean.verdict == "agrees" and clean.tests[0].smallest_detectable < 0.01
    assert "would have been caught" in clean.reason


def test_opposite_errors_of_two_halves_do_not_cancel() -> None:
    halves = np.where(np.arange(32) < 16, 1.05, 1 - 0.05 * 0.4 / 0.8)[None, :, None] * np.ones(SHAPE)
    found = judge_images([noisy(k, halves) for k in range(5)], reference())
    assert found.verdict == "differs"
    assert {test.name: test.reject for test in found.tests}["regions"]


def test_few_and_noisy_images_are_inconclusive() -> None:
    loud = [Estimate(noisy(k).mean + np.random.default_rng(k).normal(0.0, 0.5, SHAPE)) for k in range(2)]
    found = judge_images(loud, reference())
    assert found.verdict == "inconclusive" and found.tests[0].smallest_detectable > 0.01


def test_one_image_needs_the_variance_of_its_mean() -> None:
    with pytest.raises(PenumbraError, match="tells nothing of its noise"):
        judge_images([noisy(1)], reference())
    known = Estimate(noisy(1).mean, np.full(SHAPE, SIGMA**2), np.full(SHAPE[:2], 64.0))
    assert judge_images([known], reference()).verdict == "agrees"
    off = Estimate(known.mean * 1.01, known.variance, known.count)
    assert judge_images([off], reference()).verdict == "differs"
    with pytest.raises(PenumbraError, match="the images are equal: replicates need other seeds"):
        judge_images([noisy(1), noisy(1)], reference())


def write(folder: Path, factor: float) -> list[str]:
    for k in range(4):
        mean = noisy(k, factor).mean
        write_exr(folder / f"{k}.exr", {name: mean[..., c] for c, name in enumerate("RGB")})
    truth = reference()
    write_estimate_exr(folder / "truth.exr", truth.mean, truth.variance, 4096, {"batches": "64"})
    return [str(folder / name) for name in ("0.exr", "1.exr", "2.exr", "3.exr", "truth.exr")]


@pytest.mark.parametrize(("factor", "code", "verdict"), [(1.0, 0, "agrees"), (1.02, 1, "differs")])
def test_the_command_has_the_exit_code_of_its_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], factor: float, code: int, verdict: str
) -> None:
    files = write(tmp_path, factor)
    with pytest.raises(SystemExit) as stopped:
        main(["test", *files, "--json", "--quiet"])
    told = json.loads(capsys.readouterr().out)
    assert (stopped.value.code, told["verdict"]) == (code, verdict)
    assert told["tests"][0]["rejects"] == (code == 1)
    with pytest.raises(SystemExit) as stopped:
        main(["test", files[0], files[-1]])
    assert stopped.value.code == 2
    assert "tells nothing of its noise" in capsys.readouterr().err
