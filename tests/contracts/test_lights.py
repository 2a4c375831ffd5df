"""Every technique of every kind of light: samples follow the pdf, the pdf covers the light, rows stand
alone.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from renderer.interfaces.light import LIGHTS, DirectionSampler, LightExample
from renderer.math.vectors import dot, frame_about, normalize
from scenes.description.shapes import ShapeDescription

CASES = [
    pytest.param(kind, technique, example, id=f"{name}-{technique}-{example.name}")
    for name, kind in LIGHTS.items()
    for example in kind.examples()
    for technique in kind.make([example.source], [0]).techniques
]
# A light of one direction has no density to test; what has no surface has no points of its own.
SPREAD = [case for case in CASES if not case.values[0].delta]
SURFACES = [case for case in SPREAD if isinstance(case.values[2].source, ShapeDescription)]
SAMPLES = 100_000
BINS = 8


def sampler_of(kind, technique: str, example: LightExample) -> DirectionSampler:
    return kind.make([example.source], [0]).techniques[technique]


def draw(sampler: DirectionSampler, p: np.ndarray, n: np.ndarray, count: int, seed: int):
    u = np.random.default_rng(seed).random((2, count))
    at = np.zeros(count, dtype=np.int64)
    return sampler.sample_direction(at, np.repeat(p[:, None], count, 1), np.repeat(n[:, None], count, 1), u)


@pytest.mark.parametrize(("kind", "technique", "example"), SPREAD)
def test_the_sampled_pdf_is_the_pdf_asked_for(kind, technique, example):
    """Catches a pdf that differs between the two routines by more than 1e-6: a wrong Jacobian, a forgotten
    area.
    """
    sampler = sampler_of(kind, technique, example)
    for j in range(example.ref_p.shape[1]):
        p, n = example.ref_p[:, j], example.ref_n[:, j]
        s = draw(sampler, p, n, 2000, j)
        assert s.valid.mean() > 0.1
        rows = np.flatnonzero(s.valid)
        rp, rn = (np.repeat(v[:, None], rows.size, 1) for v in (p, n))
        asked = sampler.pdf_direction(np.zeros(rows.size, dtype=np.int64), rp, rn, s.wi[:, rows])
        # A direction to the very rim may miss by rounding; anything but a handful is an error of the formula.
        hit = asked > 0
        assert hit.mean() > 0.99
        np.testing.assert_allclose(asked[hit], s.pdf[rows][hit], rtol=1e-6)


@pytest.mark.parametrize("samples", [SAMPLES, pytest.param(10 * SAMPLES, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("kind", "technique", "example"), SPREAD)
@pytest.mark.usefixtures("statistical")
def test_sampled_directions_follow_the_pdf(kind, technique, example, samples):
    """Chi-square on a grid of quantiles, against the pdf integrated by uniform directions in a cone.

    Sidak over all points of all cases at 0.1 %. With 1e5 samples in about 50 bins it catches a density off by
    some 3 % in a bin, with 1e6 of the slow tier 1 %. Bins count where the quadrature is worth 25 equal
    weights: below that its own variance is unknown.
    """
    sampler = sampler_of(kind, technique, example)
    level = 1 - 0.999 ** (1 / sum(case.values[2].ref_p.shape[1] for case in SPREAD))
    for j in range(example.ref_p.shape[1]):
        p, n = example.ref_p[:, j], example.ref_n[:, j]
        s = draw(sampler, p, n, samples, 100 + j)
        wi = s.wi[:, s.valid]
        axis = normalize(wi.mean(axis=1)[:, None])
        opening = min(2.0, float((1 - dot(axis, wi)).max()) * 1.05)
        cone, q = _cone(sampler, p, n, axis, opening, 4 * samples, 200 + j)
        weight = q * 2 * np.pi * opening / q.size
        cells = _cells(axis, cone[:, q > 0])
        observed = np.bincount(cells(wi), minlength=BINS**2) / samples
        expected = np.bincount(cells(cone), weight, minlength=BINS**2)
        square = np.bincount(cells(cone), weight * weight, minlength=BINS**2)
        variance = square + observed * (1 - observed) / samples
        use = (expected * samples > 25) & (expected**2 > 25 * square)
        statistic = ((observed - expected)[use] ** 2 / variance[use]).sum()
        assert use.sum() >= 8
        assert chi2.sf(statistic, use.sum()) > level, f"point {j}: chi2 {statistic:.1f} over {use.sum()} bins"
        # What the cone holds of the pdf is what was sampled validly: the pdf integrates to at most 1.
        total, error = weight.sum(), np.sqrt(square.sum())
        assert total < 1 + 4.5 * error
        assert abs(total - s.valid.mean()) < 4.5 * np.hypot(error, np.sqrt(0.25 / samples))


def _cone(sampler, p, n, axis, opening, count, seed):
    u = np.random.default_rng(seed).random((2, count))
    below = u[0] * opening
    sine, phi = np.sqrt(below * (2 - below)), 2 * np.pi * u[1]
    x, y, z = frame_about(axis)
    wi = x * (sine * np.cos(phi)) + y * (sine * np.sin(phi)) + z * (1 - below)
    at = np.zeros(count, dtype=np.int64)
    return wi, sampler.pdf_direction(at, np.repeat(p[:, None], count, 1), np.repeat(n[:, None], count, 1), wi)


def _cells(axis, hit):
    """A function from directions to the cells of a grid, BINS quantiles of the directions `hit` across by
    BINS along.
    """
    x, y, _ = frame_about(axis)
    flat = np.stack([dot(x, hit), dot(y, hit)])
    _, _, turn = np.linalg.svd((flat - flat.mean(axis=1, keepdims=True)).T, full_matrices=False)
    share = np.linspace(0, 1, BINS + 1)[1:-1]

    def coordinates(wi):
        return np.einsum("ij,jn->in", turn, np.stack([dot(x, wi), dot(y, wi)]))

    edges = np.quantile(coordinates(hit), share, axis=1).T

    def cells(wi):
        a, b = (np.searchsorted(e, c) for e, c in zip(edges, coordinates(wi), strict=True))
        return a * BINS + b

    return cells


@pytest.mark.parametrize(("kind", "technique", "example"), SURFACES)
def test_a_surface_has_a_closed_form_where_its_kind_says_so(kind, technique, example):
    """`analytic-visibility` refuses by the kind, and takes the formula of all others for granted."""
    group = kind.make([example.source], [0])
    at = np.zeros(example.ref_p.shape[1], dtype=np.int64)
    assert (group.irradiance(at, example.ref_p, example.ref_n) is not None) == kind.closed_form


@pytest.mark.parametrize(("kind", "technique", "example"), CASES)
def test_rows_stand_alone(kind, technique, example):
    """The bits of a row are the same alone, in a batch, and in a batch of an odd length."""
    sampler = sampler_of(kind, technique, example)
    count = 37
    rng = np.random.default_rng(5)
    pick = rng.integers(0, example.ref_p.shape[1], count)
    p, n, u = example.ref_p[:, pick], example.ref_n[:, pick], rng.random((2, count))
    at = np.zeros(count, dtype=np.int64)
    whole = sampler.sample_direction(at, p, n, u)
    for i in range(count):
        one = sampler.sample_direction(at[i : i + 1], p[:, i : i + 1], n[:, i : i + 1], u[:, i : i + 1])
        assert one.valid[0] == whole.valid[i]
        assert np.array_equal(one.wi[:, 0], whole.wi[:, i], equal_nan=True)
        assert (one.dist[0], one.pdf[0]) == (whole.dist[i], whole.pdf[i]) or not one.valid[0]


@pytest.mark.parametrize(("kind", "technique", "example"), CASES)
def test_an_empty_batch_gives_an_empty_batch(kind, technique, example):
    none = np.zeros((3, 0))
    s = sampler_of(kind, technique, example).sample_direction(
        np.zeros(0, dtype=np.int64), none, none, np.zeros((2, 0))
    )
    assert s.wi.shape == (3, 0) and s.valid.shape == (0,)


@pytest.mark.parametrize(("kind", "technique", "example"), SURFACES)
def test_points_on_the_light_never_raise_and_never_give_light_that_is_not_finite(kind, technique, example):
    """At the light's own points: its centre, its corner, its plane, its surface. What is valid is finite."""
    lights = kind.make([example.source], [0])
    sampler = lights.techniques[technique]
    u = np.random.default_rng(1).random((2, 64))
    at = np.zeros(64, dtype=np.int64)
    on, normal = (np.broadcast_to(v, (3, 64)) for v in lights.position(at, u))
    extreme = np.array([[0.0, 0.0], [1 - 2**-53, 0.0], [0.5, 0.5]]).T
    corners, _ = lights.position(at[:3], extreme)
    for p in (
        on,
        on + (on[:, :1] - on[:, 1:2]),
        np.repeat(corners, 22, axis=1)[:, :64],
        on.mean(axis=1)[:, None].repeat(64, 1),
    ):
        s = sampler.sample_direction(at, np.ascontiguousarray(p), np.ascontiguousarray(-normal), u)
        ok = s.valid
        assert np.isfinite(s.wi[:, ok]).all() and np.isfinite(s.dist[ok]).all()
        assert np.isfinite(s.pdf[ok]).all() and (s.pdf[ok] > 0).all()
        np.testing.assert_allclose(dot(s.wi, s.wi)[ok], 1.0, rtol=1e-9)
