"""Agreement with published implementations, to 1e-4 where the definitions coincide; and where they do not,
what the difference is.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import simpleimageio
from flip_evaluator import evaluate
from skimage.color import deltaE_ciede2000, rgb2lab
from skimage.metrics import mean_squared_error, peak_signal_noise_ratio, structural_similarity

from pipeline.metrics.flip import exposures
from pipeline.scoring.metric import METRICS, Estimate, Image, Reference
from pipeline.scoring.tone import displayed, exposure, luminance

HEIGHT, WIDTH = 48, 64
AGREED = 1e-4


def exact(image: Image) -> Reference:
    """No noise to subtract, as the others know of none."""
    return Reference(image, np.zeros_like(image), 64)


@pytest.fixture(scope="module")
def pair() -> tuple[Image, Image]:
    """A rendering with noise, a light in view and an umbra with a leak, in float32 as the others compute."""
    rng = np.random.default_rng(31)
    truth = 0.02 + np.linspace(0, 1, WIDTH)[None, :, None] ** 2 * rng.uniform(0.5, 1.5, (HEIGHT, WIDTH, 3))
    truth[:6, :6], truth[:, 40:44] = 12.0, 0.0
    shown = truth * (1 + 0.3 * rng.standard_normal(truth.shape)) + 0.003
    return tuple(image.astype(np.float32).astype(np.float64) for image in (np.abs(shown), truth))  # pyright: ignore[reportReturnType]


def ours(name: str, pair: tuple[Image, Image]) -> float:
    value = METRICS[name](Estimate(pair[0]), exact(pair[1])).score.value
    assert value is not None
    return value


def test_simpleimageio(pair: tuple[Image, Image]) -> None:
    shown, truth = pair
    found = {
        "mse": simpleimageio.mse(shown, truth),
        "relmse-simpleimageio": simpleimageio.relative_mse(shown, truth),
    }
    for name, value in found.items():
        assert ours(name, pair) == pytest.approx(value, rel=AGREED), name
    lit = (
        shown,
        np.where(truth == 0, 0.01, truth),
    )  # where the reference is 0 it scores 0, and the trimmed one here does not
    trimmed = simpleimageio.relative_mse_outlier_rejection(*lit, percentage=0.1)
    assert ours("relmse-trimmed", lit) == pytest.approx(trimmed, rel=AGREED)


def test_simpleimageio_does_not_see_a_leak_and_relmse_does(pair: tuple[Image, Image]) -> None:
    shown, truth = pair
    leaking = np.where(truth == 0, 0.5, shown)
    assert simpleimageio.relative_mse(leaking, truth) == pytest.approx(
        simpleimageio.relative_mse(shown, truth)
    )
    assert ours("relmse", (leaking, truth)) > 1.5 * ours("relmse", pair)


def test_imgtool_by_its_source(pair: tuple[Image, Image]) -> None:
    """pbrt-v4, util/image.cpp: Image::MAE, MSE and MRSE term by term, in double, over channels and pixels."""
    shown, truth = pair
    terms = [(v, r) for v, r in zip(shown.ravel().tolist(), truth.ravel().tolist(), strict=True)]
    mrse = sum((v - r) ** 2 / (r + 0.01) ** 2 for v, r in terms) / len(terms)
    mae = sum(abs(v - r) for v, r in terms) / len(terms)
    assert ours("relmse-imgtool", pair) == pytest.approx(mrse, rel=AGREED)
    assert ours("mae", pair) == pytest.approx(mae, rel=AGREED)


def test_scikit_image(pair: tuple[Image, Image]) -> None:
    shown, truth = pair
    scale = exposure(truth)
    left, right = displayed(shown, scale), displayed(truth, scale)
    similarity = structural_similarity(
        right,
        left,
        data_range=1.0,
        channel_axis=-1,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
    )
    assert ours("mse", pair) == pytest.approx(mean_squared_error(truth, shown), rel=AGREED)
    assert ours("psnr", pair) == pytest.approx(
        peak_signal_noise_ratio(right, left, data_range=1.0), abs=AGREED
    )
    assert ours("ssim", pair) == pytest.approx(similarity, abs=AGREED)


def test_ciede2000_against_another_implementation(pair: tuple[Image, Image]) -> None:
    """scikit-image's, from sRGB by its own matrices and white point, whose digits differ by 1e-4 of the
    whole.
    """
    shown, truth = pair
    scale = exposure(truth)
    left, right = (rgb2lab(displayed(image, scale)) for image in (shown, truth))
    assert ours("ciede2000", pair) == pytest.approx(float(np.mean(deltaE_ciede2000(right, left))), rel=5e-4)


def test_ciede2000_of_published_pairs() -> None:
    """The formula that is called, on pairs 1, 4, 7 and 25 of the test data of [sharma2005], table 1."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message='.*"Matplotlib" related API')
        import colour
    pairs = [
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, -1.3802, -84.2814), (50.0, 0.0, -82.7485), 1.0000),
        ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ]
    for first, second, expected in pairs:
        found = colour.difference.delta_E_CIE2000(np.array(first), np.array(second))
        assert float(found) == pytest.approx(expected, abs=AGREED)


def test_flip_with_the_same_exposures(pair: tuple[Image, Image]) -> None:
    shown, truth = (image.astype(np.float32) for image in pair)
    values = luminance(pair[1])
    start, stop, count = exposures(values[values > 0])
    asked = {
        "ppd": 67.0,
        "startExposure": start,
        "stopExposure": stop,
        "numExposures": count,
        "tonemapper": "aces",
    }
    _, mean, _ = evaluate(truth, shown, "HDR", applyMagma=False, parameters=asked)
    assert ours("flip", pair) == pytest.approx(mean, abs=AGREED)


def test_flip_of_displayed_pictures(pair: tuple[Image, Image]) -> None:
    scale = exposure(pair[1])
    shown, truth = (displayed(image, scale).astype(np.float32) for image in pair)
    _, mean, _ = evaluate(truth, shown, "LDR", applyMagma=False, parameters={"ppd": 67.0})
    assert ours("flip-ldr", pair) == pytest.approx(mean, abs=AGREED)


def test_smape_by_hand() -> None:
    truth, shown = np.full((2, 2, 3), 0.5), np.full((2, 2, 3), 0.25)
    assert ours("smape", (shown, truth)) == pytest.approx(0.25 / 0.76)
    assert ours("smape", (0.0 * shown, truth)) == pytest.approx(0.5 / 0.51)
