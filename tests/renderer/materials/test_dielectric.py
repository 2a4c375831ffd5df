"""Glass: its densities over the whole sphere, its energy, and its smooth limit by Snell and Fresnel."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from scipy.stats import chi2

from renderer.interfaces.material import Lobes, lobes_of
from renderer.materials.dielectric import DielectricMaterials
from renderer.math.vectors import combine, dot, frame_about, normalize
from renderer.records import SurfaceHit
from renderer.shading.microfacets import fresnel_dielectric
from scenes.description.materials import Dielectric
from scenes.description.shapes import ShapeDescription, Sphere

NORMAL = normalize(np.array([[0.3], [-0.5], [-0.7]]))
ROUGH = [(1.5, 0.3), (1.5, 0.6), (1 / 1.33, 0.5), (2.4, 0.4)]
VIEWS = (0.0, 0.4, 0.9, 1.3, 1.5)
ROWS, TURNS, NODES = 14, 8, 24


def material(eta: float, alpha: float, thin: bool = False) -> DielectricMaterials:
    return DielectricMaterials.make(
        [ShapeDescription(Sphere(np.zeros(3), 1.0), Dielectric(eta, alpha, thin))]
    )


def local(cosine: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Unit vectors (3, n) about the normal."""
    sine = np.sqrt((1 - cosine) * (1 + cosine))
    return combine(frame_about(NORMAL), sine * np.cos(phi), sine * np.sin(phi), cosine)


def seen(wo: np.ndarray, front: bool) -> SurfaceHit:
    n = wo.shape[1]
    none = np.zeros(n, dtype=np.int64)
    at = np.repeat(NORMAL, n, axis=1)
    return SurfaceHit(np.zeros((3, n)), at, wo, none, none, none, np.zeros((2, 1)), np.full(n, front))


def view(theta: float, count: int, front: bool) -> SurfaceHit:
    wo = local(np.array([np.sin(np.pi / 2 - theta)]), np.array([0.7]))
    return seen(np.repeat(wo, count, axis=1), front)


def cells(quantity) -> np.ndarray:
    """Integrals (ROWS, TURNS) over cells of equal solid angle, by Gauss and Legendre's nodes in each."""
    node, weight = np.polynomial.legendre.leggauss(NODES)
    node = (node + 1) / 2
    cosine = -1 + 2 / ROWS * (np.arange(ROWS)[:, None] + node)
    phi = 2 * np.pi / TURNS * (np.arange(TURNS)[:, None] + node)
    c, p = np.broadcast_arrays(cosine[:, :, None, None], phi)
    values = quantity(local(c.ravel(), p.ravel())).reshape(ROWS, NODES, TURNS, NODES)
    area = 4 * np.pi / (ROWS * TURNS) / 4
    return np.einsum("ritj,i,j->rt", values, weight, weight) * area


