"""Every kind of material: samples follow the pdf, integrals agree, nobody gains energy, rows stand alone.

Directions are integrated over in polar coordinates of the half vector's slope. Equal steps of the radius's
logarithm resolve a Lambertian hemisphere and a lobe a thousandth wide alike, which at grazing angles is a
thousand times narrower one way still.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import chi2

from renderer.interfaces.material import MATERIALS, Lobes, MaterialKind
from renderer.math.vectors import dot, frame_about, normalize
from renderer.records import SurfaceHit
from scenes.description.materials import Conductor, Diffuse
from scenes.description.shapes import ShapeDescription

EXAMPLES = [
    pytest.param(kind, example.shape, id=f"{name}-{example.name}")
    for name, kind in MATERIALS.items()
    for example in kind.examples()
]
# Half vectors by their slope hold directions above the horizon; `test_dielectric.py` has the others.
OPAQUE = [
    pytest.param(kind, example.shape, id=f"{name}-{example.name}")
    for name, kind in MATERIALS.items()
    for example in kind.examples()
    if not kind.lobes(example.shape) & Lobes.TRANSMISSION
]
# Those whose f is an estimate: integrals of it are noisy, and the noise differs from that of the other way.
ESTIMATED = [e.shape for _, kind in MATERIALS.items() for e in kind.examples() if e.estimated]
EXACT = [
    pytest.param(kind, example.shape, id=f"{name}-{example.name}")
    for name, kind in MATERIALS.items()
    for example in kind.examples()
    if not (kind.lobes(example.shape) & Lobes.TRANSMISSION or example.estimated)
]
# Angles of wo with the normal, in radians
VIEWS = (0.0, 0.4, 1.1, 1.5, np.pi / 2 - 1e-3)
NORMAL = normalize(np.array([[0.3], [-0.5], [-0.7]]))
RADII, TURNS = 12, 10


def is_estimated(shape: ShapeDescription) -> bool:
    return any(shape is one for one in ESTIMATED)


def hits(wo: np.ndarray, shape: int = 0) -> SurfaceHit:
    """Points with one normal, seen along wo (3, n)."""
    n = wo.shape[1]
    none = np.full(n, -1, dtype=np.int64)
    at = np.full(n, shape, dtype=np.int64)
    return SurfaceHit(np.zeros((3, n)), np.repeat(NORMAL, n, axis=1), wo, at, none, none, np.zeros((2, n)))


def direction(theta, phi) -> np.ndarray:
    """(3, n) at angles theta from the normal; the cosine is the sine of the rest, so that grazing angles keep
    their digits.
    """
    theta, phi = np.broadcast_arrays(np.atleast_1d(np.asarray(theta, dtype=float)), phi)
    x, y, z = frame_about(NORMAL)
    return (
        x * (np.sin(theta) * np.cos(phi)) + y * (np.sin(theta) * np.sin(phi)) + z * np.sin(np.pi / 2 - theta)
    )


def seen_from(theta: float, count: int) -> SurfaceHit:
    return hits(np.repeat(direction(theta, 0.7), count, axis=1))


def made(kind, shape: ShapeDescription) -> MaterialKind:
    return kind.make([shape])


def sampled(material: MaterialKind, hit: SurfaceHit, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions and pdf of samples, whose f must be what `evaluate` gives along them."""
    sample = material.sample(hit, u)
    assert np.array_equal(sample.value, material.evaluate(hit, sample.wi))
    assert sample.specular is None or not sample.specular.any()
    return sample.wi, sample.pdf


@dataclass(frozen=True)
class Slopes:
    """Directions wi seen from wo (3, 1) by the slope of wo + wi against the normal, in polar coordinates."""

    wo: np.ndarray

    @property
    def steepest(self) -> float:
        """More than any direction above the horizon has: |h| < 2 over a height of at least wo's."""
        return 3 / float(dot(self.wo, NORMAL)[0])

    def of(self, wi):
        """Radius and angle."""
        h = self.wo + wi
        height = dot(h, NORMAL)
        x, y, _ = frame_about(NORMAL)
        flat = h - NORMAL * height
        return np.sqrt(dot(flat, flat)) / height, np.arctan2(dot(y, flat), dot(x, flat)) % (2 * np.pi)

    def at(self, r, phi):
        """wi, and the solid angle of d(log r) d(phi), r^2 cos^3(h) 4 (wo.h) [walter2007, eq. 14]; 0 where h
        turns away from wo.
        """
        x, y, z = frame_about(NORMAL)
        h = (x * (r * np.cos(phi)) + y * (r * np.sin(phi)) + z) / np.sqrt(1 + r * r)
        towards = dot(self.wo, h)
        return 2 * towards * h - self.wo, r * r / (1 + r * r) ** 1.5 * 4 * np.maximum(towards, 0.0)


