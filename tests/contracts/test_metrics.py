"""What every metric keeps to, a new one included: the registry gives them, no test names them but where a
claim is its own.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from pipeline.scoring.metric import METRICS, Estimate, Image, Mask, Metric, Reference
from pipeline.scoring.scores import score
from scenes.errors import PenumbraError

HEIGHT, WIDTH = 24, 32
NOISE = 1e-3  # standard error of the reference
SPP = 4.0
BLIND = (
    "relmse-simpleimageio",
)  # leaves out what the reference has black, as the program that it matches does
BIBLIOGRAPHY = Path(__file__).parents[2] / "docs" / "references.bib"


def picture() -> Image:
    """A horizontal gradient with a black band (an umbra) and a bright patch (a light in view)."""
    image = np.zeros((HEIGHT, WIDTH, 3))
    image[:, 8:] = np.linspace(0.1, 1.0, WIDTH - 8)[None, :, None] * np.array([1.0, 0.8, 0.6])
    image[2:5, 20:24] = 20.0
    return image


def noisy(image: Image, size: float, seed: int) -> Image:
    """Errors that scale with the value, as a render's do."""
    return image * (1.0 + size * np.random.default_rng(seed).standard_normal(image.shape))


def render(image: Image, size: float, seed: int) -> Estimate:
    """An estimate with all that is known of its samples: the largest stands out by three deviations of one
    sample.
    """
    mean = noisy(image, size, seed)
    deviation = size * image
    largest = np.maximum(mean + 3 * SPP**0.5 * deviation, mean)
    return Estimate(mean, deviation**2, np.full(image.shape[:2], SPP), largest)


def reference(image: Image) -> Reference:
    return Reference(noisy(image, NOISE, 1), (NOISE * image) ** 2, 64)


def exact(image: Image) -> Reference:
    return Reference(image, np.zeros_like(image), 64)


def value_of(metric: Metric, estimate: Estimate, truth: Reference) -> float:
    found = metric(estimate, truth).score
    assert found.value is not None, found.note
    return found.value


@pytest.fixture(params=METRICS.names())
def metric(request: pytest.FixtureRequest) -> Metric:
    return METRICS[request.param]


def test_is_described(metric: Metric) -> None:
    assert METRICS[metric.name] is metric
    assert metric.title and metric.unit and type(metric).__doc__
    assert metric.better in ("lower", "higher", "zero")
    assert metric.judges in ("error", "bias", "samples", "defects")


