"""Welch's t-test of whether two noisy images show the same picture, by pixels, regions and the image mean.

Each side brings its mean, the variance of that mean and the degrees of freedom behind the variance, so that a
variance estimated from few batches widens the test instead of raising alarms: a normal test on 8 batches
rejects equal images of 19,200 pixels every time, because the smallest of 57,600 estimated variances is far
too small. The families of comparisons (pixels x channels, regions x channels, channels) are each held to
level `alpha` by Sidak's correction, which is exact for independent comparisons and conservative for
correlated normal ones [sidak1967]; or, where many pixels may each be a little off, by Benjamini and
Hochberg's [benjamini1995], whose test of the whole family is Simes's [simes1986]: nominal for independent
comparisons, and for positively dependent ones at most that.

Rare events. Their means are not normal, and the estimated variance is smallest when the mean is low. A
penumbra pixel with 64 samples and 1 % of shadow (or of light) often shows no event and no variance at all,
and a plain test then rejects a true null with certainty. With K events expected to be L, a plain test at
level a rejects K = 0 unless exp(-L) < a, that is below L = -ln(a): 14 events at the level of one of 57,600
comparisons. Its lower tail stays too heavy up to some z^6/9 = 1,600 events, at which the Edgeworth term
z^3/(3 sqrt(L)) of the studentised mean [hall1992] falls below 1.

So each side's variance is raised to the largest of three estimates: the other side's variance at this side's
number of samples, since under the null both sample the same visibility; the mean over the 3 x 3 pixels
around; and, over wider surroundings, the excess of this side's variance over the other's, for samplers that
meet a light once in a hundred samples. A larger denominator adds no alarm. Its cost in power is in
`smallest_detectable`, which is computed from the same denominators. The mean differences are untouched, so
that no bias is diluted.

This needs sample counts, a noisy other side, and samples that vary alike (`ALIKE`): the other side's variance
tells nothing of an estimator that meets a light once in a thousand samples. Else regions of few events are
tested by the size of samples (few_events.py), and so are all pixels if the other side is exact. If it is not,
the family of pixels is left out, and the regions remain.

Pixels are taken to be independent, as with a box filter. The film's M2 is not the variance of quasi-random
samples: pass replicate scrambles, 16 or more, through `batch_moments`. No test here helps against a heavy
tail: see heavy_tail.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.statistics.few_events import bounded_p, few_events, variance_as_expected
from pipeline.statistics.moments import Draws as Draws
from pipeline.statistics.moments import (
    Moments,
    finite_variances,
    floor_by_excess,
    floor_by_neighbours,
    floor_by_other,
    grid_sums,
    over_grid,
    over_mask,
)
from pipeline.statistics.moments import batch_moments as batch_moments
from pipeline.statistics.numerics import student_survival
from pipeline.statistics.power import smallest_detectable
from scenes.arrays import Array, Mask

Correction = Literal["sidak", "bh"]

ALIKE = 4.0  # times the variance of the other side's samples, beyond which it holds up no pixel's
TILES = 4  # rows and columns of parts of the image in which the two are compared
# Relative. A reference's batch is a running float32 sum: 256 equal samples may each lose half a unit in the
# last place.
ROUNDING = 256 * 2.0**-24


@dataclass(frozen=True, eq=False)
class TestResult:
    """The outcome of one family of comparisons.

    p: corrected p-value of the whole family; `reject` is p < alpha. effect: relative difference (a - b) / b
    of the comparison with the smallest p. smallest_detectable: the smallest relative bias of the whole image
    that this family would have rejected with a probability of 95 %. p_map: (h, w) or (rows, columns), the
    smallest uncorrected p over channels.
    """

    __test__ = False  # not a test case, whatever its name

    name: str
    comparisons: int
    p: float
    effect: float
    smallest_detectable: float
    reject: bool
    p_map: Array | None = None

    def __str__(self) -> str:
        verdict = "differ" if self.reject else "agree"
        promised = np.isfinite(self.smallest_detectable)
        caught = f", smallest bias it would have caught {self.smallest_detectable:.3%}" if promised else ""
        return (
            f"{self.name}: {verdict}, p = {self.p:.3g} over {self.comparisons:,}, "
            f"worst difference {self.effect:+.3%}{caught}"
        )


def compare_images(
    a: Moments,
    b: Moments,
    regions: tuple[int, int] = (4, 4),
    alpha: float = 0.05,
    parts: Mapping[str, Mask] | None = None,
    correction: Correction = "sidak",
) -> list[TestResult]:
    """Test image `a` against reference `b` [welch1947], by families: "image", "regions", `parts`, "pixels".

    Each family is held to level alpha. regions: rows and columns of a grid, no more than pixels. parts: names
    of further regions to masks (h, w), none empty. correction: of the pixels; other families take Sidak's
    [sidak1967]. Pixels are tested if both sides' samples vary alike, or by few_events.py if `b` is exact and
    the draws of `a` are known.

    A pixel that is not finite rejects. Differences up to 1.5e-5 of the value are float32 rounding and do not
    count, nor do those within both sides' bounds. Any larger one rejects if neither side has a variance.
    """
    if a.mean.shape != b.mean.shape:
        raise ValueError(f"images of different shapes: {a.mean.shape} and {b.mean.shape}")
    alike = vary_alike(a, b)
    draws = None if alike else a.draws
    whole = np.ones_like(a.mean)
    few = Few(draws, grid_sums(whole, (1, 1))) if draws else None
    out = [_compare("image", over_grid(a, (1, 1)), over_grid(b, (1, 1)), alpha, few=few)]
    few = Few(draws, grid_sums(whole, regions)) if draws else None
    out.append(_compare("regions", over_grid(a, regions), over_grid(b, regions), alpha, few=few))
    for name, mask in (parts or {}).items():
        few = Few(draws, np.full((1, 1, 3), float(np.count_nonzero(mask)))) if draws else None
        one, other = (over_grid(over_mask(side, mask), (1, 1)) for side in (a, b))
        out.append(_compare(name, one, other, alpha, few=few))
    if alike:
        out.append(
            _compare(
                "pixels",
                floor_by_neighbours(floor_by_excess(a, b)),
                floor_by_neighbours(b),
                alpha,
                correction,
            )
        )
    elif draws and b.exact:
        out.append(_compare("pixels", a, b, alpha, correction, Few(draws, whole, all=True)))
    return out


def vary_alike(a: Moments, b: Moments) -> bool:
    """True if a's samples vary at most ALIKE times as much as b's in every tile, and both counts are known.

    The variance of b's samples is then a floor for that of a's pixels. The image is judged in TILES x TILES
    parts: over the whole of it, the edges of a light in view would hide the variance that one side alone has
    from light met by chance. Light in pixels where the reference is black does not count as chance.
    """
    if a.samples is None or b.samples is None:
        return False
    tiles = (min(TILES, a.mean.shape[0]), min(TILES, a.mean.shape[1]))
    rounding = (ROUNDING * np.where(np.isfinite(b.mean), b.mean, 0.0)) ** 2
    ours, theirs = (grid_sums(v, tiles) for v in finite_variances(a, b))
    return bool(
        np.all(ours * a.samples <= ALIKE * theirs * b.samples + grid_sums(rounding, tiles) * a.samples)
    )


def welch(a: Moments, b: Moments) -> tuple[Array, Array, Array]:
    """Two-sided p, standard error and degrees of freedom [welch1947], each shaped as the means.

    Without any variance p is 1 for equal means and 0 for others. p is 0 for a mean that is not finite.
    """
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        variance = a.variance + b.variance
        dof = variance**2 / (a.variance**2 / a.dof + b.variance**2 / b.dof)
        difference = np.maximum(np.abs(a.mean - b.mean) - allowance(a, b), 0.0)
        statistic = np.where(difference == 0, 0.0, difference / np.sqrt(variance))
    dof = np.where(np.isfinite(dof), dof, np.inf)
    finite = np.isfinite(statistic) & np.isfinite(a.mean) & np.isfinite(b.mean)
    p = 2.0 * student_survival(np.where(finite, statistic, np.inf), dof)
    return p, np.sqrt(variance), dof


def allowance(a: Moments, b: Moments) -> Array:
    """The difference that does not count: float32's rounding of the greater mean, and both bounds."""
    return ROUNDING * np.maximum(np.abs(a.mean), np.abs(b.mean)) + a.slack + b.slack


