"""Images under test and references from EXR files, with the statistics that the files carry."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.scoring.metric import Estimate, Image, Reference
from scenes.errors import PenumbraError
from scenes.images.exr import read_estimate_exr, read_exr, read_rgb

UNKNOWN_BATCHES = 2  # behind a variance that was given: sampled, from at least so many


def read_estimate(path: Path) -> Estimate:
    """The image under test, with the statistics of its samples if its file has them."""
    if "variance.R" not in read_exr(path).channels:
        return Estimate(read_rgb(path))
    stored = read_estimate_exr(path)
    known = stored.metadata.get("independent") != "False" and bool(np.isfinite(stored.variance).all())
    return Estimate(stored.mean, stored.variance if known else None, stored.count)


def read_reference(path: Path, variance: Path | None = None) -> tuple[Reference, str]:
    """The reference, and in words the origin of its variance."""
    if variance is not None:
        mean = read_rgb(path)
        return Reference(
            mean, _variance(variance, mean), UNKNOWN_BATCHES
        ), f"its variance is taken from {variance}"
    if "variance.R" not in read_exr(path).channels:
        mean = read_rgb(path)
        return Reference(mean, np.zeros_like(mean), 0), "carries no variance, so that it is taken as exact"
    stored = read_estimate_exr(path)
    samples = int(stored.count.min())
    if stored.metadata.get("independent") == "False" or not np.isfinite(stored.variance).all():
        return Reference(
            stored.mean, np.zeros_like(stored.mean), 0
        ), "does not know its variance; taken as exact"
    batches = int(stored.metadata.get("batches", samples))
    known = (
        f"{samples} spp, variance from {batches} batches"
        if batches
        else "deterministic, with a bound on its error"
    )
    return Reference(stored.mean, stored.variance, batches), known


def _variance(path: Path, mean: Image) -> Image:
    """The variance of the mean, from a file of its own; PenumbraError if it does not fit the image."""
    stored = read_estimate_exr(path).variance if "variance.R" in read_exr(path).channels else read_rgb(path)
    if stored.shape != mean.shape:
        sizes = " x ".join(map(str, stored.shape[1::-1])), " x ".join(map(str, mean.shape[1::-1]))
        raise PenumbraError(f"{path}: a variance of {sizes[0]} pixels for a reference of {sizes[1]}")
    if not (stored >= 0).all():
        raise PenumbraError(f"{path}: a variance is negative or not a number")
    return stored
