"""Scores of one image against one reference, by every metric or by those named."""

from __future__ import annotations

from collections.abc import Iterable

from pipeline.metrics.protocol import METRICS, Estimate, Measured, Reference


def score(estimate: Estimate, reference: Reference, names: Iterable[str] | None = None) -> dict[str, Measured]:
    """What each metric says, by its name, in the order given (sorted, if none is given).

    Raises PenumbraError for an unknown name, and where the two images differ in size.
    """
    chosen = METRICS.names() if names is None else list(names)
    return {name: METRICS[name](estimate, reference) for name in chosen}