def slopes(theta: float) -> Slopes:
    return Slopes(direction(theta, 0.7))


def nodes(material: MaterialKind, theta: float, edges: np.ndarray, steps: int, quantity) -> np.ndarray:
    """A quantity times the solid angle of each node, steps x steps of Gauss and Legendre's in each cell of
    log r and the angle: (..., n), by cells of log r, then nodes, then angles.

    edges: (RADII + 1,) of r. quantity: (hit, wi) -> (..., n).
    """
    around = slopes(theta)
    node, weight = np.polynomial.legendre.leggauss(steps)
    turn = 2 * np.pi / TURNS
    phi, dphi = (
        np.concatenate([turn * (i + (node + 1) / 2) for i in range(TURNS)]),
        np.tile(weight * turn / 2, TURNS),
    )
    cells = []
    for low, high in zip(np.log(edges[:-1]), np.log(edges[1:]), strict=True):
        r = np.exp(low + (high - low) * (node + 1) / 2)
        area = weight[:, None] * ((high - low) / 2) * dphi
        r_all, phi_all = (np.ascontiguousarray(a).ravel() for a in np.broadcast_arrays(r[:, None], phi))
        wi, solid_angle = around.at(r_all, phi_all)
        cells.append(quantity(seen_from(theta, r_all.size), wi) * (solid_angle * area.ravel()))
    return np.concatenate(cells, axis=-1)


def integrals(material: MaterialKind, theta: float, edges: np.ndarray, steps: int, quantity) -> np.ndarray:
    """The sums of `nodes` over each cell: (..., RADII, TURNS)."""
    value = nodes(material, theta, edges, steps, quantity)
    return value.reshape(*value.shape[:-1], RADII, steps, TURNS, steps).sum(axis=(-3, -1))


def edges_for(theta: float, r: np.ndarray) -> np.ndarray:
    """Quantiles of the sampled r.

    The innermost 1e-4 of the first cell, with 1e-8 of its mass, is left out.
    """
    inner = np.quantile(r, np.linspace(0, 1, RADII + 1)[1:-1])
    return np.concatenate([[inner[0] * 1e-4], inner, [slopes(theta).steepest]])


def shares(material: MaterialKind, shape: ShapeDescription, theta: float, edges: np.ndarray, steps: int):
    """The reflected share (3,) of a view by quadrature, and its standard error (3,), 0 where f is exact.

    The noise of an estimate is that of the values at the nodes, known from two points of the surface.
    """
    here = reflected(material)
    if not is_estimated(shape):
        return integrals(material, theta, edges, steps, here).sum(axis=(-2, -1)), np.zeros(3)

    def elsewhere(hit, wi):
        return here(replace(hit, p=hit.p + 1.0), wi)

    both = [nodes(material, theta, edges, steps, one) for one in (here, elsewhere)]
    variance = (both[0] - both[1]) ** 2 / 4
    return ((both[0] + both[1]) / 2).sum(axis=-1), np.sqrt(variance.sum(axis=-1))


def reflected(material: MaterialKind):
    """The integrand of the reflected share, f cos above the horizon."""
    return lambda hit, wi: material.evaluate(hit, wi) * np.maximum(dot(wi, hit.n), 0.0)


@pytest.mark.parametrize(("kind", "shape"), OPAQUE)
def test_the_sampled_pdf_is_the_pdf_asked_for(kind, shape):
    """Catches a pdf that differs between the two routines by more than 1e-6: a forgotten Jacobian of the half
    vector.
    """
    material = made(kind, shape)
    for j, theta in enumerate(VIEWS):
        hit = seen_from(theta, 2000)
        wi, pdf = sampled(material, hit, np.random.default_rng(j).random((2, 2000)))
        assert (pdf > 0).mean() > 0.4
        np.testing.assert_allclose(dot(wi, wi), 1.0, rtol=1e-9)
        np.testing.assert_allclose(material.pdf(hit, wi), pdf, rtol=1e-6)
        assert (material.pdf(hit, -normalize(hit.n + 0.5 * wi)) == 0).all()


