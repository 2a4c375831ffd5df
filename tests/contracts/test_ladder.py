"""The contact ladder: bounded estimators hold on every rung, unbounded ones are never believed where they are
wrong.
"""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.studies.ladder import LIGHTS, RUNGS, Rung, climb
from renderer.interfaces.estimator import ESTIMATORS, RADIANCE
from scenes.errors import PenumbraError

SAMPLES = 2**15
# The two that need an environment have no rung here: the test of refusals holds that.
NEEDS_ENVIRONMENT = {"environment", "mis-compensated"}
ON_LADDER = {
    name: e for name, e in ESTIMATORS.items() if e.quantity == RADIANCE and name not in NEEDS_ENVIRONMENT
}
CLOSED = {name for name, e in ON_LADDER.items() if e.closed_form}
BOUNDED = {name for name, e in ON_LADDER.items() if e.bounded and not e.closed_form}
UNBOUNDED = {name for name, e in ON_LADDER.items() if not e.bounded}


@pytest.fixture(scope="module")
def ladder(statistical: None) -> list[Rung]:
    return list(climb(samples=SAMPLES))


def within(r: Rung) -> bool:
    """4.5 standard errors, and what a miss too rare to be seen in so many samples may hide: 12 / N at
    6e-6.
    """
    return abs(r.mean - r.truth) < 4.5 * r.se + 12 / SAMPLES * r.truth


def test_bounded_estimators_are_right_and_believed_on_every_rung(ladder):
    """468 rungs: a bias of 3 % on any, or of 0.5 % on a technique as a whole, would show."""
    rungs = [r for r in ladder if r.estimator in BOUNDED and r.verdict != "refused"]
    assert {r.h for r in rungs} == set(RUNGS) and len(rungs) == (4 * len(BOUNDED) - 2) * 2 * 9
    for r in rungs:
        assert r.verdict == "ok" and r.nonfinite == 0, r
        assert within(r), r
        assert r.se < 0.15 * r.truth, r
    for name in BOUNDED:
        own = [r for r in rungs if r.estimator == name]
        assert abs(np.mean([r.mean / r.truth - 1 for r in own])) < 0.03


def test_area_sampling_is_never_believed_where_it_is_wrong(ladder):
    assert {"area"} == UNBOUNDED
    area = [r for r in ladder if r.estimator in UNBOUNDED]
    for r in area:
        assert within(r) or r.verdict == "untrustworthy", r
    near = [r for r in area if r.h <= 1e-2]
    assert all(r.verdict == "untrustworthy" for r in near)
    assert all(r.mean < 0.1 * r.truth for r in near if r.h <= 1e-5), (
        "area sampling has become better than it can be"
    )
    assert all(r.verdict == "ok" for r in area if r.h == 1)


def test_closed_forms_are_the_truth_on_every_rung(ladder):
    """Nothing is in the way, so that both forms are their closed form: two derivations of one irradiance, to
    1e-9.
    """
    rungs = [r for r in ladder if r.estimator in CLOSED]
    assert len(rungs) == 4 * len(CLOSED) * 2 * 9
    for r in rungs:
        assert r.verdict == "ok" and abs(r.mean / r.truth - 1) < 1e-9, r


def test_the_cosine_is_sampled_without_noise(ladder):
    """Projected solid angle samples a diffuse floor exactly: each sample is the truth, to the rounding of a
    root search.
    """
    for r in ladder:
        if r.estimator == "projected-solid-angle" and r.verdict == "ok":
            assert abs(r.mean / r.truth - 1) < 1e-6 and r.se < 1e-6 * r.truth, r


def test_what_does_not_apply_is_refused_in_words(ladder):
    refused = [r for r in ladder if r.verdict == "refused"]
    round_ones = {(light, "projected-solid-angle") for light in ("disk", "sphere")}
    nothing_around = {(light, e) for light in LIGHTS for e in NEEDS_ENVIRONMENT}
    assert {(r.light, r.estimator) for r in refused} == round_ones | nothing_around
    assert all("only polygons" in r.reason or "no environment" in r.reason for r in refused)


def test_wrong_use_is_told(ladder):
    with pytest.raises(PenumbraError, match="no ladder for light 'cube'"):
        list(climb(["cube"]))
    with pytest.raises(PenumbraError, match="at least 100"):
        list(climb(samples=10))
