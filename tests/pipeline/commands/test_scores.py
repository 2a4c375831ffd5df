"""`penumbra compare` and `penumbra verify`: what they take, what they answer, and when they fail."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.scoring.metric import METRICS
from renderer.light_sampling.area import AreaSampling
from scenes.images.exr import write_estimate_exr, write_exr
from tests.pipeline.commands.test_commands import Penumbra, answer, images, penumbra

__all__ = ["penumbra"]

SMALL = ("-D", "xresolution=32", "-D", "yresolution=24", "-D", "gap=1")
EXACT = ("touching-light", "--reference", "closed-form", *SMALL)


def test_compare_answers_by_every_metric(penumbra: Penumbra, tmp_path: Path) -> None:
    """Images that others made: no variance, no samples.

    Each score says its unit and its direction, or why it has no value.
    """
    told = answer(penumbra, "compare", *images(tmp_path, 0.1))
    assert list(told["scores"]) == METRICS.names() == list(told["units"])
    assert (
        told["scores"]["bias"]["value"] == pytest.approx(0.1, rel=1e-4) and told["better"]["bias"] == "zero"
    )
    missing = {name for name, score in told["scores"].items() if score["value"] is None}
    assert missing == {"noise", "largest-share", "umbra-leak"}
    assert all(told["scores"][name]["note"] for name in missing)


def test_json_has_null_for_what_is_infinite_and_says_why(penumbra: Penumbra, tmp_path: Path) -> None:
    """Equal pictures have an infinite PSNR; against a closed form, single pixels promise to catch no size of
    bias.
    """
    psnr = answer(penumbra, "compare", *[images(tmp_path, 0.0)[0]] * 2, "-m", "psnr")["scores"]["psnr"]
    assert psnr["value"] is None and "infinite" in psnr["note"]
    told = answer(penumbra, "verify", *EXACT, "--estimator", "solid-angle", "--spp", "16")
    assert next(test for test in told["tests"] if test["name"] == "pixels")["smallest_detectable"] is None


def test_compare_takes_the_variance_from_a_file_of_its_own(penumbra: Penumbra, tmp_path: Path) -> None:
    """A reference with noise of 0.1 a pixel, which is all that tells it from the image: taken as exact, the
    image's RMSE is 0.1.
    """
    rng = np.random.default_rng(71)
    truth = rng.uniform(0.5, 1.0, (48, 64, 3))
    for name, image in (
        ("a", truth),
        ("b", truth + 0.1 * rng.standard_normal(truth.shape)),
        ("v", np.full_like(truth, 0.01)),
    ):
        write_exr(tmp_path / f"{name}.exr", dict(zip("RGB", np.moveaxis(image, 2, 0), strict=True)), {})
    a, b, v = (tmp_path / f"{name}.exr" for name in "abv")
    plain = answer(penumbra, "compare", a, b, "-m", "rmse")["scores"]["rmse"]
    known = answer(penumbra, "compare", a, b, "-m", "rmse", "--reference-variance", v)["scores"]["rmse"]
    assert plain["value"] == pytest.approx(0.1, rel=0.05) and not plain["bound"]
    assert known["bound"] and known["value"] < 0.03
    code, out, _ = penumbra("compare", a, b, "-m", "rmse", "-m", "psnr", "--reference-variance", v)
    assert code == 0 and "<= " in out and ">= " in out
    write_exr(tmp_path / "w.exr", dict.fromkeys("RGB", np.full((4, 5), 1e-4)), {})
    code, _, err = penumbra("compare", a, b, "--reference-variance", tmp_path / "w.exr")
    assert code == 2 and "5 x 4 pixels for a reference of 64 x 48" in err


def test_compare_knows_the_samples_of_our_own_images(penumbra: Penumbra, tmp_path: Path) -> None:
    truth = np.full((12, 16, 3), 0.5)
    write_estimate_exr(tmp_path / "a.exr", truth, np.full_like(truth, 1e-4), 16)
    write_exr(tmp_path / "b.exr", dict.fromkeys("RGB", np.full((12, 16), 0.5)), {})
    noise = answer(penumbra, "compare", tmp_path / "a.exr", tmp_path / "b.exr", "-m", "noise")["scores"][
        "noise"
    ]
    assert noise["value"] == pytest.approx(0.01, rel=1e-4)


@pytest.mark.parametrize(("limit", "code"), [("bias=0.2", 0), ("bias=0.05", 1)])
def test_a_limit_on_the_bias_is_on_its_size(
    penumbra: Penumbra, tmp_path: Path, limit: str, code: int
) -> None:
    assert penumbra("compare", *images(tmp_path, -0.1), "-m", "bias", "--limit", limit)[0] == code


def test_verify_says_unbiased_with_its_power(penumbra: Penumbra, tmp_path: Path) -> None:
    told = answer(penumbra, "verify", *EXACT, "--estimator", "area", "--spp", "1024", "--cache", tmp_path)
    assert (told["scene"], told["estimator"], told["verdict"]) == ("touching-light", "area", "unbiased")
    assert {"name", "p", "effect", "smallest_detectable"} <= set(told["tests"][0])
    assert [test["name"] for test in told["tests"]][:2] == ["image", "regions"]
    assert "region light" in [test["name"] for test in told["tests"]]
    assert 0 < told["tests"][0]["smallest_detectable"] < 0.01


def test_verify_fails_on_a_bias(penumbra: Penumbra, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = AreaSampling.sample_direction

    def brighter(self, *given):
        sample = plain(self, *given)
        return type(sample)(**{**vars(sample), "radiance": sample.radiance * 1.05})

    monkeypatch.setattr(AreaSampling, "sample_direction", brighter)
    code, out, _ = penumbra("verify", *EXACT, "--estimator", "area", "--spp", "256", "--cache", tmp_path)
    assert code == 1 and "differs" in out and "touching-light, area: biased: " in out


@pytest.mark.parametrize(("strict", "code"), [((), 0), (("--strict",), 1)])
def test_verify_is_inconclusive_without_power(
    penumbra: Penumbra, tmp_path: Path, strict: tuple[str, ...], code: int
) -> None:
    line = (
        "verify",
        *EXACT,
        "--estimator",
        "area",
        "--spp",
        "2",
        "--bias",
        "1e-5",
        "--cache",
        tmp_path,
        *strict,
    )
    got, out, _ = penumbra(*line)
    assert got == code and "inconclusive" in out