def test_names_its_source(metric: Metric) -> None:
    """A key in brackets is one of the bibliography's."""
    assert metric.source
    entries = re.findall(r"^@\w+\{([^,\s]+),", BIBLIOGRAPHY.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert set(re.findall(r"\[(\w+)\]", metric.source)) <= set(entries)


def test_value_and_map_have_their_form(metric: Metric) -> None:
    measured = metric(render(picture(), 0.1, 2), reference(picture()))
    assert measured.score.metric == metric.name
    assert measured.score.value is not None and np.isfinite(measured.score.value)
    assert (measured.score.low is None) == (measured.score.high is None)
    if measured.score.low is not None and measured.score.high is not None:
        assert measured.score.low <= measured.score.value <= measured.score.high
    assert measured.map is not None
    assert measured.map.shape == (HEIGHT, WIDTH)
    assert np.isfinite(measured.map).all()


def test_the_whole_image_is_a_region_like_any_other(metric: Metric) -> None:
    measured = metric(render(picture(), 0.1, 2), reference(picture()))
    assert measured.over(np.ones((HEIGHT, WIDTH), dtype=np.bool_)) == measured.score


def halves() -> tuple[Mask, Mask]:
    left = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    left[:, : WIDTH // 2] = True
    return left, ~left


def test_a_region_sees_its_own_pixels_only(metric: Metric) -> None:
    """Errors in the left half change the left half's score and not the right's; SSIM and FLIP look up to 11
    pixels around.
    """
    left, right = halves()
    far = right.copy()
    far[:, : WIDTH // 2 + 12] = False
    clean = render(picture(), 0.1, 2)
    assert clean.variance is not None and clean.maximum is not None
    spoilt = np.where(left[..., None], clean.mean + 5.0, clean.mean)
    if metric.name == "nonfinite":
        spoilt[left] = np.inf
    variance, largest = (np.where(left[..., None], x + 25.0, x) for x in (clean.variance, clean.maximum))
    truth = exact(picture())
    before, after = metric(clean, truth), metric(Estimate(spoilt, variance, clean.count, largest), truth)
    assert before.over(left) != after.over(left) or metric.name in BLIND
    assert before.over(far).value == pytest.approx(after.over(far).value, abs=1e-9)


@pytest.mark.parametrize("sizes", [(0.02, 0.2), (0.2, 0.6)])
def test_more_noise_scores_worse(metric: Metric, sizes: tuple[float, float]) -> None:
    """Catches a `better` that is turned round, and a metric that does not look at the estimate."""
    less, more = (value_of(metric, render(picture(), size, 3), reference(picture())) for size in sizes)
    if metric.judges in ("bias", "defects"):
        assert abs(less) <= 0.1 and abs(more) <= 0.1  # noise is neither
    else:
        assert less < more if metric.better == "lower" else less > more


def test_a_shift_of_everything_scores_worse(metric: Metric) -> None:
    if metric.judges not in ("error", "bias"):
        return
    truth = picture() + 0.1
    plain, shifted = (
        value_of(metric, Estimate(noisy(truth, 0.01, 3) + by), exact(truth)) for by in (0.0, 0.1)
    )
    assert abs(plain) < abs(shifted) if metric.better != "higher" else plain > shifted


def test_a_leak_in_the_umbra_is_seen(metric: Metric) -> None:
    """Catches a metric that leaves out pixels whose reference is 0, as one in use does."""
    clean = render(picture(), 0.01, 4)
    leaking = clean.mean.copy()
    leaking[4:20, 1:6] += 0.2
    before = value_of(metric, clean, reference(picture()))
    after = value_of(
        metric, Estimate(leaking, clean.variance, clean.count, clean.maximum), reference(picture())
    )
    if metric.judges == "samples" or metric.name == "nonfinite":
        return
    if metric.name in BLIND:
        assert before == after
        return
    assert abs(before) < abs(after) if metric.better != "higher" else before > after


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_one_pixel_that_is_no_number_makes_it_undefined(metric: Metric, bad: float) -> None:
    """Catches FLIP's plausible score for pictures with NaN, and a mean over the finite pixels alone."""
    whole = render(picture(), 0.1, 5)
    broken = whole.mean.copy()
    broken[7, 3, 1] = bad
    measured = metric(Estimate(broken, whole.variance, whole.count, whole.maximum), reference(picture()))
    if metric.name == "nonfinite":
        assert measured.score.value == 1
        assert measured.map is not None and measured.map[7, 3] == 1 and measured.map.sum() == 1
    else:
        assert measured.score.value is None
        assert "1 of 768 pixels of the estimate" in measured.score.note
        assert measured.over(halves()[1]).value is None


def test_an_image_alone_is_scored_or_says_what_it_lacks(metric: Metric) -> None:
    found = metric(Estimate(noisy(picture(), 0.1, 2)), reference(picture())).score
    assert found.value is not None or (metric.judges == "samples" and found.note)


def test_a_black_reference_is_survived(metric: Metric) -> None:
    """Catches the exit of the whole process in HDR-FLIP, divisions by 0 and an exposure of infinity."""
    dark = np.zeros((HEIGHT, WIDTH, 3))
    count = np.full((HEIGHT, WIDTH), SPP)
    lit = metric(Estimate(picture(), picture() ** 2, count, picture()), exact(dark)).score
    assert lit.value is None or np.isfinite(lit.value)
    assert lit.value is not None or lit.note
    same = metric(Estimate(dark, dark, count, dark), exact(dark)).score
    assert same.value == {"ssim": 1.0, "psnr": np.inf}.get(metric.name, 0.0)


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 9, 3), (12, 11, 3)])
def test_small_pictures_are_survived(metric: Metric, shape: tuple[int, int, int]) -> None:
    image = np.full(shape, 0.5)
    measured = metric(render(image, 0.2, 6), reference(image))
    assert measured.score.value is not None or measured.score.note
    assert measured.map is None or measured.map.shape == shape[:2]


def test_inputs_are_left_alone_and_answers_repeat(metric: Metric) -> None:
    estimate, truth = render(picture(), 0.1, 7), reference(picture())
    arrays = [estimate.mean, estimate.variance, estimate.maximum, truth.mean, truth.variance]
    before = [array.copy() for array in arrays if array is not None]
    first, second = metric(estimate, truth), metric(estimate, truth)
    assert first.score == second.score
    assert all(np.array_equal(a, b) for a, b in zip(before, arrays, strict=True) if b is not None)


def test_rows_and_columns_are_not_mixed_up(metric: Metric) -> None:
    """An error in one corner shows in that corner of the map."""
    truth = np.full((HEIGHT, WIDTH, 3), 0.5)
    umbra = np.ones((HEIGHT, WIDTH), dtype=np.bool_)
    spoilt = np.zeros_like(truth) if metric.name == "umbra-leak" else truth.copy()
    spoilt[-6:, :6] = np.inf if metric.name == "nonfinite" else 1.9
    estimate = Estimate(spoilt, np.where(spoilt > 1, 0.1, 0.01), np.full((HEIGHT, WIDTH), SPP), spoilt)
    found = metric(estimate, Reference(truth, np.zeros_like(truth), 64, umbra)).map
    assert found is not None
    corner, others = (
        found[-6:, :6].mean(),
        [found[:6, :6].mean(), found[:6, -6:].mean(), found[-6:, -6:].mean()],
    )
    assert corner < min(others) if metric.name == "ssim" else corner > max(others)


def test_images_of_different_sizes_are_the_callers_error(metric: Metric) -> None:
    if metric.name == "nonfinite":
        return  # looks at the estimate alone
    with pytest.raises(PenumbraError, match="32 x 24 against a reference of 24 x 32"):
        metric(render(picture(), 0.1, 2), reference(np.ones((WIDTH, HEIGHT, 3))))


def test_score_gives_all_or_those_named() -> None:
    estimate, truth = render(picture(), 0.1, 8), reference(picture())
    assert list(score(estimate, truth)) == METRICS.names()
    assert list(score(estimate, truth, ["ssim", "mse"])) == ["ssim", "mse"]
    with pytest.raises(PenumbraError, match=r"unknown metric 'nope'; there are: .*relmse"):
        score(estimate, truth, ["nope"])