def sidak(p: float, comparisons: int) -> float:
    """The family's p-value from the smallest of its p-values, 1 - (1 - p)^comparisons [sidak1967]."""
    return float(-np.expm1(comparisons * np.log1p(-p))) if p < 1.0 else 1.0


def sidak_level(alpha: float, comparisons: int) -> float:
    """The level of each comparison that gives the family level alpha: 1 - (1 - alpha)^(1 / comparisons)."""
    return float(-np.expm1(np.log1p(-alpha) / comparisons))


def simes(p: Array) -> float:
    """The family's p-value by Simes [simes1986]: the least of m p_(i) / i.

    It is below the level if Benjamini and Hochberg reject anything.
    """
    ranked = np.sort(p, axis=None)
    return float(min(1.0, np.min(ranked * ranked.size / np.arange(1, ranked.size + 1))))


@dataclass(frozen=True, eq=False)
class Few:
    """Regions that may hold few events: a pixel's draws, and the number of pixels (..., 3) of each region.

    all: whether to test every region by its draws, however many events it holds.
    """

    draws: Draws
    pixels: Array
    all: bool = False


def _compare(
    name: str, a: Moments, b: Moments, alpha: float, correction: Correction = "sidak", few: Few | None = None
) -> TestResult:
    """Test one family: every element of the arrays is a comparison; the last axis is the channel."""
    held_a, held_b = floor_by_other(variance_as_expected(a, b) if few else a, b), floor_by_other(b, a)
    p, error, dof = welch(held_a, held_b)
    slack = allowance(a, b)
    if few:
        chosen = few_events(few.draws, few.pixels, b) | few.all
        # Our own rounding makes no light where there is none.
        rounded = ROUNDING * np.abs(b.mean) + a.slack + b.slack
        p = np.where(chosen, bounded_p(few.draws, few.pixels, a.mean, b, rounded), p)
        error = np.where(chosen, np.inf, error)
    worst = int(np.argmin(p))
    family = sidak(float(p.flat[worst]), p.size) if correction == "sidak" else simes(p)
    level = sidak_level(alpha, p.size) if correction == "sidak" else alpha / p.size
    caught = max(smallest_detectable(b.mean, error, dof, level, slack), ROUNDING)
    effect = _relative(float(a.mean.flat[worst]), float(b.mean.flat[worst]))
    return TestResult(name, p.size, family, effect, caught, family < alpha, np.min(p, axis=-1))


def _relative(value: float, reference: float) -> float:
    """(value - reference) / reference, 0 where both are equal, signed infinity over a reference of 0."""
    if value == reference:
        return 0.0
    return (value - reference) / abs(reference) if reference else float(np.copysign(np.inf, value))
