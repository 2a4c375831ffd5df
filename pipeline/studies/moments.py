"""Moments of a reference, of a render and of replicates, as the two sides of a test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.references.protocol import ReferenceImage
from pipeline.statistics.moments import Draws, Moments, batch_moments
from renderer import RenderResult
from scenes.arrays import Array

FLOAT32 = 1e-6  # of the image mean: rounding of a float32 renderer where the truth is 0 (Mitsuba: 1e-8)


def of_reference(image: ReferenceImage) -> Moments:
    """The moments of a reference.

    A deterministic one has an error bound and no variance; a sampled one has FLOAT32 as its bound.
    """
    if image.batches == 0:
        return Moments(image.mean, np.zeros_like(image.mean), np.inf, bound=np.sqrt(image.variance))
    bound = np.full_like(image.mean, FLOAT32 * float(np.abs(image.mean).mean()))
    return Moments(image.mean, image.variance, image.batches - 1, image.spp, bound)


def of_render(result: RenderResult, spp: int) -> Moments:
    """The moments of a render of independent samples, `spp` a pixel, 2 or more.

    Its largest draw is the largest reflected sample or, in pixels that see a light, the least possible
    maximum: samples of mean m and variance v cannot all be below m + v / m. A pixel below 0 proves that there
    are negative samples. Their range is taken to be symmetric: none is farther from its pixel's mean than the
    root of the sum of squared deviations.
    """
    film = result.film
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(film.mean > 0, film.mean + film.m2 / (spp * film.mean), 0.0)
        far = np.where(film.mean < 0, np.abs(film.mean) + np.sqrt(film.m2), 0.0)
    largest, signed = _most(np.maximum(film.maximum, needed)), _most(far)
    if np.any(signed > 0):
        widest = np.maximum(largest, _most(np.abs(film.mean) + np.sqrt(film.m2)))
        draws = Draws(spp, -widest, widest)
    else:
        draws = Draws(spp, np.zeros(3), largest)
    return Moments(result.image, result.variance, spp - 1, samples=spp, draws=draws)


def of_replicates(images: Array) -> Moments:
    """The moments of replicates (r, h, w, 3); each is one draw, as its samples are not independent."""
    least = np.minimum(np.min(images, axis=(0, 1, 2)), 0.0)
    draws = Draws(images.shape[0], least, np.max(images, axis=(0, 1, 2)))
    return replace(batch_moments(images), draws=draws)


def _most(image: Array) -> Array:
    """The largest finite value (3,) of an image (h, w, 3) by channel; at least 0."""
    return np.max(np.where(np.isfinite(image), image, 0.0), axis=(0, 1), initial=0.0)