def follows(kind, shape: ShapeDescription, samples: int, steps: int, level: float) -> None:
    """The chi-square test, and the two totals that the same draws give: of the pdf, and of the reflected
    share.
    """
    material = made(kind, shape)
    for j, theta in enumerate(VIEWS):
        hit = seen_from(theta, samples)
        wi, pdf = sampled(material, hit, np.random.default_rng(100 + j).random((2, samples)))
        valid = pdf > 0
        r, phi = slopes(theta).of(wi[:, valid])
        edges = edges_for(theta, r)
        expected = integrals(material, theta, edges, steps, material.pdf)
        row = np.searchsorted(edges[1:-1], r)
        column = np.minimum((phi * (TURNS / (2 * np.pi))).astype(np.int64), TURNS - 1)
        observed = np.bincount(row * TURNS + column, minlength=RADII * TURNS).reshape(RADII, TURNS) / samples
        # The rule is wrong where the horizon cuts a cell, by at most what lies within a step of it.
        cut = expected * (2 / steps) * _crosses(material, theta, edges)
        use = expected * samples > 10
        variance = np.maximum(expected * (1 - expected), 0) / samples + cut**2
        statistic = ((observed - expected)[use] ** 2 / variance[use]).sum()
        assert chi2.sf(statistic, use.sum()) > level, (
            f"view {theta:.4f}: chi2 {statistic:.1f} over {use.sum()} cells"
        )
        total, error = expected.sum(), np.sqrt((cut**2).sum())
        assert total < 1 + error + 1e-5
        assert abs(total - valid.mean()) < 4.5 * np.sqrt(max(total * (1 - total), 0) / samples) + error + 1e-5

        fine = 16 if is_estimated(shape) else steps  # the noise of an estimate hides what more nodes tell
        share, noise = shares(material, shape, theta, edges, fine)
        with np.errstate(invalid="ignore", divide="ignore"):
            weight = np.where(valid, reflected(material)(hit, wi) / pdf, 0.0)
        spread = np.hypot(weight.std(axis=1) / np.sqrt(samples), noise)
        # The share has no step at the horizon, but a kink.
        assert (np.abs(weight.mean(axis=1) - share) < 4.5 * spread + 0.2 / fine**2 + 1e-5).all()


def _crosses(material: MaterialKind, theta: float, edges: np.ndarray) -> np.ndarray:
    """(RADII, TURNS) 1 where the horizon passes through a cell: where it has nodes on both of its sides."""
    above = integrals(material, theta, edges, 4, lambda hit, wi: (dot(wi, hit.n) > 0) + 0.0)
    all_ = integrals(material, theta, edges, 4, lambda hit, wi: np.ones(wi.shape[1]))
    return ((above > 0) & (above < all_)) + 0.0


LEVEL = 1 - 0.999 ** (1 / (len(OPAQUE) * len(VIEWS)))


@pytest.mark.parametrize(("kind", "shape"), OPAQUE)
@pytest.mark.usefixtures("statistical")
def test_sampled_directions_follow_the_pdf(kind, shape):
    """Sidak over all views of all examples at 0.1 %. 1e5 samples in up to 120 cells catch a density off by
    some 4 % in a cell.
    """
    follows(kind, shape, 100_000, 40, LEVEL)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "shape"), OPAQUE)
def test_a_million_sampled_directions_follow_the_pdf(kind, shape):
    """As above, to 1.2 % in a cell."""
    follows(kind, shape, 1_000_000, 120, LEVEL)


@pytest.mark.parametrize(("kind", "shape"), EXACT)
def test_light_can_be_followed_either_way(kind, shape):
    """Helmholtz reciprocity, near the mirror direction and far from it.

    Catches a masking of one direction only.
    """
    rng = np.random.default_rng(3)
    material = made(kind, shape)
    for spread in (2e-3, 0.2, 3.0):
        theta, turn = np.arccos(rng.random(500)), rng.random(500) * 7
        wo = direction(theta, turn)
        wi = normalize(direction(-theta, turn) + spread * rng.normal(size=(3, 500)) / 2)
        up = (dot(wi, NORMAL) > 0) & (dot(wo, NORMAL) > 0)
        wo, wi = np.ascontiguousarray(wo[:, up]), np.ascontiguousarray(wi[:, up])
        forward, back = material.evaluate(hits(wo), wi), material.evaluate(hits(wi), wo)
        assert (forward >= 0).all() and forward.any()
        np.testing.assert_allclose(forward, back, rtol=1e-12)


@pytest.mark.parametrize(("kind", "shape"), EXAMPLES)
@pytest.mark.parametrize("theta", [*VIEWS, 0.8, 1.35, np.pi / 2 - 1e-5])
@pytest.mark.usefixtures("statistical")
def test_no_material_reflects_more_than_it_receives(kind, shape, theta):
    """The white furnace: the reflected share of every view is at most 1, by quadrature from slopes of 1e-8
    on.
    """
    edges = np.geomspace(1e-8, slopes(theta).steepest, RADII + 1)
    material = made(kind, shape)
    share, noise = shares(material, shape, float(theta), edges, 30)
    assert (share > 0.01).all() and (share <= 1 + 1e-3 + 4.5 * noise).all()
    assert (noise < 0.01).all()


