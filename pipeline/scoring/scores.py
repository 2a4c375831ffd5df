"""Scores of one image against one reference, by every metric or by those named, over the whole image and over
regions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from pipeline.schema.record import RegionScores
from pipeline.scoring.metric import METRICS, Estimate, Mask, Measured, Reference


def score(
    estimate: Estimate, reference: Reference, names: Iterable[str] | None = None
) -> dict[str, Measured]:
    """What each metric says, by its name, in the order given (sorted, if none is given).

    Raises PenumbraError for an unknown name, and where the two images differ in size.
    """
    chosen = METRICS.names() if names is None else list(names)
    return {name: METRICS[name](estimate, reference) for name in chosen}


def score_regions(measured: Mapping[str, Measured], masks: Mapping[str, Mask]) -> dict[str, RegionScores]:
    """What each metric says of each region, by the region's name. masks: (h, w), each with a pixel at
    least.
    """
    return {
        region: RegionScores(
            pixels=int(np.count_nonzero(mask)),
            scores={name: found.over(mask) for name, found in measured.items()},
        )
        for region, mask in masks.items()
    }
