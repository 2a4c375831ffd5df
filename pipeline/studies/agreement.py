"""Tests whether all estimators show the same picture, by pairs and against a reference.

Estimators that share an idea may share a mistake, and Mitsuba may have no reference: a matrix of independent
techniques that agree is the stronger evidence. Only estimators that claim to be unbiased are compared; an
image whose own samples declare it untrustworthy is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from pipeline.progress import Update
from pipeline.references.protocol import ReferenceImage
from pipeline.run.job import statistics
from pipeline.statistics.numerics import normal_tail
from pipeline.statistics.welch import Moments, TestResult, compare_images, sidak_level, vary_alike
from pipeline.studies.moments import of_reference, of_render
from renderer import build, render
from renderer.build import RenderScene
from renderer.interfaces.estimator import ESTIMATORS, RADIANCE
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError

GRID = 4  # rows and columns at most
LEAST_SPP = 16  # below, the spread of a pixel's samples says too little of their variance


class _Row(BaseModel):
    model_config = ConfigDict(frozen=True, ser_json_inf_nan="null")


class Member(_Row):
    """One estimator's image. mean, se: of the mean over pixels and channels.

    verdict: "refused" if the estimator does not apply.
    """

    name: str
    verdict: Literal["ok", "untrustworthy", "refused"]
    reason: str
    mean: float = float("nan")
    se: float = float("nan")
    seconds: float = float("nan")


class Pair(_Row):
    """Two images compared. difference: (a - b) / b of the image means, with its 95 % interval.

    p: the smaller p-value of the image mean and of the regions. where: the image or the region that has it.
    smallest_detectable: the smallest relative bias of the image mean that the test would have caught.
    """

    a: str
    b: str
    difference: float
    low: float
    high: float
    p: float
    where: str
    smallest_detectable: float
    agree: bool


class Agreement(_Row):
    """All pairs of a scene. agree: no pair differs at level `alpha` for the whole matrix."""

    scene: str
    spp: int
    alpha: float
    reference: str | None
    members: list[Member]
    pairs: list[Pair]
    agree: bool


@dataclass(frozen=True, eq=False)
class Candidate:
    """An image to be compared. by_chance: its samples meet lights by chance."""

    name: str
    moments: Moments
    by_chance: bool = False
    reference: bool = False


def agreement(
    scene: SceneDescription,
    *,
    estimators: Sequence[str] | None = None,
    spp: int = 64,
    seed: int = 0,
    alpha: float = 0.01,
    threads: int = 1,
    reference: tuple[str, ReferenceImage] | None = None,
    update: Update | None = None,
) -> Agreement:
    """Render a scene with the named estimators, or all unbiased ones that apply, and compare all pairs.

    alpha: chance of a false alarm anywhere in the matrix, by Sidak. reference: a backend's name and its
    image, which is compared too. PenumbraError for spp < 16, for unknown names, and for fewer than two
    images.
    """
    if spp < LEAST_SPP:
        raise PenumbraError(
            f"spp is {spp}: at least {LEAST_SPP} are needed to judge the spread of a pixel's samples"
        )
    built = build(scene)
    names = comparable(estimators)
    members: list[Member] = []
    candidates: list[Candidate] = []
    for i, name in enumerate(names):
        member, candidate = _render(built, name, spp, seed + i, threads)
        members.append(member)
        candidates += [candidate] if candidate is not None else []
        if update:
            update(i + 1)
    if reference is not None:
        label, image = reference
        candidates.append(Candidate(label, of_reference(image), reference=True))
    if len(candidates) < 2:
        raise PenumbraError(f"scene {scene.name!r}: fewer than two images are left to compare")
    level = sidak_level(alpha, len(candidates) * (len(candidates) - 1))  # two families a pair
    pairs = [_pair(a, b, level) for a, b in combinations(candidates, 2)]
    return Agreement(
        scene=scene.name,
        spp=spp,
        alpha=alpha,
        reference=reference[0] if reference else None,
        members=members,
        pairs=pairs,
        agree=all(p.agree for p in pairs),
    )


def comparable(estimators: Sequence[str] | None = None) -> list[str]:
    """All estimators that claim unbiased radiance, or those named. PenumbraError for one that makes no such
    claim or is named twice.
    """
    if estimators is None:
        return [name for name in ESTIMATORS.names() if _comparable(name, named=False)]
    if twice := [name for i, name in enumerate(estimators) if name in estimators[:i]]:
        raise PenumbraError(f"estimator {twice[0]!r} is given more than once: name each once")
    return [name for name in estimators if _comparable(name, named=True)]


def _comparable(name: str, named: bool) -> bool:
    """True if an estimator claims to be unbiased; PenumbraError for one that was named and does not."""
    estimator = ESTIMATORS[name]
    why = estimator.bias or (None if estimator.quantity == RADIANCE else "its quantity is another")
    if named and why:
        raise PenumbraError(f"estimator {name!r} cannot be compared: {why}")
    return why is None


def _render(
    built: RenderScene, name: str, spp: int, seed: int, threads: int
) -> tuple[Member, Candidate | None]:
    """Render one estimator. Seeds differ, as estimators that share directions would share their noise."""
    if why := ESTIMATORS[name].refuses(built.description):
        return Member(name=name, verdict="refused", reason=why), None
    result = render(built, estimator=name, spp=spp, seed=seed, threads=threads)
    found = statistics(result)
    member = Member(
        name=name,
        verdict=found.verdict,
        reason=found.reason,
        mean=float(result.image.mean()),
        se=_standard_error(result.variance),
        seconds=result.seconds.cpu,
    )
    return member, Candidate(
        name, of_render(result, spp), ESTIMATORS[name].meets_lights_by_chance
    ) if found.verdict == "ok" else None


def _standard_error(variance: NDArray[np.float64]) -> float:
    """Standard error of the mean over pixels and fully correlated channels. variance: (h, w, 3)."""
    deviation = np.sqrt(variance).mean(axis=2)
    return float(np.sqrt((deviation * deviation).sum()) / deviation.size)


def _pair(a: Candidate, b: Candidate, level: float) -> Pair:
    families = _families(a, b, level)
    image, least = families[0], min(families, key=lambda family: family.p)
    ours, theirs = float(a.moments.mean.mean()), float(b.moments.mean.mean())
    error = np.hypot(_standard_error(a.moments.variance), _standard_error(b.moments.variance))
    reach = normal_tail(0.025) * float(error)  # sums over thousands of pixels: normal
    scale = abs(theirs) if theirs else float("nan")
    return Pair(
        a=a.name,
        b=b.name,
        difference=(ours - theirs) / scale,
        low=(ours - theirs - reach) / scale,
        high=(ours - theirs + reach) / scale,
        p=least.p,
        where=_where(least),
        smallest_detectable=image.smallest_detectable,
        agree=not any(family.reject for family in families),
    )


def _families(a: Candidate, b: Candidate, level: float) -> list[TestResult]:
    """The tests of the image mean and of the regions, or of the mean alone.

    A region's few events have no floor for their variance where one of two estimators finds light by chance
    or varies far more than the other. A reference knows the light of each region: against it, few events have
    a test of their own (few_events.py).
    """
    height, width = a.moments.mean.shape[:2]
    families = compare_images(a.moments, b.moments, (min(GRID, height), min(GRID, width)), level)[:2]
    alike = vary_alike(a.moments, b.moments) and vary_alike(b.moments, a.moments)
    return families if b.reference or (alike and not (a.by_chance or b.by_chance)) else families[:1]


def _where(test: TestResult) -> str:
    """The image, or the region of the grid with the smallest p, counted from the top left."""
    if test.p_map is None or test.p_map.size == 1:
        return test.name
    rows, columns = test.p_map.shape
    row, column = divmod(int(np.argmin(test.p_map)), columns)
    return f"row {row + 1} of {rows}, column {column + 1} of {columns}"
