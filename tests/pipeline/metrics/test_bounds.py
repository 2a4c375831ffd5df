"""Metrics against a deterministic reference, which is off by no more than its bound: what they say holds for
all that it may be.
"""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.scoring.metric import METRICS, Estimate, Reference
from pipeline.scoring.tone import displayed, exposure, shown_noise

SHAPE = (24, 32, 3)
ALL = np.ones(SHAPE[:2], dtype=np.bool_)
MOVING = ["mse", "rmse", "relmse", "relmse-trimmed", "mae", "smape", "psnr"]


def pair(rng: np.random.Generator, share: float) -> tuple[Estimate, Reference]:
    """An estimate of 20 % noise, black in part, and a reference whose bound is this share of the noise."""
    truth = np.linspace(0.0, 2.0, 32)[None, :, None] * np.ones(SHAPE)
    error = 0.2 * truth + 0.01
    estimate = truth + error * rng.standard_normal(SHAPE)
    return Estimate(estimate), Reference(truth, (share * error) ** 2, 0)


def true_references(rng: np.random.Generator, reference: Reference, estimate: Estimate) -> list[np.ndarray]:
    """What the reference may be: as near to the estimate as its bound allows, as far, and anything
    between.
    """
    bound = np.sqrt(reference.variance)
    towards = np.clip(estimate.mean - reference.mean, -bound, bound)
    away = -bound * np.sign(estimate.mean - reference.mean)
    return [reference.mean + shift for shift in (towards, away, bound * rng.uniform(-1, 1, SHAPE))]


@pytest.mark.parametrize("name", MOVING)
@pytest.mark.parametrize("share", [0.1, 0.25])
def test_the_interval_holds_what_it_would_be_against_the_true_reference(name: str, share: float) -> None:
    """Beyond the interval without a bound the ends move by what the bound may do. MAE, SMAPE and the trimmed
    relMSE used to ignore it: with a
    bound of 25 % of the noise, their intervals, of 5 %, hold none of these. The relative ones take their
    weights from the reference as it is, so that of them the truth itself is not asked where it is far from
    it.
    """
    rng = np.random.default_rng(81)
    estimate, reference = pair(rng, share)
    metric = METRICS[name]
    found = metric(estimate, reference).score
    assert not found.bound and found.low is not None and found.high is not None
    exact = metric(estimate, Reference(reference.mean, np.zeros(SHAPE), 0)).score
    assert found.low < exact.low < exact.value == found.value < exact.high < found.high
    for truth in true_references(rng, reference, estimate):
        if name.startswith("relmse"):  # the same weights
            weight = 1.0 / (reference.mean**2 + 0.01)
            scaled = Estimate(estimate.mean * np.sqrt(weight))
            values = (scaled.mean - truth * np.sqrt(weight)) ** 2
            kept = np.sort(values, axis=None)[
                : values.size - (values.size // 1000 if "trimmed" in name else 0)
            ]
            assert found.low <= float(kept.mean()) <= found.high
        elif name == "psnr":  # the same exposure
            shown, other = (displayed(image, exposure(reference.mean)) for image in (estimate.mean, truth))
            assert found.low <= -10 * np.log10(np.mean((shown - other) ** 2)) <= found.high
        else:
            assert (
                found.low <= metric(estimate, Reference(truth, np.zeros(SHAPE), 0)).score.value <= found.high
            )


@pytest.mark.parametrize("name", [*MOVING, "ciede2000"])
def test_an_error_within_the_bound_is_given_as_a_bound(name: str) -> None:
    estimate, reference = pair(np.random.default_rng(82), 1.0)
    found = METRICS[name](estimate, reference).score
    assert found.bound and "below reference noise" in found.note


def test_noise_at_the_display_s_white_is_not_clipped_away() -> None:
    """Upwards nothing shows of it, downwards all of it does."""
    white = Reference(np.ones(SHAPE), np.full(SHAPE, 0.01), 64)
    expected = (displayed(np.ones(SHAPE), 1.0) - displayed(np.full(SHAPE, 0.9), 1.0)).mean() ** 2
    assert shown_noise(white, 1.0, ALL) == pytest.approx(expected)
    assert shown_noise(white, 1.0, ALL) > 1e-3


def test_equal_pictures_have_an_infinite_psnr_and_say_so() -> None:
    """JSON has no infinity: the note tells it from what is undefined."""
    mean = np.full(SHAPE, 0.3)
    found = METRICS["psnr"](Estimate(mean), Reference(mean, np.zeros(SHAPE), 0)).score
    assert found.value == np.inf and "infinite" in found.note