def cell_of(wi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x, y, z = frame_about(NORMAL)
    row = np.clip((dot(wi, z) + 1) / 2 * ROWS, 0, ROWS - 1e-9).astype(int)
    turn = (np.arctan2(dot(wi, y), dot(wi, x)) % (2 * np.pi)) / (2 * np.pi) * TURNS
    return row, np.minimum(turn.astype(int), TURNS - 1)


CASES = len(ROUGH) * len(VIEWS) * 2


@pytest.mark.parametrize("front", [True, False])
@pytest.mark.parametrize(("eta", "alpha"), ROUGH)
@pytest.mark.usefixtures("statistical")
def test_directions_follow_their_density_on_both_sides(eta: float, alpha: float, front: bool) -> None:
    """Sidak at 0.1 % over all; 2e5 samples catch a density that is off by some 3 % in one cell of 112."""
    glass, samples = material(eta, alpha), 200_000
    for j, theta in enumerate(VIEWS):
        hit = view(theta, samples, front)
        sample = glass.sample(hit, np.random.default_rng(j).random((2, samples)))
        good = sample.pdf > 0
        np.testing.assert_array_equal(sample.value, glass.evaluate(hit, sample.wi))
        np.testing.assert_array_equal(sample.pdf[good], glass.pdf(hit, sample.wi)[good])
        row, turn = cell_of(sample.wi[:, good])
        observed = np.bincount(row * TURNS + turn, minlength=ROWS * TURNS).reshape(ROWS, TURNS) / samples
        one = view(theta, ROWS * NODES * TURNS * NODES, front)
        expected = cells(lambda wi, one=one: glass.pdf(one, wi))
        use = expected * samples > 10
        # A cell that a lobe's edge crosses is integrated to within a hundredth of it.
        variance = expected * np.maximum(1 - expected, 0) / samples + (0.01 * expected) ** 2
        statistic = ((observed - expected)[use] ** 2 / variance[use]).sum()
        assert chi2.sf(statistic, use.sum()) > 1 - 0.999 ** (1 / CASES), (theta, statistic, use.sum())
        assert observed[~use].sum() < 1e-2


@pytest.mark.parametrize("front", [True, False])
@pytest.mark.parametrize(("eta", "alpha"), [*ROUGH, (1.5, 0.02)])
def test_what_is_reflected_and_refracted_is_no_more_than_arrives(
    eta: float, alpha: float, front: bool
) -> None:
    """Power, in which what is refracted is eta^2 times its radiance. f |cos| / pdf is at most 1 then."""
    glass, behind = material(eta, alpha), eta if front else 1 / eta
    for theta in VIEWS:
        hit = view(theta, 100_000, front)
        sample = glass.sample(hit, np.random.default_rng(7).random((2, 100_000)))
        cosine = dot(sample.wi, hit.n)
        with np.errstate(invalid="ignore", divide="ignore"):
            weight = np.where(sample.pdf > 0, sample.value[0] * np.abs(cosine) / sample.pdf, 0.0)
        weight = weight * np.where(cosine < 0, behind**2, 1.0)
        assert weight.max() <= 1 + 1e-9
        assert weight.mean() > 0.5
        if alpha < 0.1 and theta < 1:
            assert weight.mean() > 0.99  # little is lost between microfacets


@pytest.mark.parametrize(("eta", "alpha"), ROUGH)
def test_light_can_be_followed_either_way(eta: float, alpha: float) -> None:
    """Reflection is symmetric; of refraction the ways differ by eta^2 [pharr2023, sec. 9.5.2]."""
    rng, glass = np.random.default_rng(3), material(eta, alpha)
    wo, wi = local(rng.random(500), rng.random(500) * 7), local(2 * rng.random(500) - 1, rng.random(500) * 7)
    forward = glass.evaluate(seen(wo, True), wi)
    through = dot(wi, NORMAL) < 0
    there = seen(wi, True)
    back = SurfaceHit(
        there.p, np.where(through, -there.n, there.n), wi, there.shape, there.triangle, there.primitive,
        there.uv, ~through,
    )  # fmt: skip
    scale = np.where(through, eta**2, 1.0)
    assert (forward[0] > 0).mean() > 0.5
    np.testing.assert_allclose(forward * scale, glass.evaluate(back, wo), rtol=1e-10, atol=1e-300)


def exact_fresnel(cosine: float, eta: float) -> float:
    with mpmath.workdps(40):
        c, n = mpmath.mpf(cosine), mpmath.mpf(eta)
        if 1 - c**2 >= n**2:
            return 1.0
        t = mpmath.sqrt(1 - (1 - c**2) / n**2)
        return float((((n * c - t) / (n * c + t)) ** 2 + ((c - n * t) / (c + n * t)) ** 2) / 2)


@pytest.mark.parametrize("eta", [1.5, 1 / 1.5, 2.4, 1.0001, 1.0])
def test_fresnel_equations(eta: float) -> None:
    cosines = np.array([1.0, 0.99, 0.8, 0.745, 0.5, 0.1, 1e-3, 1e-9, 0.0])
    found, refracted = fresnel_dielectric(cosines, np.full(cosines.size, eta))
    expected = [exact_fresnel(c, eta) for c in cosines[:-1]]
    np.testing.assert_allclose(found[:-1], expected, rtol=1e-12, atol=1e-15)
    assert found[-1] == 1.0
    snell = np.sqrt(np.maximum(1 - (1 - cosines**2) / eta**2, 0))
    np.testing.assert_allclose(refracted, snell, atol=1e-7)


@pytest.mark.parametrize("front", [True, False])
@pytest.mark.parametrize("theta", [0.0, 0.5, 0.8, 1.2, 1.5])
def test_a_smooth_boundary_obeys_snell_and_fresnel(theta: float, front: bool) -> None:
    eta = 1.5 if front else 1 / 1.5
    hit = view(theta, 4, front)
    f = exact_fresnel(float(dot(hit.wo, hit.n)[0]), eta)
    u = np.array([[0.0, f * 0.999, min(f * 1.001, 1 - 1e-9), 1 - 1e-9], [0.5] * 4])
    sample = material(1.5, 0.0).sample(hit, u)
    assert sample.specular is not None and sample.specular.all()
    mirrored = u[0] < f
    along = sample.wi - hit.n * dot(sample.wi, hit.n)
    tangent = hit.wo - hit.n * dot(hit.wo, hit.n)
    np.testing.assert_allclose(along, np.where(mirrored, -1.0, -1 / eta) * tangent, atol=1e-12)
    np.testing.assert_array_equal(dot(sample.wi, hit.n) > 0, mirrored)
    np.testing.assert_allclose(sample.pdf, np.where(mirrored, f, 1 - f), rtol=1e-10)
    weight = sample.value * np.abs(dot(sample.wi, hit.n)) / sample.pdf
    np.testing.assert_allclose(weight, np.where(mirrored, 1.0, eta**-2) * np.ones((3, 1)), rtol=1e-10)


@pytest.mark.parametrize("theta", [0.0, 0.8, 1.4])
def test_a_pane_is_the_sum_over_its_inner_reflections(theta: float) -> None:
    hit = view(theta, 2, True)
    f = exact_fresnel(float(dot(hit.wo, hit.n)[0]), 1.5)
    total = f + sum((1 - f) ** 2 * f ** (2 * k + 1) for k in range(200))
    sample = material(1.5, 0.0, thin=True).sample(hit, np.array([[0.0, 1 - 1e-9], [0.5, 0.5]]))
    np.testing.assert_allclose(sample.pdf, [total, 1 - total], rtol=1e-12)
    np.testing.assert_allclose(sample.wi[:, 1], -hit.wo[:, 1], atol=1e-15)
    weight = sample.value * np.abs(dot(sample.wi, hit.n)) / sample.pdf
    np.testing.assert_allclose(weight, 1.0, rtol=1e-12)


def test_lobes_tell_smooth_from_rough() -> None:
    ball = Sphere(np.zeros(3), 1.0)
    both = Lobes.REFLECTION | Lobes.TRANSMISSION
    assert lobes_of(ShapeDescription(ball, Dielectric(1.5, 0.0))) == both | Lobes.SPECULAR
    assert lobes_of(ShapeDescription(ball, Dielectric(1.5, 0.2))) == both | Lobes.GLOSSY
