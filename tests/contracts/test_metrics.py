"""What every metric keeps to, a new one included: the registry gives them, no test names them."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.metrics.protocol import METRICS, Estimate, Image, Metric, Reference
from pipeline.scoring import score
from scenes.errors import PenumbraError

HEIGHT, WIDTH = 24, 32
NOISE = 1e-3  # standard error of the reference


def picture() -> Image:
    """A horizontal gradient with a black band (an umbra) and a bright patch (a light in view)."""
    image = np.zeros((HEIGHT, WIDTH, 3))
    image[:, 8:] = np.linspace(0.1, 1.0, WIDTH - 8)[None, :, None] * np.array([1.0, 0.8, 0.6])
    image[2:5, 20:24] = 20.0
    return image


def noisy(image: Image, size: float, seed: int) -> Image:
    """Errors that scale with the value, as a render's do."""
    return image * (1.0 + size * np.random.default_rng(seed).standard_normal(image.shape))


def reference(image: Image) -> Reference:
    return Reference(noisy(image, NOISE, 1), (NOISE * image) ** 2, 64)


@pytest.fixture(params=METRICS.names())
def metric(request: pytest.FixtureRequest) -> Metric:
    return METRICS[request.param]


def test_is_described(metric: Metric) -> None:
    assert METRICS[metric.name] is metric
    assert metric.title and metric.unit and type(metric).__doc__
    assert metric.better in ("lower", "higher")


def test_value_and_map_have_their_form(metric: Metric) -> None:
    measured = metric(Estimate(noisy(picture(), 0.1, 2)), reference(picture()))
    assert measured.score.metric == metric.name
    assert measured.score.value is not None and np.isfinite(measured.score.value)
    assert (measured.score.low is None) == (measured.score.high is None)
    if measured.score.low is not None and measured.score.high is not None:
        assert measured.score.low <= measured.score.value <= measured.score.high
    assert measured.map is not None
    assert measured.map.shape == (HEIGHT, WIDTH)
    assert np.isfinite(measured.map).all()


@pytest.mark.parametrize("sizes", [(0.02, 0.2), (0.2, 0.6)])
def test_more_noise_scores_worse(metric: Metric, sizes: tuple[float, float]) -> None:
    """Catches a `better` that is turned round, and a metric that does not look at the estimate."""
    less, more = (metric(Estimate(noisy(picture(), size, 3)), reference(picture())).score.value for size in sizes)
    assert less is not None and more is not None
    if metric.name == "nonfinite":
        assert less == more == 0
    else:
        assert less < more if metric.better == "lower" else less > more


def test_a_leak_in_the_umbra_is_seen(metric: Metric) -> None:
    """Catches a metric that leaves out pixels whose reference is 0, as one in use does."""
    leaking = noisy(picture(), 0.01, 4)
    clean = metric(Estimate(leaking.copy()), reference(picture())).score.value
    leaking[4:20, 1:6] += 0.2
    leaked = metric(Estimate(leaking), reference(picture())).score.value
    assert clean is not None and leaked is not None
    if metric.name != "nonfinite":
        assert clean < leaked if metric.better == "lower" else clean > leaked


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_one_pixel_that_is_no_number_makes_it_undefined(metric: Metric, bad: float) -> None:
    """Catches FLIP's plausible score for pictures with NaN, and a mean over the finite pixels alone."""
    broken = noisy(picture(), 0.1, 5)
    broken[7, 3, 1] = bad
    measured = metric(Estimate(broken), reference(picture()))
    if metric.name == "nonfinite":
        assert measured.score.value == 1
        assert measured.map is not None and measured.map[7, 3] == 1 and measured.map.sum() == 1
    else:
        assert measured.score.value is None
        assert "1 of 768 pixels of the estimate" in measured.score.note


def test_a_black_reference_is_survived(metric: Metric) -> None:
    """Catches the exit of the whole process in HDR-FLIP, divisions by 0 and an exposure of infinity."""
    black = Reference(np.zeros((HEIGHT, WIDTH, 3)), np.zeros((HEIGHT, WIDTH, 3)), 64)
    lit = metric(Estimate(picture()), black).score
    assert lit.value is None or np.isfinite(lit.value)
    assert lit.value is not None or lit.note
    same = metric(Estimate(np.zeros((HEIGHT, WIDTH, 3))), black).score
    perfect = {"ssim": 1.0, "psnr": np.inf}
    assert same.value == perfect.get(metric.name, 0.0)


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 9, 3), (12, 11, 3)])
def test_small_pictures_are_survived(metric: Metric, shape: tuple[int, int, int]) -> None:
    image = np.full(shape, 0.5)
    measured = metric(Estimate(noisy(image, 0.2, 6)), reference(image))
    assert measured.score.value is not None or measured.score.note
    assert measured.map is None or measured.map.shape == shape[:2]


def test_inputs_are_left_alone_and_answers_repeat(metric: Metric) -> None:
    estimate, truth = Estimate(noisy(picture(), 0.1, 7)), reference(picture())
    before = estimate.mean.copy(), truth.mean.copy(), truth.variance.copy()
    first, second = metric(estimate, truth), metric(estimate, truth)
    assert first.score == second.score
    assert all(np.array_equal(a, b) for a, b in zip(before, (estimate.mean, truth.mean, truth.variance), strict=True))


def test_rows_and_columns_are_not_mixed_up(metric: Metric) -> None:
    """An error in one corner shows in that corner of the map."""
    truth = np.full((HEIGHT, WIDTH, 3), 0.5)
    spoilt = truth.copy()
    spoilt[-6:, :6] = np.inf if metric.name == "nonfinite" else 0.9
    found = metric(Estimate(spoilt), Reference(truth, np.zeros_like(truth), 64)).map
    assert found is not None
    corner, others = found[-6:, :6].mean(), [found[:6, :6].mean(), found[:6, -6:].mean(), found[-6:, -6:].mean()]
    assert corner < min(others) if metric.name == "ssim" else corner > max(others)


def test_images_of_different_sizes_are_the_callers_error(metric: Metric) -> None:
    if metric.name == "nonfinite":
        return  # looks at the estimate alone
    with pytest.raises(PenumbraError, match="32 x 24 against a reference of 24 x 32"):
        metric(Estimate(picture()), reference(np.ones((WIDTH, HEIGHT, 3))))


def test_score_gives_all_or_those_named() -> None:
    estimate, truth = Estimate(noisy(picture(), 0.1, 8)), reference(picture())
    assert list(score(estimate, truth)) == METRICS.names()
    assert list(score(estimate, truth, ["ssim", "mse"])) == ["ssim", "mse"]
    with pytest.raises(PenumbraError, match=r"unknown metric 'mae'; there are: .*relmse"):
        score(estimate, truth, ["mae"])
