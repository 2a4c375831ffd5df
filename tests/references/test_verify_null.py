"""The null test of `verify`: Mitsuba against itself with other seeds must be called biased no more often than was asked for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import scenes
from pipeline.record import SampleStatistics
from pipeline.references.protocol import BACKENDS, ReferenceImage, ReferenceRequest
from pipeline.verify import Side, Trial, judge, moments, region_masks
from renderer import build

SIZE = {"xresolution": 40.0, "yresolution": 30.0}
OK = SampleStatistics(noise=0.0, max_share=0.0, hill=None, nonfinite=0, verdict="ok", reason="")
RENDERS = 10
ALPHA = 0.2


def side(image: ReferenceImage) -> Side:
    return Side(moments(image), OK, image.spp, 1.0)


@pytest.mark.slow
def test_mitsuba_against_itself_is_not_called_biased() -> None:
    """45 pairs of 10 renders of 64 batches, at a level of 20 % that is meant to be seen, by image, grid, regions and pixels together.

    The pairs share renders, so that the count is not binomial: the bound is that of the ten renders alone, a worst case. The channels of a
    gray scene share their samples, and Sidak counts them as three, so that the rate is below nominal (measured: 0 of 45) and the image's median p
    is 0.875 and not 0.5 (measured: 0.91); were the variances half as large as they are it would be 0.71. That single comparisons
    are nominal is shown in test_estimators.py.
    """
    scene = scenes.load("soft-shadow", SIZE)
    parts = region_masks(build(scene))
    images = [BACKENDS["mitsuba"].render(scene, ReferenceRequest(64 * 16, 64, seed)) for seed in range(RENDERS)]
    pairs = [(a, b) for i, a in enumerate(images) for b in images[:i]]
    found = [judge(Trial("mitsuba", alpha=ALPHA), side(a), moments(b), parts) for a, b in pairs]
    rate = np.mean([one.verdict == "biased" for one in found])
    p = np.median([one.tests[0].p for one in found])
    print(f"called biased: {rate:.3f} of {len(pairs)} pairs at alpha = {ALPHA}; median p of the image mean {p:.2f}")
    assert rate <= stats.binom.ppf(0.999, RENDERS, ALPHA) / RENDERS
    assert p > 0.71
