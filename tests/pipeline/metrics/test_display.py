"""PSNR, SSIM and FLIP: on a stated picture, with the traps of the libraries walked round."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from pipeline.metrics.flip import Flip, exposures
from pipeline.scoring.flip_library import evaluate
from pipeline.scoring.metric import METRICS, Estimate, Image, Reference
from pipeline.scoring.tone import displayed, exposure, luminance

HEIGHT, WIDTH = 24, 32


def scene(seed: int = 0) -> Image:
    return 0.05 + np.random.default_rng(seed).random((HEIGHT, WIDTH, 3))


def exact(image: Image) -> Reference:
    return Reference(image, np.zeros_like(image), 64)


def test_srgb_encoding_at_known_values() -> None:
    """Black, the end of the linear branch, middle gray, white, and what is clipped.

    Values of IEC 61966-2-1.
    """
    linear = np.array([[[-1.0, 0.0, 0.0031308], [0.18, 1.0, 7.0]]])
    expected = [[[0.0, 0.0, 0.04045], [0.46136, 1.0, 1.0]]]
    assert displayed(linear, 1.0) == pytest.approx(np.array(expected), abs=2e-5)


def test_exposure_puts_the_lit_median_at_middle_gray_whatever_light_is_in_view() -> None:
    """Catches an exposure from the mean or the maximum: a light of radiance 1e6 in view would turn all else
    black.
    """
    image = np.zeros((HEIGHT, WIDTH, 3))
    image[:, 10:] = 0.36
    image[:3, 20:24] = 1e6
    assert exposure(image) == pytest.approx(0.5)
    assert exposure(np.zeros((2, 2, 3))) == 1.0


def test_luminance_weights_green_most_and_white_is_one() -> None:
    assert luminance(np.eye(3)[None]) == pytest.approx(np.array([[0.2126, 0.7152, 0.0722]]))
    assert luminance(np.ones((1, 1, 3))) == pytest.approx(np.ones((1, 1)))


@pytest.mark.parametrize("name", ["psnr", "ssim", "flip"])
def test_the_scale_of_radiance_does_not_matter(name: str) -> None:
    """A picture's exposure follows the reference, so that a scene with 1000 times the power scores the
    same.
    """
    truth, shown = scene(), scene() * 1.1
    scores = [METRICS[name](Estimate(shown * k), exact(truth * k)).score.value for k in (1.0, 1000.0)]
    assert scores[0] == pytest.approx(scores[1], rel=1e-4)


def test_psnr_of_a_known_difference() -> None:
    truth = np.full((HEIGHT, WIDTH, 3), 0.5)
    metric = METRICS["psnr"](Estimate(np.full_like(truth, 0.6)), exact(truth))
    step = displayed(np.full((1, 1, 3), 0.6), 0.36) - displayed(np.full((1, 1, 3), 0.5), 0.36)
    assert metric.score.value == pytest.approx(-20 * np.log10(step.max()))
    assert "exposure 0.36" in metric.score.note
    assert METRICS["psnr"](Estimate(truth), exact(truth)).score.value == np.inf


def test_psnr_says_when_the_reference_noise_bounds_it() -> None:
    truth, rng = scene(), np.random.default_rng(1)
    noisy = truth + 0.01 * rng.standard_normal(truth.shape)
    for variance, told in ((1e-4, True), (1e-8, False)):
        note = METRICS["psnr"](
            Estimate(noisy), Reference(truth, np.full_like(truth, variance), 64)
        ).score.note
        assert ("lower bound" in note) is told


def test_ssim_is_one_for_equal_pictures_and_small_ones_are_told() -> None:
    assert METRICS["ssim"](Estimate(scene()), exact(scene())).score.value == pytest.approx(1.0)
    small = np.ones((10, 40, 3))
    score = METRICS["ssim"](Estimate(small), exact(small)).score
    assert score.value is None and "11 x 11" in score.note


def test_flip_agrees_with_the_library_where_that_can_be_asked() -> None:
    """Fully lit and finite: the library's own exposures are the published ones. Catches ours going astray."""
    truth, shown = (image.astype(np.float32) for image in (scene(2), scene(2) ** 1.2))
    truth[:4, :4] = 3.0
    error, mean, used = evaluate(truth, shown, "HDR", applyMagma=False, parameters={"ppd": 67.0})
    measured = METRICS["flip"](Estimate(shown.astype(np.float64)), exact(truth.astype(np.float64)))
    start, stop, count = exposures(luminance(truth.astype(np.float64)).ravel())
    # The median of an even number of pixels is one of the middle two there, their mean here.
    assert (start, stop) == pytest.approx((used["startExposure"], used["stopExposure"]), abs=0.02)
    assert count == used["numExposures"]
    assert measured.score.value == pytest.approx(mean, abs=2e-3)
    assert measured.map is not None
    assert np.max(np.abs(measured.map - error[..., 0])) < 0.02


def test_flip_never_asks_for_one_exposure() -> None:
    """With numExposures = 1 the library scores every picture 0: measured, and the reason for at least two."""
    flat, half = np.full((HEIGHT, WIDTH, 3), 0.5), np.full((HEIGHT, WIDTH, 3), 0.25)
    assert exposures(luminance(flat).ravel())[2] == 2
    value = Flip()(Estimate(half), exact(flat)).score.value
    assert value is not None and value > 0.05
    single = {"startExposure": 1.0, "stopExposure": 1.0, "numExposures": 1}
    images = (image.astype(np.float32) for image in (flat, half))
    assert evaluate(*images, "HDR", applyMagma=False, parameters=single)[1] == 0.0


def test_flip_of_a_half_black_picture_takes_few_exposures() -> None:
    """The library's own choice is 26 (the median is black); the unlit half must not set the range."""
    truth = scene(3)
    truth[:, : WIDTH // 2 + 1] = 0.0
    assert Flip()(Estimate(truth * 0.9), exact(truth)).score.note.startswith("2 exposures")


def test_flip_on_a_black_reference_would_end_the_process(processes: None) -> None:
    """The trap is real: when the library stops ending the process, this test tells us to take the guard
    out.
    """
    code = (
        "import numpy as np; from flip_evaluator import evaluate; "
        "z = np.zeros((8, 8, 3), np.float32); evaluate(z, z + 1, 'HDR'); print('survived')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert "survived" not in done.stdout
    assert done.returncode != 0


def test_flip_clips_what_it_cannot_take() -> None:
    """Negative radiance counts as black; 1e40, more than float32 holds, stays finite."""
    truth, shown = scene(4), scene(4)
    shown[0, 0], shown[9, 9] = -1.0, 1e40
    measured = Flip()(Estimate(shown), exact(truth))
    assert measured.map is not None and np.isfinite(measured.map).all()
    assert 0 < (measured.score.value or 0) < 1