@pytest.mark.parametrize(("kind", "shape"), EXAMPLES)
def test_nothing_is_lost_in_the_dark_corners(kind, shape):
    """Grazing to 1e-6 rad and beyond, and the corners of the unit square: finite, not negative, without a
    warning.
    """
    material = made(kind, shape)
    edge = 1 - 2.0**-53
    u = np.array([(a, b) for a in (0.0, 0.5, edge) for b in (0.0, 1e-9, 0.5, edge)]).T
    for theta in (0.0, 1e-9, 1e-3, 1.0, *(np.pi / 2 - 10.0**-k for k in (3, 6, 9, 15))):
        hit = seen_from(theta, u.shape[1])
        wi, pdf = sampled(material, hit, u)
        assert np.isfinite(wi).all() and np.isfinite(pdf).all() and (pdf >= 0).all()
        np.testing.assert_allclose(dot(wi, wi), 1.0, rtol=1e-6)
        turn = np.linspace(0, 7, u.shape[1])
        for wi_ in (wi, hit.wo, -hit.wo, direction(theta, turn), direction(np.pi / 2 - 1e-6, turn), hit.n):
            value, density = material.evaluate(hit, wi_), material.pdf(hit, wi_)
            assert np.isfinite(value).all() and (value >= 0).all()
            assert np.isfinite(density).all() and (density >= 0).all()


@pytest.mark.parametrize(("kind", "shape"), EXAMPLES)
def test_rows_stand_alone(kind, shape):
    """The bits of a row are the same alone, in a batch of an odd length, and in a scene of several
    materials.
    """
    rng = np.random.default_rng(5)
    wo, u = direction(np.arccos(rng.random(37)), rng.random(37) * 7), rng.random((2, 37))
    for material, index in ((made(kind, shape), 0), (kind.make([*map(plain, range(2)), shape]), 2)):
        wi, pdf = sampled(material, hits(wo, index), u)
        value = material.evaluate(hits(wo, index), wi)
        for i in range(37):
            one = hits(np.ascontiguousarray(wo[:, i : i + 1]), index)
            wi_one, pdf_one = sampled(material, one, np.ascontiguousarray(u[:, i : i + 1]))
            assert np.array_equal(wi_one[:, 0], wi[:, i]) and pdf_one[0] == pdf[i]
            assert np.array_equal(material.evaluate(one, wi_one)[:, 0], np.broadcast_to(value, (3, 37))[:, i])


def plain(i: int) -> ShapeDescription:
    """A shape of either of two kinds of material."""
    shape = EXAMPLES[0].values[1]
    metal = Conductor(np.full(3, 0.2), np.full(3, 3.0), 0.3)
    return ShapeDescription(shape.geometry, metal if i % 2 else Diffuse(np.full(3, 0.5)))


@pytest.mark.parametrize(("kind", "shape"), EXAMPLES)
def test_an_empty_batch_gives_an_empty_batch(kind, shape):
    material, none = made(kind, shape), np.zeros((3, 0))
    wi, pdf = sampled(material, hits(none), np.zeros((2, 0)))
    assert wi.shape == (3, 0) and pdf.shape == (0,) and material.pdf(hits(none), none).shape == (0,)
    assert material.evaluate(hits(none), none).shape in ((3, 0), (3, 1))


@pytest.mark.parametrize(("kind", "shape"), EXAMPLES)
def test_points_of_other_materials_are_black(kind, shape):
    """Exactly, not to rounding: their radiance comes from their own kind alone."""
    shapes = [plain(0), plain(1), shape]
    material, theta = kind.make(shapes), np.linspace(0, 1.5, 200)
    for i, one in enumerate(shapes):
        value = material.evaluate(hits(direction(theta, 0.7), i), direction(-theta[::-1], 0.8))
        assert value.any() == kind.accepts(one)
        assert not kind.accepts(one) or kind.lobes(one)


@pytest.mark.parametrize(("kind", "shape"), EXAMPLES)
@pytest.mark.parametrize("theta", VIEWS)
def test_a_surface_scatters_about_its_shading_normal_alone(kind, shape, theta: float):
    """To the bit as a surface whose geometric normal is the shading normal, wherever its own one points."""
    material = made(kind, shape)
    flat = seen_from(theta, 64)
    leaning = replace(flat, n=np.repeat(frame_about(NORMAL)[0], 64, axis=1), shading_n=flat.n)
    u = np.random.default_rng(7).random((2, 64))
    wi = direction(np.linspace(0.01, np.pi - 0.01, 64), np.linspace(0.0, 6.0, 64))
    assert np.array_equal(material.evaluate(leaning, wi), material.evaluate(flat, wi))
    assert np.array_equal(material.pdf(leaning, wi), material.pdf(flat, wi))
    found, expected = material.sample(leaning, u), material.sample(flat, u)
    assert np.array_equal(found.wi, expected.wi) and np.array_equal(found.pdf, expected.pdf)
