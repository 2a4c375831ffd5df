"""Do all estimators show the same picture? Every pair of them, and each against a reference, with intervals.

Estimators that share an idea may share a mistake, and a reference of Mitsuba's may not exist: a matrix of independent techniques
that agree is the stronger evidence. What claims to be unbiased is compared; what its own samples say is not to be believed is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from pipeline.job import statistics
from pipeline.progress import Update
from pipeline.references.protocol import ReferenceImage
from pipeline.statistics.numerics import normal_tail
from pipeline.statistics.welch import Moments, compare_images, sidak_level, vary_alike
from renderer import RenderResult, build, render
from renderer.build import RenderScene
from renderer.estimators.direction_sampling import DirectionSampling
from renderer.estimators.protocol import ESTIMATORS, RADIANCE
from scenes.description import SceneDescription
from scenes.errors import PenumbraError

FLOAT32 = 1e-6  # of the image mean: a few units in the last place of the sums that a float32 renderer makes
LEAST_SPP = 16  # below, the spread of a pixel's samples says too little of their variance


class _Row(BaseModel):
    model_config = ConfigDict(frozen=True, ser_json_inf_nan="strings")


class Member(_Row):
    """One estimator's image. mean, se: of the image's luminance-free mean over pixels and channels. verdict: "refused" if it does not apply."""

    name: str
    verdict: Literal["ok", "untrustworthy", "refused"]
    reason: str
    mean: float = float("nan")
    se: float = float("nan")
    seconds: float = float("nan")


class Pair(_Row):
    """Two that were compared. difference: (a - b) / b of the image means, with its 95 % interval. p: of the image mean and of a
    grid of regions together. smallest_detectable: the smallest relative bias of the image mean that would have been seen."""

    a: str
    b: str
    difference: float
    low: float
    high: float
    p: float
    smallest_detectable: float
    agree: bool


class Agreement(_Row):
    """All of a scene. agree: whether no pair differs at `alpha` for the whole matrix."""

    scene: str
    spp: int
    alpha: float
    reference: str | None
    members: list[Member]
    pairs: list[Pair]
    agree: bool


@dataclass(frozen=True, eq=False)
class Candidate:
    """An image to be compared: its name and its moments. by_chance: whether its samples met lights by chance."""

    name: str
    moments: Moments
    by_chance: bool = False


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
    """Render a scene with every unbiased estimator that applies (or those named) and compare all pairs.

    reference: a backend's name and image, which joins them. alpha: chance of a false alarm anywhere in the matrix, Sidak.
    Raises PenumbraError for spp < 16, for unknown names, and where fewer than two are left to compare.
    """
    if spp < LEAST_SPP:
        raise PenumbraError(f"spp is {spp}: at least {LEAST_SPP} are needed to judge the spread of a pixel's samples")
    built = build(scene)
    names = [n for n in estimators or ESTIMATORS.names() if _comparable(n, named=estimators is not None)]
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
        candidates.append(Candidate(label, _of_reference(image)))
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


def _comparable(name: str, named: bool) -> bool:
    """Whether an estimator claims to be unbiased in the light; one that was asked for by name and does not is an error."""
    estimator = ESTIMATORS[name]
    why = estimator.bias or (None if estimator.quantity == RADIANCE else "its quantity is another")
    if named and why:
        raise PenumbraError(f"estimator {name!r} cannot be compared: {why}")
    return why is None


def _render(built: RenderScene, name: str, spp: int, seed: int, threads: int) -> tuple[Member, Candidate | None]:
    """Seeds differ between estimators: those that share directions would else share their noise."""
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
        name, _moments(result, spp), isinstance(ESTIMATORS[name], DirectionSampling)
    ) if found.verdict == "ok" else None


def _moments(result: RenderResult, spp: int) -> Moments:
    return Moments(result.image, result.variance, spp - 1, samples=spp)


def _of_reference(image: ReferenceImage) -> Moments:
    """A reference's moments; an exact one has no samples. What float32 may have left where the truth is 0 counts as noise."""
    dust = FLOAT32 * float(np.abs(image.mean).mean())
    samples = image.spp or None
    return Moments(image.mean, image.variance + dust * dust, image.batches - 1 if samples else np.inf, samples)


def _standard_error(variance: NDArray[np.float64]) -> float:
    """Of the mean over pixels and channels. variance: (h, w, 3). The channels of a pixel share their samples: taken to go together."""
    deviation = np.sqrt(variance).mean(axis=2)
    return float(np.sqrt((deviation * deviation).sum()) / deviation.size)


def _pair(a: Candidate, b: Candidate, level: float) -> Pair:
    families = compare_images(a.moments, b.moments, alpha=level)[:2]
    # Where one side finds light by chance, a region's few finds are far from normal, or none, and beside an exact image nothing
    # tells how they would vary: only the image is tested.
    alike = vary_alike(a.moments, b.moments) and vary_alike(b.moments, a.moments)
    families = families if alike and not (a.by_chance or b.by_chance) else families[:1]
    image = families[0]
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
        p=min(family.p for family in families),
        smallest_detectable=image.smallest_detectable,
        agree=not any(family.reject for family in families),
    )
