"""The ratio form of `analytic-visibility`: consistent, with an honest variance, and free of noise where
nothing is in the way.
"""

from __future__ import annotations

import numpy as np
import pytest

from renderer.render import render
from scenes.description.shapes import Disk
from tests.kit.scenes import box, floor, light, scene

DOWN = np.array([0.0, -1.0, 0.0])
LAMP = light(Disk(np.array([0.0, 3.0, 0.0]), DOWN, 0.8))
SHADOWED = scene(
    [floor(), box([0.0, 0.8, 0.0], 0.3), LAMP],
    eye=(0.3, 2.0, -4.0),
    target=(0.3, 0.2, 0.0),
    width=16,
    height=12,
)


def test_it_is_free_of_noise_where_nothing_is_in_the_way():
    """What is left is where in a pixel the closed form was asked: the same camera rays give the same image,
    whatever the light samples.
    """
    open_floor = scene([floor(), LAMP], eye=(0.3, 2.0, -4.0), target=(0.3, 0.2, 0.0), width=16, height=12)
    ratio, control = (
        render(open_floor, estimator=f"analytic-visibility{form}", spp=4).image for form in ("", "-unbiased")
    )
    np.testing.assert_allclose(ratio, control, rtol=1e-12)
    plain = render(open_floor, estimator="area", spp=4096)
    assert np.abs(ratio.mean() / plain.image.mean() - 1) < 5e-3


@pytest.mark.usefixtures("statistical")
def test_its_mean_comes_to_the_truth_and_its_variance_is_what_is_seen():
    """At 256 spp the ratio's bias of O(1/spp) is below its error: 32 replicates agree with 16 k samples of
    solid-angle to 4
    standard errors in the mean image, and spread as the film says, to 10 %."""
    runs = [render(SHADOWED, estimator="analytic-visibility", spp=256, seed=k) for k in range(32)]
    images = np.stack([r.image for r in runs])
    truth = render(SHADOWED, estimator="solid-angle", spp=16_384, seed=99)
    mean = images.mean(axis=(1, 2, 3))
    error = np.hypot(
        mean.std(ddof=1) / np.sqrt(32), np.sqrt(truth.variance.sum()) / truth.variance.size * np.sqrt(3)
    )
    assert abs(mean.mean() - truth.image.mean()) < 4 * error
    shadow = truth.image[..., 0] < 0.9 * np.median(
        truth.image[..., 0]
    )  # where there is visibility to be noisy
    seen = images.var(axis=0, ddof=1)[shadow].mean()
    said = np.stack([r.variance for r in runs]).mean(axis=0)[shadow].mean()
    assert abs(said / seen - 1) < 0.1, (said, seen)


@pytest.mark.usefixtures("statistical")
def test_at_few_samples_it_is_biased_and_the_control_variate_is_not():
    """One sample a pixel makes the ratio V itself: the closed form times a share that ignores where the light
    is brightest.
    """

    def mean(form: str) -> tuple[float, float]:
        means = [
            render(SHADOWED, estimator=f"analytic-visibility{form}", spp=1, seed=k).image.mean()
            for k in range(200)
        ]
        return float(np.mean(means)), float(np.std(means, ddof=1) / np.sqrt(200))

    truth = render(SHADOWED, estimator="solid-angle", spp=4096, seed=99).image.mean()
    control, se = mean("-unbiased")
    assert abs(control - truth) < 4 * se


def test_bits_do_not_depend_on_how_the_work_is_cut():
    whole = render(SHADOWED, estimator="analytic-visibility", spp=40)
    cut = render(SHADOWED, estimator="analytic-visibility", spp=40, threads=2, rows=100)
    np.testing.assert_array_equal(whole.image, cut.image)
    np.testing.assert_array_equal(whole.variance, cut.variance)
