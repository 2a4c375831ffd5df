"""The null test of `verify`: Mitsuba against itself with other seeds must be called biased no more often than
was asked for.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import scenes
from pipeline.references.protocol import BACKENDS, ReferenceImage, ReferenceRequest
from pipeline.schema.record import SampleStatistics
from pipeline.studies.moments import of_reference
from pipeline.studies.verify import Side, Trial, judge, region_masks
from renderer import build

SIZE = {"xresolution": 40.0, "yresolution": 30.0}
OK = SampleStatistics(noise=0.0, max_share=0.0, hill=None, nonfinite=0, verdict="ok", reason="")
RENDERS = 10
ALPHA = 0.2


def side(image: ReferenceImage) -> Side:
    return Side(of_reference(image), OK)


@pytest.mark.slow
@pytest.mark.usefixtures("mitsuba")
def test_mitsuba_against_itself_is_not_called_biased() -> None:
    """45 pairs of 10 renders of 64 batches, at a level of 20 % that is meant to be seen, by image, grid,
    regions and pixels together.

    The pairs share renders, so that the count is not binomial: the bound is that of the ten renders alone, a
    worst case. The rate is below nominal by construction, not by chance (measured: 0 of 45), for three
    reasons, each of which lets alpha stand: image, grid, regions and pixels look at the same differences, and
    Sidak's level for all of them together is exact only if they were independent; the channels of a gray
    scene share their samples and count as three; and the pixels' variances are held up. The median p of the
    image alone is so 0.875 and not 0.5 (measured: 0.91); were the variances half as large as they are it
    would be 0.71. That single comparisons are nominal is shown in test_estimators.py, and that families of
    independent ones are, in test_statistics_welch.py and test_statistics_families.py.
    """
    scene = scenes.load("soft-shadow", SIZE)
    parts = region_masks(build(scene))
    images = [
        BACKENDS["mitsuba"].render(scene, ReferenceRequest(64 * 16, 64, seed)) for seed in range(RENDERS)
    ]
    pairs = [(a, b) for i, a in enumerate(images) for b in images[:i]]
    found = [judge(Trial("mitsuba", alpha=ALPHA), side(a), of_reference(b), parts) for a, b in pairs]
    rate = np.mean([one.verdict == "biased" for one in found])
    p = np.median([one.tests[0].p for one in found])
    print(
        f"called biased: {rate:.3f} of {len(pairs)} pairs at alpha = {ALPHA}; median p of the image "
        f"mean {p:.2f}"
    )
    assert rate <= stats.binom.ppf(0.999, RENDERS, ALPHA) / RENDERS
    assert p > 0.71
