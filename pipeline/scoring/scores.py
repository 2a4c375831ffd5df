"""Scores of one image against one reference, over the whole image and over regions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from pipeline.schema.record import RegionScores
from pipeline.scoring.metric import METRICS, Estimate, Mask, Measured, Reference


def score(
    estimate: Estimate, reference: Reference, names: Iterable[str] | None = None
) -> dict[str, Measured]:
    """Score an image by the named metrics, in their order, or by all of them; returns their answers by name.

    PenumbraError for an unknown name, and for images of different sizes.
    """
    chosen = METRICS.names() if names is None else list(names)
    return {name: METRICS[name](estimate, reference) for name in chosen}


def score_regions(measured: Mapping[str, Measured], masks: Mapping[str, Mask]) -> dict[str, RegionScores]:
    """The scores of all metrics over each region. masks: (h, w), each with at least one pixel."""
    return {
        region: RegionScores(
            pixels=int(np.count_nonzero(mask)),
            scores={name: found.over(mask) for name, found in measured.items()},
        )
        for region, mask in masks.items()
    }
